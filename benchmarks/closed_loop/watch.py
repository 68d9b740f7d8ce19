"""The judge over one episode: what was touched, and how near it came."""

from collections.abc import Mapping
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT
from closed_loop.settings import SUBSTEP

Floats = NDArray[np.float64]

# A state is judged anew once things may have moved by this share of the distance found
# last, or be nearer than NEAR [m]: no contact can hide between two judged states.
SHARE = 0.1
NEAR = 0.02

# Pairs nearer than this are asked who closes them [m].
CLOSE = 0.01


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
def step_ways(q, p, q_rows, p_rows, reach, first, ways, moving):
    """Farthest anything can have moved in each substep, and which arms did.

    Args:
        q: Positions before the first, shape (n,); those after the last from then on.
        p: Displacements of objects before the first, shape (m, 3), the same [m].
        q_rows: Positions after each, shape (k, n).
        p_rows: Displacements after each, shape (k, m, 3) [m].
        reach: How far a unit of each joint can move anything, shape (n,).
        first: First joint of each arm, and n, shape (a + 1,).
        ways: Overwritten, shape (k,) [m].
        moving: Overwritten, shape (k, a).

    Returns:
        Sum of the ways [m].
    """
    total = 0.0
    for k in range(len(ways)):
        ways[k] = 0.0
        for i in range(len(p)):
            way = 0.0
            for x in range(3):
                way += (p_rows[k, i, x] - p[i, x]) ** 2
                p[i, x] = p_rows[k, i, x]
            ways[k] = max(ways[k], np.sqrt(way))
        for arm in range(len(first) - 1):
            way = 0.0
            for j in range(first[arm], first[arm + 1]):
                way += abs(q_rows[k, j] - q[j]) * reach[j]
                q[j] = q_rows[k, j]
            moving[k, arm] = way > 0.0
            ways[k] += way
        total += ways[k]
    return total


@numba.njit(cache=True)
def nearest_of(distances, geoms, outer, arm_of, moving):
    """Least distance of all pairs, and the nearest of those that count.

    Args:
        distances: Of the models' surfaces, shape (k,) [m].
        geoms: Pairs of geoms, shape (k, 2).
        outer: How far the true surface of each geom lies outside, shape (g,) [m].
        arm_of: Arm of each geom, -1 for objects, shape (g,).
        moving: Which arms moved, shape (a,).

    Returns:
        Least distance of the true surfaces [m], infinite if there is no pair; the same
        of a pair of which an arm moved, and which that is.
    """
    least = counting = np.inf
    which = -1
    for k in range(len(distances)):
        counts, distance = False, distances[k]
        for side in range(2):
            arm = arm_of[geoms[k, side]]
            counts |= arm >= 0 and moving[arm]
            distance -= outer[geoms[k, side]]
        least = min(least, distance)
        if counts and distance < counting:
            counting, which = distance, k
    return least, counting, which


class Watch:
    """Judges as many states of an episode as their motion asks for.

    A pair counts at a moment if an arm of it moved in the substep before: an object
    that runs into an arm at standstill is not the guard's doing. Where arms may leave
    what comes at them, neither is one that catches up with an arm that moves away from
    it: of such a pair only an arm counts that would be farther away had it stayed where
    it rested, and none that the object has run into until they are apart again.

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
        movers: Where each moving object is at the start, from where the scene has it,
            shape (3,) [m].
        leaving: Whether arms may leave what comes at them.
    """

    def __init__(
        self,
        judge: Judge,
        first: NDArray[np.int64],
        q: Floats,
        outer: Floats,
        movers: Mapping[str, Floats],
        *,
        leaving: bool = False,
    ) -> None:
        self.least = SIGHT
        self.contact: Contact | None = None
        self.judged = 0
        self._judge = judge
        self._first = first
        self._outer = outer
        self._sight = SIGHT - 2.0 * float(outer.max(initial=0.0))
        self._names = frozenset(movers)
        self._movers = tuple(movers)
        self._partners: set[tuple[int | str, ...]] = set()
        self._leaving = leaving
        self._q = q.copy()
        self._rest = q.copy()
        self._p = np.array([*movers.values()]).reshape(-1, 3)
        self._moving = np.zeros(len(first) - 1, dtype=np.bool_)
        self._room = 0.0
        self._moved = 0.0

    def look(self, tick: int, q_rows: Floats, p_rows: Floats) -> None:
        """Judge the states of some substeps, as many as are needed.

        Args:
            tick: Substep of the last state before.
            q_rows: True positions, shape (k, n).
            p_rows: Where the moving objects are, shape (k, m, 3) [m].
        """
        ways = np.empty(len(q_rows))
        moving = np.empty((len(q_rows), len(self._moving)), dtype=np.bool_)
        total = step_ways(
            self._q,
            self._p,
            q_rows,
            p_rows,
            self._judge.reach,
            self._first,
            ways,
            moving,
        )
        self._moving = moving[-1]
        if self._moved + total < self._room:
            self._moved += total
            self._rest_before(q_rows, moving)
            return
        for k, way in enumerate(ways.tolist()):
            self._moved += way
            if way > 0.0 and not self._moved < self._room:
                for i, name in enumerate(self._movers):
                    self._judge.stand_at(name, p_rows[k, i])
                self._rest_before(q_rows[: k + 1], moving[: k + 1])
                self._see((tick + 1 + k) * SUBSTEP, q_rows[k], moving[k])
        self._rest_before(q_rows, moving)

    def see_last(self, tick: int) -> None:
        """Judge the last state, its objects being where the judge has them."""
        self._see(tick * SUBSTEP, self._q, self._moving)

    def _rest_before(self, q_rows: Floats, moving: NDArray[np.bool_]) -> None:
        """Note where each arm rested last, for what may leave."""
        if not self._leaving:
            return
        for arm in range(moving.shape[1]):
            rests = np.flatnonzero(~moving[:, arm])
            if len(rests):
                own = slice(self._first[arm], self._first[arm + 1])
                self._rest[own] = q_rows[rests[-1], own]

    def _see(self, time: float, q: Floats, moving: NDArray[np.bool_]) -> None:
        """Judge one state."""
        self.judged += 1
        self._moved = 0.0
        distances, geoms = self._judge.measure(q)
        arm_of = self._judge.arm_of
        least, counting, k = nearest_of(distances, geoms, self._outer, arm_of, moving)
        if self._leaving and (least < CLOSE or self._partners):
            distances, geoms = self._closed_by_arms(distances, geoms, q)
            _, counting, k = nearest_of(distances, geoms, self._outer, arm_of, moving)
        clear = min(least, self._sight)
        self._room = max(SHARE * clear, clear - NEAR)
        if not counting < self.least:
            return
        self.least = counting
        if counting >= 0.0:
            return
        if self.contact is None:
            a, b = (self._judge.owners[g] for g in geoms[k])
            self.contact = Contact(time, a, b, 0.0)
        depth = max(self.contact.depth, -counting)
        self.contact = self.contact._replace(depth=depth)

    def _closed_by_arms(
        self, distances: Floats, geoms: NDArray[np.int32], q: Floats
    ) -> tuple[Floats, NDArray[np.int32]]:
        """The pairs without those that moving objects close, and arms do not.

        An object that has run into an arm is its partner until they are apart again.
        """
        judge = self._judge
        met, touching, kept = [], set(), np.ones(len(geoms), dtype=np.bool_)
        for k, (a, b) in enumerate(geoms.tolist()):
            names = {judge.owners[a], judge.owners[b]} & self._names
            if not names or not distances[k] < CLOSE:
                continue
            arm = int(max(judge.arm_of[a], judge.arm_of[b]))
            meeting = (arm, *names)
            if distances[k] < self._outer[a] + self._outer[b]:
                touching.add(meeting)
            met.append((k, (a, b), arm, meeting))
        for k, pair, arm, meeting in met:
            # Had it stayed where it rested, would they be farther apart?
            own = slice(self._first[arm], self._first[arm + 1])
            elsewhere = q.copy()
            elsewhere[own] = self._rest[own]
            judge.place(elsewhere)
            kept[k] = judge.gap(pair) > distances[k] and meeting not in self._partners
        judge.place(q)
        self._partners &= touching
        closed = {meeting for k, _, _, meeting in met if kept[k]}
        self._partners |= touching - closed
        return distances[kept], geoms[kept]
