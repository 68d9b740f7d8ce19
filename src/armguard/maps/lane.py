"""Robots on their plans: how far they are, and how fast they may go on."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.maps.line_cell import RATE, Job, LineCell
from armguard.maps.right_of_way import STEP, Hold, Order, Pair, RightOfWay
from armguard.prove.tube import Tube

Floats = NDArray[np.float64]

# A robot comes so much before an item [s].
EARLY = 0.3

# Paces that differ by less are the same [-].
SAME = 1e-3

# A robot goes on after another one once it has not yielded for so long [s].
QUIET = 1.0


class Way(NamedTuple):
    """A way to begin a job.

    Attributes:
        job: The job.
        plan: Name of the plan that it requires.
        name: Name of what is executed, that plan or an alternative to it.
        firsts: For each other robot: which of both goes first where they arrive
            together.
        behind: Whether the robot begins once all others are at their ends.
    """

    job: Job
    plan: str
    name: str
    firsts: tuple[int, ...]
    behind: bool = False


@dataclass(slots=True)
class Lane:
    """A robot, and how far it is.

    Attributes:
        robot: Its name.
        plan: Name of the plan that it executes, or at an end of which it rests.
        place: Where on it, from its start [s].
        pace: Pace, as a share of the plan's [-].
        job: What it executes; None if it rests.
        tried: How many ways to begin a job were tried.
        circle: Whether robots would wait in a circle on the last of these.
        tries_at: Time before which they are not tried again [s].
        best: The best of the ways of a plan that were tried, and its cost [s].
        yields_to: Robot because of which it is slower now; empty if none.
        yielded: By robot that it yields to: when that began, and when it was last so;
            until it goes on [s].
        lost: Whether the item of its job is missed.
        apart: Greatest distance of tool and item while this is gripped [m].
    """

    robot: str
    plan: str
    place: float = 0.0
    pace: float = 0.0
    job: Job | None = None
    tried: int = 0
    circle: bool = False
    tries_at: float = -inf
    best: tuple[Way, float] | None = None
    yields_to: str = ""
    yielded: dict[str, tuple[float, float]] = field(default_factory=dict)
    lost: bool = False
    apart: float = 0.0

    @property
    def stop(self) -> float:
        """Where it can stop [s]."""
        return self.place + 0.5 * self.pace**2 / RATE

    def report(self, now: float) -> list[str]:
        """What is said of its yielding, once for each.

        Args:
            now: The present [s].
        """
        said, other = [], self.yields_to
        if other:
            if other not in self.yielded:
                said.append(f"{self.robot} yields to {other}")
            self.yielded[other] = self.yielded.get(other, (now, now))[0], now
        for passed, (began, last) in [*self.yielded.items()]:
            if passed != other and now - last >= QUIET:
                del self.yielded[passed]
                said.append(
                    f"{self.robot} goes on after {passed}, it yielded for "
                    f"{last - began:.1f} s"
                )
        return said

    def forget(self) -> None:
        """It yields no more, of which nothing is said."""
        self.yields_to = ""
        self.yielded.clear()


class Lanes:
    """Robots on their plans, and the items that they follow.

    Attributes:
        travel: How far the belt has moved [m].

    Args:
        cell: What is known of the robots.
        each: The robots.
    """

    def __init__(self, cell: LineCell, each: Sequence[Lane]) -> None:
        self.travel = 0.0
        self._cell, self._each = cell, each
        self._plans, self._belt = cell.plans, cell.conveyor
        # Cells of each plan.
        self._ends: dict[str, int] = {
            name: count
            for pair, crossing in cell.crossings.items()
            for name, count in zip(pair, crossing.blocked.shape, strict=True)
        }

    def item(self, lane: Lane) -> float | None:
        """Place on a robot's plan at which its item is now; None without an item."""
        job, track = lane.job, self._plans[lane.plan].track
        if job is None or track is None or lane.lost:
            return None
        on_belt = job.offset + self.travel - job.travel
        start = track.start - self._plans[lane.plan].begin
        return start + (on_belt - track.at) / track.speed

    def hold(self, lane: Lane, speed: float) -> Hold:
        """What keeps a robot back by its item, at a speed of the belt."""
        item = self.item(lane)
        reserved, track = self._plans[lane.plan].reserved, self._plans[lane.plan].track
        if item is None or reserved is None or track is None:
            return 0, 0, 0
        pace = speed / track.speed
        if lane.stop > reserved[0]:
            left = max(reserved[1] - lane.place, 0.0)
            return ceil(left / pace / STEP), 0, 0
        comes = (reserved[0] - item) / pace - (reserved[0] - lane.place)
        slower = (reserved[1] - reserved[0]) * (1.0 / pace - 1.0)
        node = ceil(reserved[0] / STEP - SAME)
        return max(int((comes - EARLY) / STEP), 0), node, ceil(slower / STEP)

    def order(self, pair: Pair, first: int, last: int | None = None) -> Order | None:
        """The order of two robots; None if there is none.

        Args:
            pair: The robots.
            first: That of them which goes first where both arrive together.
            last: That of them which begins once the other one is at its end; None if
                each goes as soon as it can. Its gates let it follow sooner.
        """
        both = [self._each[k] for k in pair]
        crossing = self._cell.crossings.get((both[0].plan, both[1].plan))
        if crossing is None:
            return None
        nodes, holds = [self._node(lane) for lane in both], self._holds(both)
        if last is not None:
            late, soon = pair.index(last), pair.index(last) ^ 1
            way = self._ends[both[soon].plan] - nodes[soon]
            after = holds[soon][0] + way + holds[soon][2]
            holds[late] = max(holds[late][0], after), *holds[late][1:]
        return crossing.order(
            (nodes[0], nodes[1]), (holds[0], holds[1]), pair.index(first)
        )

    def cost(self, right: RightOfWay) -> float:
        """What a right of way costs: delays of robots, by priority [s].

        Infinite if robots would wait for each other in a circle.
        """
        each = self._each
        nodes, holds = [self._node(lane) for lane in each], self._holds(each)
        passages = right.passages(nodes, holds)
        if passages is None:
            return inf
        weights = [self._plans[lane.plan].plan.priority for lane in each]
        ends = [self._ends[lane.plan] for lane in each]
        late = [
            STEP * max(passage.arrives(end) - (end - node + hold[0] + hold[2]), 0)
            for passage, end, node, hold in zip(
                passages, ends, nodes, holds, strict=True
            )
        ]
        return sum(
            delay * (1 + weight - min(weights))
            for delay, weight in zip(late, weights, strict=True)
        )

    def in_time(self, right: RightOfWay) -> bool:
        """Whether all robots catch their items, if none waits in a circle."""
        return all(self._comes_in_time(k, right) for k in range(len(self._each)))

    def _node(self, lane: Lane) -> int:
        """Node at which a robot can stop; past the part in which it cannot wait."""
        reserved = self._plans[lane.plan].reserved
        stop = lane.stop
        if reserved is not None and reserved[0] < stop <= reserved[1]:
            stop = reserved[1]
        return min(ceil(stop / STEP - SAME), self._ends[lane.plan])

    def _holds(self, each: Sequence[Lane]) -> list[Hold]:
        """What keeps robots back by their items, these as fast as they may be."""
        speed = self._belt.fastest if self._belt else 0.0
        return [self.hold(lane, speed) for lane in each]

    def _comes_in_time(self, k: int, right: RightOfWay) -> bool:
        """Whether a robot catches its item, this as fast as it may be."""
        lane, belt = self._each[k], self._belt
        item, one = self.item(lane), self._plans[lane.plan]
        if item is None or belt is None or one.track is None or one.reserved is None:
            return True
        nodes = [self._node(one) for one in self._each]
        goal = ceil(one.reserved[0] / STEP - SAME)
        if nodes[k] > goal:
            return True
        # Items of the others may be as slow as they can be.
        holds = [self.hold(one, belt.slowest) for one in self._each]
        holds[k] = self.hold(lane, belt.fastest)
        passages = right.passages(nodes, holds)
        if passages is None:
            return False
        # It has to be let into the part in which it cannot wait.
        steps = passages[k].arrives(goal + 1) - 1 - holds[k][2]
        comes = item + STEP * steps * belt.fastest / one.track.speed
        return comes <= one.reserved[0] + one.track.lag(belt.fastest)


def curve_at(tube: Tube, time: float) -> tuple[Floats, Floats]:
    """Positions [rad or m] and velocities of a tube's curves, each shape (n,)."""
    k = int(np.searchsorted(tube.times, time, side="right")) - 1
    k = min(max(k, 0), len(tube.control) - 1)
    start, end = tube.times[k : k + 2]
    share, points = min(max((time - start) / (end - start), 0.0), 1.0), tube.control[k]
    # De Casteljau's scheme; the last two points are on the tangent.
    while len(points) > 2:
        points = points[:-1] + share * (points[1:] - points[:-1])
    rate = tube.degree * (points[1] - points[0]) / (end - start)
    return points[0] + share * (points[1] - points[0]), rate


def pace_before(left: float, dt: float) -> float:
    """Greatest pace from which a robot can stop in time [-].

    Args:
        left: Time of the plan that is left after which it has to rest [s].
        dt: Time until it can slow down [s].
    """
    if left == inf:
        return 1.0
    return RATE * (sqrt(dt * dt + 2.0 * max(left, 0.0) / RATE) - dt)
