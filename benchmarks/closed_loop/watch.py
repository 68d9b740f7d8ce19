"""The judge over one episode: what was touched, and how near it came."""

from collections.abc import Mapping
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT

Floats = NDArray[np.float64]

# A state is judged anew once things may have moved by this share of the distance found
# last, or be nearer than NEAR [m]: no contact can hide between two judged states.
SHARE = 0.1
NEAR = 0.02


class Contact(NamedTuple):
    """A contact that counts.

    Attributes:
        time: When it was first seen [s].
        a: One body.
        b: The other.
        depth: Its greatest depth [m].
    """

    time: float
    a: str
    b: str
    depth: float


@numba.njit(cache=True)
def step_ways(before, q_rows, reach, first, ways, moving):
    """Farthest anything can have moved in each substep, and which arms did.

    Args:
        before: Positions before the first, shape (n,).
        q_rows: Positions after each, shape (k, n).
        reach: How far a unit of each joint can move anything, shape (n,).
        first: First joint of each arm, shape (a,).
        ways: Overwritten, shape (k,) [m].
        moving: Overwritten, shape (k, a).
    """
    for k in range(q_rows.shape[0]):
        last = before if k == 0 else q_rows[k - 1]
        ways[k] = 0.0
        for a in range(first.shape[0]):
            end = first[a + 1] if a + 1 < first.shape[0] else reach.shape[0]
            way = 0.0
            for j in range(first[a], end):
                way += abs(q_rows[k, j] - last[j]) * reach[j]
            moving[k, a] = way > 0.0
            ways[k] += way


class Watch:
    """Judges as many states of an episode as their motion asks for.

    A pair counts at a moment if an arm of it moved in the substep before: an object
    that runs into an arm at standstill is not the guard's doing.

    Attributes:
        least: Least distance of a pair that counted, `SIGHT` if none was in sight [m].
        contact: The first contact, None if there was none.
        judged: Number of states judged.

    Args:
        judge: The judge.
        first: First joint of each arm, and n, shape (a + 1,).
        q: Positions at the start, shape (n,).
        outer: How far the true surface of each geom lies outside its model,
            shape (g,) [m].
    """

    def __init__(
        self, judge: Judge, first: NDArray[np.int64], q: Floats, outer: Floats
    ) -> None:
        self.least = SIGHT
        self.contact: Contact | None = None
        self.judged = 0
        self._judge = judge
        self._first = first[:-1]
        self._outer = outer
        self._sight = SIGHT - 2.0 * float(outer.max(initial=0.0))
        self._q = q.copy()
        self._p: dict[str, Floats] = {}
        self._room = 0.0
        self._moved = 0.0

    def look(self, times: Floats, q_rows: Floats, p_rows: Mapping[str, Floats]) -> None:
        """Judge the states of some substeps, as many as are needed.

        Args:
            times: Time of each state, shape (k,) [s].
            q_rows: True positions, shape (k, n).
            p_rows: Where each moving object is, from where the scene has it, (k, 3).
        """
        ways = np.zeros(len(q_rows))
        moving = np.zeros((len(q_rows), len(self._first)), dtype=np.bool_)
        step_ways(self._q, q_rows, self._judge.reach, self._first, ways, moving)
        self._q = q_rows[-1].copy()
        if p_rows:
            ways += self._object_ways(p_rows)
        if self._moved + ways.sum() < self._room:
            self._moved += float(ways.sum())
            return
        for k in range(len(ways)):
            self._moved += ways[k]
            if ways[k] > 0.0 and not self._moved < self._room:
                for name, rows in p_rows.items():
                    self._judge.stand_at(name, rows[k])
                self._see(float(times[k]), q_rows[k], moving[k])

    def _see(self, time: float, q: Floats, moving: NDArray[np.bool_]) -> None:
        """Judge one state."""
        self.judged += 1
        self._moved = 0.0
        distances, geoms = self._judge.measure(q)
        distances = distances - self._outer[geoms].sum(axis=1)
        clear = float(distances.min(initial=self._sight))
        self._room = max(SHARE * clear, clear - NEAR)
        if clear >= self.least:
            return
        # Geoms of objects have arm -1 and take the last place, which never moves.
        counts = np.append(moving, False)[self._judge.arm_of[geoms]].any(axis=1)
        if not counts.any():
            return
        k = int(np.argmin(np.where(counts, distances, np.inf)))
        self.least = min(self.least, float(distances[k]))
        if distances[k] >= 0.0:
            return
        if self.contact is None:
            a, b = (self._judge.owners[g] for g in geoms[k])
            self.contact = Contact(time, a, b, 0.0)
        depth = max(self.contact.depth, -float(distances[k]))
        self.contact = self.contact._replace(depth=depth)

    def _object_ways(self, p_rows: Mapping[str, Floats]) -> Floats:
        """Farthest any object moved in each substep, shape (k,) [m]."""
        ways = []
        for name, rows in p_rows.items():
            before = self._p.get(name, rows[0])
            steps = np.diff(rows, axis=0, prepend=before[None])
            ways.append(np.linalg.norm(steps, axis=1))
            self._p[name] = rows[-1].copy()
        return np.max(ways, axis=0)
