"""The judge over one episode: what was touched, and how near it came."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numba
import numpy as np

from arrays import Bools, Floats, Ints
from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT
from closed_loop.settings import SUBSTEP

# A state is judged anew once bodies may have moved by this share of the distance found
# last, or be nearer than NEAR [m]: no contact can hide between two judged states.
SHARE = 0.1
NEAR = 0.02

# An arm that was met on its way out would have been met at rest as well if the object
# touches the resting arm before it, or no later than this after it [s].
AS_WELL = 0.1


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


class Meeting(NamedTuple):
    """An object that moves and an arm on its way out of what is too near, touching.

    Attributes:
        contact: When and who.
        tick: Substep in which it was seen.
        arm: The arm.
        mover: Place of the object among those that move.
        rest: Positions of the arm where it rested last, of its own joints.
        since: Substep in which it rested there last.
    """

    contact: Contact
    tick: int
    arm: int
    mover: int
    rest: Floats
    since: int


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


def nearest_of(
    distances: Floats,
    geoms: Ints,
    outer: Floats,
    arm_of: Ints,
    moving: Bools,
) -> tuple[float, float, int]:
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
    if len(distances) == 0:
        return np.inf, np.inf, -1
    a, b = geoms.T
    true = distances - outer[a] - outer[b]
    # Objects, of arm -1, never count.
    moves = np.append(moving, False)
    counting = np.where(moves[arm_of[a]] | moves[arm_of[b]], true, np.inf)
    k = int(counting.argmin())
    return float(true.min()), float(counting[k]), k


class Watch:
    """Judges as many states of an episode as their motion requires.

    A pair counts at a moment if an arm of it moved in the substep before: an object
    that runs into an arm at standstill is not the guard's fault. An arm that leaves
    what is too near can be met by an object as it could at rest. Such a meeting counts
    as a contact if the same object does not touch the same arm resting where it rested
    last; else it is counted by itself. The pair counts again when they are apart.

    Attributes:
        least: Least distance of a pair that counted, `SIGHT` if none was in sight [m].
        contact: The first contact, None if there was none.
        judged: Number of states judged.
        leaving: Whether each arm leaves what is too near, shape (a,); the episode
            writes it.
        met_at_rest: Meetings in which the resting arm would have been met as well;
            known once `judge_meetings` was called.

    Args:
        judge: The judge.
        first: First joint of each arm, and n, shape (a + 1,).
        q: Positions at the start, shape (n,).
        outer: How far the true surface of each geom lies outside its model,
            shape (g,) [m].
        movers: Where each moving object is at the start, from where the scene has it,
            shape (3,) [m].
    """

    def __init__(
        self,
        judge: Judge,
        first: Ints,
        q: Floats,
        outer: Floats,
        movers: Mapping[str, Floats],
    ) -> None:
        self.least = SIGHT
        self.contact: Contact | None = None
        self.judged = 0
        self._judge = judge
        self._first = first
        self._outer = outer
        self._sight = SIGHT - 2.0 * float(outer.max(initial=0.0))
        self._movers = tuple(movers)
        self.leaving = np.zeros(len(first) - 1, dtype=np.bool_)
        self.met_at_rest = 0
        self._meetings: list[Meeting] = []
        self._touching: dict[tuple[int, int], int] = {}
        self._q = q.copy()
        self._rest = q.copy()
        self._rested = np.zeros(len(first) - 1, dtype=np.int64)
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
            self._rest_before(tick, q_rows, moving)
            return
        for k, way in enumerate(ways.tolist()):
            self._moved += way
            if way > 0.0 and not self._moved < self._room:
                for i, name in enumerate(self._movers):
                    self._judge.stand_at(name, p_rows[k, i])
                self._rest_before(tick, q_rows[: k + 1], moving[: k + 1])
                self._see((tick + 1 + k) * SUBSTEP, q_rows[k], moving[k])
        self._rest_before(tick, q_rows, moving)

    def see_last(self, tick: int) -> None:
        """Judge the last state, its objects being where the judge has them."""
        self._see(tick * SUBSTEP, self._q, self._moving)

    def _rest_before(self, tick: int, q_rows: Floats, moving: Bools) -> None:
        """Note where each arm rested last, and when."""
        for arm in range(moving.shape[1]):
            rests = np.flatnonzero(~moving[:, arm])
            if len(rests):
                own = slice(self._first[arm], self._first[arm + 1])
                self._rest[own] = q_rows[rests[-1], own]
                self._rested[arm] = tick + 1 + rests[-1]

    def _see(self, time: float, q: Floats, moving: Bools) -> None:
        """Judge one state."""
        self.judged += 1
        self._moved = 0.0
        distances, geoms = self._judge.measure(q)
        arm_of = self._judge.arm_of
        least, counting, k = nearest_of(distances, geoms, self._outer, arm_of, moving)
        if self._touching or (self.leaving & moving).any():
            distances, geoms = self._without_meetings(time, distances, geoms, moving)
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

    def _without_meetings(
        self,
        time: float,
        distances: Floats,
        geoms: Ints,
        moving: Bools,
    ) -> tuple[Floats, Ints]:
        """The pairs without those of arms that leave and objects that move.

        Those that touch are noted, to be judged by the resting arm.
        """
        judge = self._judge
        kept = np.ones(len(geoms), dtype=np.bool_)
        touching: set[tuple[int, int]] = set()
        for k, (a, b) in enumerate(geoms.tolist()):
            owners = judge.owners[a], judge.owners[b]
            movers = [i for i, name in enumerate(self._movers) if name in owners]
            arm = int(max(judge.arm_of[a], judge.arm_of[b]))
            if not movers or arm < 0:
                continue
            key = (arm, movers[0])
            leaves = bool(self.leaving[arm] and moving[arm])
            depth = self._outer[a] + self._outer[b] - distances[k]
            kept[k] = not leaves and key not in self._touching
            if not depth > 0.0 or kept[k]:
                continue
            touching.add(key)
            if key not in self._touching:
                self._touching[key] = len(self._meetings)
                self._meetings.append(self._met(time, *owners, *key))
            which = self._touching[key]
            meeting = self._meetings[which]
            contact = meeting.contact
            contact = contact._replace(depth=max(contact.depth, float(depth)))
            self._meetings[which] = meeting._replace(contact=contact)
        for key in [key for key in self._touching if key not in touching]:
            del self._touching[key]
        return distances[kept], geoms[kept]

    def _met(self, time: float, a: str, b: str, arm: int, mover: int) -> Meeting:
        """A meeting that was just seen."""
        own = slice(self._first[arm], self._first[arm + 1])
        return Meeting(
            contact=Contact(time, a, b, 0.0),
            tick=round(time / SUBSTEP),
            arm=arm,
            mover=mover,
            rest=self._rest[own].copy(),
            since=int(self._rested[arm]),
        )

    def judge_meetings(self, p_rows: Floats) -> None:
        """Separate meetings from contacts by the resting arm; at the end of an episode.

        Args:
            p_rows: Where the moving objects were in each state of the episode, shape
                (k, m, 3) [m]; later they go on as in the last of them.
        """
        for meeting in self._meetings:
            if self._meets_at_rest(meeting, p_rows):
                self.met_at_rest += 1
            elif self.contact is None or meeting.contact.time < self.contact.time:
                self.contact = meeting.contact
                self.least = min(self.least, -meeting.contact.depth)
        for i, name in enumerate(self._movers):
            self._judge.stand_at(name, p_rows[-1, i])

    def _meets_at_rest(self, meeting: Meeting, p_rows: Floats) -> bool:
        """Whether the object touches the arm where it rested last."""
        judge, name = self._judge, self._movers[meeting.mover]
        q = self._q.copy()
        q[self._first[meeting.arm] : self._first[meeting.arm + 1]] = meeting.rest
        pairs = [pair for pair in judge.pairs if self._is_of(meeting, pair)]
        for p in places(p_rows[:, meeting.mover], meeting.since, meeting.tick):
            judge.stand_at(name, p)
            judge.place(q)
            for a, b in pairs:
                if judge.gap((a, b)) < self._outer[a] + self._outer[b]:
                    return True
        return False

    def _is_of(self, meeting: Meeting, pair: tuple[int, int]) -> bool:
        """Whether a pair of geoms is one of a meeting's arm and object."""
        owners = {self._judge.owners[g] for g in pair}
        arms = {int(self._judge.arm_of[g]) for g in pair}
        return self._movers[meeting.mover] in owners and meeting.arm in arms


def places(rows: Floats, first: int, met: int) -> Iterator[Floats]:
    """Where an object is from a substep until some time after it met an arm.

    Args:
        rows: Its displacement in each state of the episode, shape (k, 3) [m].
        first: The first substep.
        met: That of the meeting.
    """
    last = len(rows) - 1
    step = rows[last] - rows[last - 1]
    for tick in range(first, met + round(AS_WELL / SUBSTEP) + 1):
        yield rows[min(tick, last)] + max(tick - last, 0) * step
