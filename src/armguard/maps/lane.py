"""Robots on their plans: how far they are, and how fast they may go on."""

from dataclasses import dataclass
from math import ceil, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.maps.line_cell import RATE, Job, LineCell
from armguard.maps.right_of_way import STEP, Hold, Order
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
        first: Robot that goes first where both arrive together, 0 or 1.
    """

    job: Job
    plan: str
    name: str
    first: int


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
        tries_at: Time before which they are not tried again [s].
        best: The best of the ways of a plan that were tried, and its cost [s].
        yields: Whether it is slower because of the other robot.
        yielded: When that began and when it was last so; None once it goes on [s].
        lost: Whether the item of its job is missed.
        apart: Greatest distance of tool and item while this is gripped [m].
    """

    robot: str
    plan: str
    place: float = 0.0
    pace: float = 0.0
    job: Job | None = None
    tried: int = 0
    tries_at: float = -inf
    best: tuple[Way, float] | None = None
    yields: bool = False
    yielded: tuple[float, float] | None = None
    lost: bool = False
    apart: float = 0.0

    @property
    def stop(self) -> float:
        """Where it can stop [s]."""
        return self.place + 0.5 * self.pace**2 / RATE

    def report(self, now: float, other: str) -> str:
        """What is said of its yielding, once for each; empty if nothing.

        Args:
            now: The present [s].
            other: Name of the other robot.
        """
        began = self.yielded[0] if self.yielded else now
        if self.yields:
            says = "" if self.yielded else f"{self.robot} yields to {other}"
            self.yielded = began, now
            return says
        if self.yielded is None or now - self.yielded[1] < QUIET:
            return ""
        last, self.yielded = self.yielded[1], None
        return (
            f"{self.robot} goes on after {other}, it yielded for {last - began:.1f} s"
        )


class Lanes:
    """Two robots on their plans, and the items that they follow.

    Attributes:
        travel: How far the belt has moved [m].

    Args:
        cell: What is known of the robots.
        each: Both robots.
    """

    def __init__(self, cell: LineCell, each: tuple[Lane, Lane]) -> None:
        self.travel = 0.0
        self._cell, self._each = cell, each
        self._plans, self._belt = cell.plans, cell.conveyor

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

    def holds(self) -> tuple[Hold, Hold]:
        """What keeps each robot back by its item, this as fast as it may be."""
        a, b = self._each
        speed = self._belt.fastest if self._belt else 0.0
        return self.hold(a, speed), self.hold(b, speed)

    def nodes(self) -> tuple[int, int]:
        """Nodes at which both robots can stop."""
        a, b = self._each
        k, m = self._cell.crossings[a.plan, b.plan].blocked.shape
        return min(self._node(a), k), min(self._node(b), m)

    def _node(self, lane: Lane) -> int:
        """Node at which a robot can stop; past the part in which it cannot wait."""
        reserved = self._plans[lane.plan].reserved
        stop = lane.stop
        if reserved is not None and reserved[0] < stop <= reserved[1]:
            stop = reserved[1]
        return ceil(stop / STEP - SAME)

    def order(self, first: int) -> Order | None:
        """The order in which one robot goes first where both arrive together."""
        a, b = self._each
        crossing = self._cell.crossings.get((a.plan, b.plan))
        if crossing is None:
            return None
        return crossing.order(self.nodes(), self.holds(), first)

    def cost(self, order: Order) -> float:
        """What an order costs: delays of robots, by priority [s]."""
        weights = [self._plans[lane.plan].plan.priority for lane in self._each]
        delays = order.delays(self.nodes(), self.holds())
        return sum(
            delay * (1 + weight - min(weights))
            for delay, weight in zip(delays, weights, strict=True)
        )

    def in_time(self, order: Order) -> bool:
        """Whether both robots catch their items."""
        return all(self._comes_in_time(k, order) for k in (0, 1))

    def _comes_in_time(self, k: int, order: Order) -> bool:
        """Whether a robot catches its item, this as fast as it may be."""
        lane, belt = self._each[k], self._belt
        item, one = self.item(lane), self._plans[lane.plan]
        if item is None or belt is None or one.track is None or one.reserved is None:
            return True
        nodes, goal = self.nodes(), ceil(one.reserved[0] / STEP - SAME)
        if nodes[k] > goal:
            return True
        goals = [len(needs) for needs in order.needs]
        # It has to be let into the part in which it cannot wait.
        goals[k] = goal + 1
        # The other robot's item may be as slow as it can be.
        holds = [self.hold(one, belt.slowest) for one in self._each]
        holds[k] = self.hold(lane, belt.fastest)
        ends = goals[0], goals[1]
        steps = order.steps(nodes, (holds[0], holds[1]), ends)[k] - 1 - holds[k][2]
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
