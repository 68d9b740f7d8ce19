"""Schedules: when each robot of a cell is where on its plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import CoordinationError
from armguard.maps.diagram import Diagram
from armguard.maps.ways import beside_others, edges_free, quickest, steps_from_start

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Nodes = NDArray[np.intp]

# A robot of a lower priority may wait so much longer for each second that another one
# does not have to [-].
PRECEDENCE = 1000.0

# How far inside a cell a place is beyond rounding [cells].
INSIDE = 1e-6


@dataclass(frozen=True, slots=True)
class Wait:
    """A robot waits.

    Attributes:
        robot: The robot.
        at: Where on its plan, in time of that [s].
        start: When [s].
        duration: How long [s].
        since: From where on its plan it may go more slowly instead, so that it need not
            wait; `at` if it cannot [s].
        scale: How fast, as a share of the plan's pace [-].
    """

    robot: str
    at: float
    start: float
    duration: float
    since: float
    scale: float


@dataclass(frozen=True, slots=True, eq=False)
class Schedule:
    """Where robots are on their plans.

    Attributes:
        robots: The robots.
        times: From 0 to the time at which the last robot has finished, (k,) [s].
        plan_times: Time on each robot's plan then, shape (k, robots) [s]. In between
            they change evenly.
        nodes: The same in cells of the diagrams' grids, in steps of equal time.
        waits: Where robots wait, in the order of time.
        durations: How long each robot's plan takes by itself [s].
    """

    robots: tuple[str, ...]
    times: Floats
    plan_times: Floats
    nodes: Nodes
    waits: tuple[Wait, ...]
    durations: tuple[float, ...]

    @property
    def makespan(self) -> float:
        """Time until all have finished [s]."""
        return float(self.times[-1])

    def at(self, time: float) -> Floats:
        """Time on each robot's plan at a time, shape (robots,) [s]."""
        columns = self.plan_times.T
        return np.array([np.interp(time, self.times, own) for own in columns])


def quickest_schedule(
    diagrams: Sequence[Diagram], robots: tuple[str, ...], priorities: tuple[int, ...]
) -> Schedule:
    """The quickest schedule of two robots; of more, one that is quick.

    The first two in the order of priority get the quickest one. Each further one is
    added beside those before it, as soon as it can be.

    Args:
        diagrams: Of every two robots, all with the same step.
        robots: The robots.
        priorities: Of each; with equal ones the whole time counts alone.

    Raises:
        CoordinationError: There is no way, and why.
    """
    order = sorted(range(len(robots)), key=lambda r: -priorities[r])
    grids = Grids(diagrams, robots)
    one, other = order[:2]
    first = priorities[one] != priorities[other]
    way = quickest(grids.blocked(one, other), (PRECEDENCE * first, 0.0))
    if way is None:
        raise CoordinationError(why_no_way(grids.diagram(one, other)))
    columns = {one: way[:, 0], other: way[:, 1]}
    for r in order[2:]:
        columns = with_robot(r, columns, grids)
    nodes = np.column_stack([columns[r] for r in range(len(robots))])
    return schedule_of(nodes, grids)


class Grids:
    """Grids of every two robots, in any order.

    Attributes:
        robots: The robots.
        step: Side of their cells [s].
        starts: Time at which each plan begins [s].
        durations: How long each takes [s].
        counts: Cells of each robot's axis.

    Args:
        diagrams: Of every two robots.
        robots: The robots.
    """

    def __init__(self, diagrams: Sequence[Diagram], robots: tuple[str, ...]) -> None:
        self.robots, self.step = robots, diagrams[0].step
        self._diagrams = {one.robots: one for one in diagrams}
        starts, durations = dict[str, float](), dict[str, float]()
        for one in diagrams:
            starts |= zip(one.robots, one.starts, strict=True)
            durations |= zip(one.robots, one.durations, strict=True)
        self.starts = tuple(starts[name] for name in robots)
        self.durations = tuple(durations[name] for name in robots)
        shapes = dict[str, int]()
        for one in diagrams:
            shapes |= zip(one.robots, one.labels.shape, strict=True)
        self.counts = tuple(shapes[name] for name in robots)

    def diagram(self, r: int, s: int) -> Diagram:
        """The diagram of two robots, in whichever order it is."""
        both = self.robots[r], self.robots[s]
        return self._diagrams.get(both) or self._diagrams[both[::-1]]

    def blocked(self, r: int, s: int) -> Bools:
        """Blocked cells of two robots, the first of them on the first axis."""
        diagram = self.diagram(r, s)
        turned = diagram.robots[0] != self.robots[r]
        return diagram.blocked.T if turned else diagram.blocked


def with_robot(r: int, columns: dict[int, Nodes], grids: Grids) -> dict[int, Nodes]:
    """Nodes of some robots over time, with those of one more.

    Raises:
        CoordinationError: It has no way beside them.
    """
    longest = max(len(own) for own in columns.values())
    steps = longest + sum(grids.counts)
    fixed = {
        s: np.pad(own, (0, steps - len(own)), mode="edge") for s, own in columns.items()
    }
    k = grids.counts[r]
    moves, rests = (
        np.ones((steps - 1, k), dtype=bool),
        np.ones((steps - 1, k + 1), bool),
    )
    for s, own in fixed.items():
        blocked = grids.blocked(s, r)
        along, across = edges_free(blocked)
        goes = np.diff(own) > 0
        cell = np.minimum(own[:-1], blocked.shape[0] - 1)
        moves &= np.where(goes[:, None], ~blocked[cell], across[own[:-1]])
        rests &= ~goes[:, None] | along[cell]
    way = beside_others(moves, rests)
    if way is None:
        for s in fixed:
            if quickest(grids.blocked(s, r)) is None:
                raise CoordinationError(why_no_way(grids.diagram(s, r)))
        names = " and ".join(grids.robots[s] for s in fixed)
        raise CoordinationError(
            f"'{grids.robots[r]}' has no way beside {names} as these go; change the "
            "priorities, or a plan"
        )
    every = np.column_stack([*fixed.values(), way])
    still = np.flatnonzero((every != every[-1]).any(axis=1))
    end = int(still[-1]) + 2 if len(still) else 1
    return {s: own[:end] for s, own in (fixed | {r: way}).items()}


def schedule_of(nodes: Nodes, grids: Grids) -> Schedule:
    """The schedule of nodes in steps of equal time."""
    step, starts = grids.step, np.array(grids.starts)
    ends = starts + grids.durations
    moves = np.diff(nodes, axis=0)
    kept = np.concatenate(([True], (np.diff(moves, axis=0) != 0).any(axis=1), [True]))
    kept = np.flatnonzero(kept)
    # The last cell of a plan may be longer than what is left of it.
    passed = np.minimum(step * nodes, np.array(grids.durations))
    lasts = np.where(moves, np.diff(passed, axis=0), 0.0).max(axis=1)
    waiting = ~(moves.any(axis=1))
    lasts[waiting] = step
    times = np.concatenate(([0.0], np.cumsum(lasts)))
    waits = [
        wait
        for r in range(len(grids.robots))
        for wait in waits_of(r, nodes, times, grids)
    ]
    return Schedule(
        robots=grids.robots,
        times=times[kept],
        plan_times=np.minimum(starts + passed[kept], ends),
        nodes=nodes,
        waits=tuple(sorted(waits, key=lambda one: one.start)),
        durations=grids.durations,
    )


def waits_of(r: int, nodes: Nodes, times: Floats, grids: Grids) -> list[Wait]:
    """Where one robot waits before its end."""
    own, found = nodes[:, r], []
    still = np.concatenate(([False], np.diff(own) == 0, [False]))
    turns = np.flatnonzero(np.diff(still.astype(int)))
    before = 0
    for first, end in turns.reshape(-1, 2):
        if own[first] == grids.counts[r]:
            break
        since = slowed_from(r, before, int(first), int(end), nodes, grids)
        began, over = times[[since, end]]
        way = grids.step * float(own[first] - own[since])
        found.append(
            Wait(
                robot=grids.robots[r],
                at=grids.starts[r] + grids.step * float(own[first]),
                start=float(times[first]),
                duration=float(times[end] - times[first]),
                since=grids.starts[r] + grids.step * float(own[since]),
                scale=way / float(over - began) if since < first else 1.0,
            )
        )
        before = int(end)
    return found


def slowed_from(
    r: int, before: int, first: int, end: int, nodes: Nodes, grids: Grids
) -> int:
    """Step from which a robot can go evenly until its wait is over, the last possible.

    Args:
        r: The robot; it waits from step `first` to step `end`.
        before: Step at which its last wait was over.
        first: See `r`.
        end: See `r`.
        nodes: Where all robots are.
        grids: Their grids.

    Returns:
        The earliest step that was found by halving; `first` if there is none.
    """
    low, high = before, first
    while low < high:
        middle = (low + high) // 2
        if goes_evenly(r, middle, end, nodes, grids):
            high = middle
        else:
            low = middle + 1
    return high


def goes_evenly(r: int, start: int, end: int, nodes: Nodes, grids: Grids) -> bool:
    """Whether a robot may go at one pace from step to step, the others as they do."""
    places = np.linspace(float(nodes[start, r]), float(nodes[end, r]), end - start + 1)
    low = np.floor(places[:-1] + INSIDE).astype(int)
    high = np.ceil(places[1:] - INSIDE).astype(int)
    for s in range(nodes.shape[1]):
        if s == r:
            continue
        blocked = grids.blocked(s, r)
        other = nodes[start : end + 1, s]
        for t in range(end - start):
            columns = blocked[:, low[t] : max(high[t], low[t] + 1)]
            beside = np.logical_or.reduce(columns, axis=1)
            if other[t + 1] > other[t]:
                if beside[other[t]]:
                    return False
            elif beside[max(other[t] - 1, 0) : other[t] + 1].all():
                return False
    return True


def why_no_way(diagram: Diagram) -> str:
    """Why no way leads through a diagram: what blocks which robot, in words."""
    a, b = diagram.robots
    blocked = diagram.blocked
    if blocked[0, 0] or blocked[-1, -1]:
        cell = (0, 0) if blocked[0, 0] else (blocked.shape[0] - 1, blocked.shape[1] - 1)
        where = "begin" if blocked[0, 0] else "end"
        links = " and ".join(diagram.pair_at(cell))
        return f"no way: {a} and {b} {where} too near, {links}; change a plan's {where}"
    reached = steps_from_start(blocked)
    i, j = max(np.argwhere(reached < inf), key=sum)
    times = diagram.step * np.array([i, j]) + diagram.starts
    last = np.array(blocked.shape) - 1
    sentences = []
    for robot, other, cell, time in (
        (a, b, (i, max(j - 1, 0)), times[0]),
        (b, a, (max(i - 1, 0), j), times[1]),
    ):
        at = int(min(cell[0], last[0])), int(min(cell[1], last[1]))
        links = " and ".join(diagram.pair_at(at))
        sentences.append(f"{robot} cannot go on at {time:.3f} s for {other}, {links}")
    return f"no way: {'; '.join(sentences)}; change a plan"
