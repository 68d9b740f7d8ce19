"""Judges of true states: where links touch, and where they come too near.

Coal shares no code with the guard. Without it the checker and the proof of plans judge.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import inf
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.plans.coal_world import CoalWorld, checked_pairs, shared_joints
from armguard.prove.paving import NearestPlace, NearInterval, Paver
from armguard.prove.tube import Tube
from armguard.scene.scene import Scene
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

JudgeName = Literal["coal", "checker"]

# Distances are sought below this, or below a larger buffer [m].
SIGHT = 0.05

# A distance counts as too small from this much below its buffer on [m].
ACCURACY = 1e-5

# Between two states a pair may be nearer than its buffer by the one unseen, and nearer
# than the least distance by the other [m].
FINE, ROUGH = 1e-4, 1e-3

# Pairs whose balls are nearer than this beyond the need are measured, so that they are
# known for longer [m]; so few pairs are measured without a look at their balls.
BEYOND, FEW = 0.1, 6

# Ends of intervals are this exact [s].
RESOLUTION = 1e-3


@dataclass(frozen=True, slots=True)
class Judged:
    """What true states come to.

    Attributes:
        least: Where two links are nearest; None if none is near, see `SIGHT`.
        intervals: Where two links are nearer than their buffer, in the order of time.
    """

    least: NearestPlace | None
    intervals: tuple[NearInterval, ...]

    @property
    def clear(self) -> bool:
        """Whether every pair keeps its buffer."""
        return not self.intervals


class Judge(Protocol):
    """Judges the states of one scene."""

    def judge(self, times: Floats, q: Floats) -> Judged:
        """What states and the straight lines between them come to.

        Args:
            times: Rising, shape (k,) [s].
            q: Joint positions, shape (k, n), two rows or more [rad or m].
        """


def judge_of(name: JudgeName, scene: Scene, tables: SceneTables) -> Judge:
    """A judge by its name.

    Raises:
        TrajectoryError: Coal or Pinocchio is missing, or does not know a shape.
    """
    return CoalJudge(tables) if name == "coal" else CheckerJudge(scene)


class CheckerJudge:
    """The checker, and the proof of plans where that leaves steps open.

    Args:
        scene: The scene.
    """

    def __init__(self, scene: Scene) -> None:
        self._checker = Checker(scene)
        self._paver = Paver(self._checker)

    def judge(self, times: Floats, q: Floats) -> Judged:
        """See `Judge`."""
        found = self._checker.distances(q)
        k, links = int(np.argmin(found.distance)), self._paver.links
        least = None
        if not (distance := float(found.distance[k])) >= SIGHT:
            a, b = links.of_primitive[[int(found.a[k]), int(found.b[k])]]
            names = links.names[a], links.names[b]
            least = NearestPlace(*names, distance, distance, float(times[k]))
        proven = self._checker.prove(q[:-1], q[1:]).proven
        near = tuple(near_intervals(self._paver, times, q, ~proven, RESOLUTION))
        for one in near:
            # Primitives may overlap where the exact shapes are apart.
            if least is None or one.nearest.distance < least.distance:
                least = one.nearest
        return Judged(least, near)


def near_intervals(
    paver: Paver,
    times: Floats,
    q: Floats,
    open_steps: NDArray[np.bool_],
    resolution: float,
) -> Iterator[NearInterval]:
    """What steps that are not proven come to, see `Paver.intervals`.

    Args:
        paver: Of the scene.
        times: Rising, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad or m].
        open_steps: Which steps are not proven, shape (k - 1,).
        resolution: How exact ends of intervals are [s].
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([0], open_steps, [0]))))
    for start, end in edges.reshape(-1, 2).tolist():
        tube = Tube.straight(rising(times[start : end + 1]), q[start : end + 1])
        yield from paver.intervals(paver.pave(tube, resolution), tube, resolution)


def rising(times: Floats) -> Floats:
    """Times that rise: numbers of frames where they do not."""
    if (np.diff(times) > 0.0).all():
        return times
    return np.asarray(times[0] + np.arange(len(times), dtype=np.float64))


class CoalJudge:
    """Coal on the kinematics of Pinocchio.

    No distance is skipped that could be below its buffer, or be the least one that is
    near: a pair is measured again as soon as its sides may have moved by the rest, and
    lines between two states are halved, see `FINE`.

    Args:
        tables: The scene.

    Raises:
        TrajectoryError: See `judge_of`.
    """

    def __init__(self, tables: SceneTables) -> None:
        self._world = CoalWorld(tables, exact=True)
        self._names, groups = tables.body_names, tables.groups
        self._pairs = checked_pairs(tables)
        a, b = self._pairs.T
        self._buffers = tables.buffers[groups[a], groups[b]]
        count = len(tables.kinds)
        # Numbers of the exact shapes of each primitive's link; none if it has none.
        self._exact = [
            range(count + first, count + first + own)
            for first, own in tables.exact.of_primitive.tolist()
        ]
        levers = self._world.levers.copy()
        for i, own in enumerate(self._exact):
            levers[i] = levers[[i, *own]].max(axis=0)
        alike = shared_joints(tables)
        self._levers = np.where(alike[a, b], 0.0, levers[a] + levers[b])

    def judge(self, times: Floats, q: Floats) -> Judged:
        """See `Judge`."""
        travel = np.cumsum(np.abs(np.diff(q, axis=0, prepend=q[:1])), axis=0)
        spent, notes = travel @ self._levers.T, Notes()
        # Distance of each pair where it was measured, plus what was spent until then.
        known = np.full(len(self._pairs), -inf)
        for k in range(len(q)):
            needed = np.maximum(self._buffers, notes.least)
            near = np.flatnonzero(~(known - spent[k] >= needed))
            if not len(near):
                continue
            found = self._measure(q[k], near, float(times[k]), k, notes)
            if k:
                before = (known - spent[k - 1])[near]
                step = Step(times[k - 1 : k + 1], q[k - 1 : k + 1], k)
                self._halve(step, near, before, found, notes)
            known[near] = found + spent[k][near]
        return notes.judged()

    def _halve(
        self,
        step: "Step",
        pairs: NDArray[np.intp],
        before: Floats,
        after: Floats,
        notes: "Notes",
    ) -> None:
        """Halve a step until pairs are surely far enough apart all along it.

        Args:
            step: The step.
            pairs: The pairs.
            before: Their distances at its start, or less [m].
            after: The same at its end [m].
            notes: Takes in what is measured.
        """
        way = self._levers[pairs] @ np.abs(step.q[1] - step.q[0])
        bound, buffers = 0.5 * (before + after - way), self._buffers[pairs]
        # Where both ends are too near, only a lesser distance is of interest.
        free = (bound >= buffers - FINE) | ((before < buffers) & (after < buffers))
        near = ~(free & (bound >= notes.least - ROUGH)) & (way > FINE)
        if not near.any():
            return
        first, second = step.halves()
        pairs, before, after = pairs[near], before[near], after[near]
        found = self._measure(second.q[0], pairs, float(second.times[0]), step.k, notes)
        self._halve(first, pairs, before, found, notes)
        self._halve(second, pairs, found, after, notes)

    def _measure(
        self, q: Floats, pairs: NDArray[np.intp], time: float, step: int, notes: "Notes"
    ) -> Floats:
        """Distances of pairs; less of those that are surely far enough apart [m]."""
        world, (a, b) = self._world, self._pairs[pairs].T
        found = np.full(len(pairs), -inf)
        if len(pairs) <= FEW:
            world.move(q)
        else:
            origins = world.place(q)
            found = np.linalg.norm(origins[a] - origins[b], axis=1)
            found -= world.radii[a] + world.radii[b]
        for k in range(len(pairs)):
            buffer = float(self._buffers[pairs[k]])
            if found[k] < max(buffer, notes.least) + BEYOND:
                i, j = int(a[k]), int(b[k])
                found[k] = distance = self._distance(i, j, buffer)
                if not distance >= max(buffer, notes.least):
                    names = self._names[i], self._names[j]
                    place = NearestPlace(*names, distance, distance, time)
                    notes.add(step, buffer, place)
        return found

    def _distance(self, i: int, j: int, buffer: float) -> float:
        """Distance of two primitives, or of their links' exact shapes [m]."""
        distance = self._world.distance(i, j)
        if distance >= buffer or not (self._exact[i] or self._exact[j]):
            return distance
        # A link is inside its primitives, and inside its exact shapes.
        sides = self._exact[i] or (i,), self._exact[j] or (j,)
        return max(distance, min(self._world.distance(*one) for one in product(*sides)))


@dataclass(frozen=True, slots=True)
class Step:
    """A straight line between two states, or a part of one.

    Attributes:
        times: Times of its ends, shape (2,) [s].
        q: Joint positions there, shape (2, n) [rad or m].
        k: Number of the state that the whole line ends at.
    """

    times: Floats
    q: Floats
    k: int

    def halves(self) -> tuple["Step", "Step"]:
        """Both halves of it."""
        time, q = self.times.mean(), self.q.mean(axis=0)
        return (
            Step(np.array([self.times[0], time]), np.stack((self.q[0], q)), self.k),
            Step(np.array([time, self.times[1]]), np.stack((q, self.q[1])), self.k),
        )


class Notes:
    """What a judge measured.

    Attributes:
        least: Least distance, or `SIGHT` before a pair is nearer [m].
    """

    def __init__(self) -> None:
        self.least = SIGHT
        self._place: NearestPlace | None = None
        # The last interval of two links, the step in which it ends, and all before.
        self._last: dict[tuple[str, str], tuple[int, NearInterval]] = {}
        self._done: list[NearInterval] = []

    def add(self, step: int, buffer: float, place: NearestPlace) -> None:
        """Add a distance of two links.

        Args:
            step: Number of the step in which it was measured.
            buffer: What they have to keep [m].
            place: Where it was measured.
        """
        if place.distance < self.least:
            self.least, self._place = place.distance, place
        if place.distance >= buffer - ACCURACY:
            return
        links, time = (place.a, place.b), place.time
        contact = time if place.distance <= 0.0 else None
        before = self._last.get(links)
        if before is None or step > before[0] + 1:
            if before is not None:
                self._done.append(before[1])
            one = NearInterval(time, time, buffer, place, contact)
        else:
            one = before[1]
            nearest = min(one.nearest, place, key=lambda each: each.distance)
            first = min(
                (t for t in (one.contact, contact) if t is not None), default=None
            )
            one = replace(
                one,
                start=min(one.start, time),
                end=max(one.end, time),
                nearest=nearest,
                contact=first,
            )
        self._last[links] = step, one

    def judged(self) -> Judged:
        """All of it."""
        near = [*self._done, *(one for _, one in self._last.values())]
        return Judged(self._place, tuple(sorted(near, key=lambda one: one.start)))
