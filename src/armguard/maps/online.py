"""Coordination on line: two robots execute plans as jobs arrive, some at a conveyor.

Each cycle decides how far each robot goes on its plan. A robot keeps to the pace of its
plan, or less. One that has to wait for the other slows down in time; it does not leave
its path. In the part of a plan that follows the belt, the place on the plan is that of
the item on the belt, so no robot has to wait there.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, inf, isfinite, sqrt
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armguard.errors import did_you_mean
from armguard.maps.cell_plan import CellPlan, CoordinationError, joints_of
from armguard.maps.coordination import Coordinator
from armguard.maps.right_of_way import STEP, Crossing, Order
from armguard.prove.tube import Tube
from armguard.scene import Scene
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Greatest change of a pace [1/s].
RATE = 4.0

# Time that a robot slows down in, and recovers its pace in before it slows down again,
# counted in time of its plan [s].
SPARE = 1.5 / RATE

# Time on the plan in which a robot at rest catches up with an item [s].
RUN_UP = 0.7

# An item is picked if the tool is so near to its place [m] for so long [s].
NEAR, GRIP = 0.005, 0.2

# Time between two looks for another order, and what that has to save [s].
LOOKS, GAIN = 0.25, 0.5

# A robot comes so much before an item [s].
EARLY = 0.3

# Paces that differ by less are the same [-].
SAME = 1e-3

# Plans of a robot begin and end so near to each other [rad or m].
JOINED = 1e-3

# Tiles of diagrams are not divided below this [s].
FINEST = STEP


@dataclass(frozen=True, slots=True)
class Track:
    """The part of a plan that follows an item on the belt.

    Attributes:
        start: Where it begins, in time of the plan [s].
        end: Where it ends; the item is gripped in its last GRIP seconds [s].
        at: Place of the item on the belt at `start` [m].
        speed: Speed of the belt for which the plan is made [m/s].
    """

    start: float
    end: float
    at: float
    speed: float


@dataclass(frozen=True, slots=True)
class LinePlan:
    """A plan that jobs use.

    Attributes:
        robot: Its robot.
        plan: What that executes.
        track: The part that follows the belt, if there is one.
    """

    robot: str
    plan: CellPlan
    track: Track | None = None

    @property
    def reserved(self) -> tuple[float, float] | None:
        """Where the robot cannot wait, from the start of the plan [s]."""
        if self.track is None:
            return None
        first = self.plan.plan.tube.times[0]
        start = self.track.start - RUN_UP - first
        return STEP * int(start / STEP), self.track.end + 0.5 / RATE - first


@dataclass(frozen=True, slots=True)
class Conveyor:
    """A belt.

    Attributes:
        slowest: Its least speed [m/s].
        fastest: Its greatest speed [m/s].
    """

    slowest: float
    fastest: float


@dataclass(frozen=True, slots=True)
class Job:
    """A job that has arrived.

    Attributes:
        number: Its number.
        plans: Names of plans that can do it, that which is preferred first.
        offset: Place on the belt at which its item arrived [m].
        travel: How far the belt had moved then [m].
    """

    number: int
    plans: tuple[str, ...]
    offset: float = 0.0
    travel: float = 0.0


@dataclass(slots=True)
class Lane:
    """A robot, and how far it is.

    Attributes:
        robot: Its name.
        plan: Name of the plan that it executes, or at an end of which it rests.
        place: Where on it, from its start [s].
        pace: Pace, as a share of the plan's [-].
        job: What it executes; None if it rests.
        queue: Jobs that wait.
        tried: How many plans of the first of these would come too late.
        tries_at: Time before which they are not tried again [s].
        yields: Whether it is slower because of the other robot.
        lost: Whether the item of its job is missed.
        apart: Greatest distance of tool and item while this is gripped [m].
    """

    robot: str
    plan: str
    place: float = 0.0
    pace: float = 0.0
    job: Job | None = None
    queue: deque[Job] = field(default_factory=deque)
    tried: int = 0
    tries_at: float = -inf
    yields: bool = False
    lost: bool = False
    apart: float = 0.0

    @property
    def stop(self) -> float:
        """Where it can stop [s]."""
        return self.place + 0.5 * self.pace**2 / RATE


@dataclass(frozen=True, slots=True, eq=False)
class LineCell:
    """What is known of two robots before jobs arrive.

    Attributes:
        robots: The robots.
        plans: Plans that jobs use, by name.
        conveyor: The belt, if there is one.
        crossings: Of each plan of the first robot and each of the second.
        q_names: Names of all joints of the scene.
    """

    robots: tuple[str, str]
    plans: Mapping[str, LinePlan]
    conveyor: Conveyor | None
    crossings: Mapping[tuple[str, str], Crossing]
    q_names: tuple[str, ...]

    @classmethod
    def of(
        cls,
        scene: Scene | SceneTables,
        plans: Mapping[str, LinePlan],
        *,
        conveyor: Conveyor | None = None,
        floor: float = 0.0,
    ) -> Self:
        """Prove which parts of plans may be executed together.

        Args:
            scene: The scene, or its tables.
            plans: See `plans`.
            conveyor: See `conveyor`.
            floor: Least distance that links of both robots have to keep [m].

        Raises:
            CoordinationError: There are not two robots, a plan cannot follow the belt,
                the plans of a robot do not join, or one begins or ends where the other
                robot passes.
            TrajectoryError: A plan is none of its robot.
        """
        robots = tuple(dict.fromkeys(one.robot for one in plans.values()))
        if len(robots) != 2:
            raise CoordinationError(
                f"there are plans of {', '.join(robots) or 'no robot'}; coordination "
                "on line is of two robots"
            )
        check_tracks(plans, conveyor)
        coordinator = Coordinator(scene, robots, floor=floor)
        names = coordinator.tables.q_names
        check_joined(plans, names)
        own = [[n for n, one in plans.items() if one.robot == r] for r in robots]
        crossings = {
            (a, b): crossing_of(coordinator, a, b, plans)
            for a in own[0]
            for b in own[1]
        }
        return cls((robots[0], robots[1]), dict(plans), conveyor, crossings, names)


class Line:
    """Two robots that execute jobs beside each other.

    Attributes:
        cell: What is known of them.
        lanes: Both robots.
        order: Who goes first where.
        finished: Numbers of jobs that are done, each with the item's greatest distance
            from the tool while it was gripped, 0 without an item [m].
        missed: Numbers of jobs whose item was not picked.
        events: What was decided, in words, to be taken away by whoever reads it.
        fault: Why both robots stop, in words; empty if they need not.

    Args:
        cell: What is known of them.
        gain: What another order has to save before it is taken up [s].
    """

    def __init__(self, cell: LineCell, *, gain: float = GAIN) -> None:
        self.cell, self.plans, self.conveyor = cell, cell.plans, cell.conveyor
        self._durations = {n: one.plan.plan.duration for n, one in self.plans.items()}
        self._own = [joints_of(cell.q_names, robot) for robot in cell.robots]
        first = next(iter(cell.crossings))
        # Robots rest where their plans begin and end; no way leads from there.
        self.lanes = (
            Lane(cell.robots[0], first[0], self._durations[first[0]]),
            Lane(cell.robots[1], first[1], self._durations[first[1]]),
        )
        tube = self.plans[first[0]].plan.plan.tube
        self._home = tube.at(tube.times[:1])[0]
        self._gain, self._speed, self._travel = gain, 0.0, 0.0
        self._now, self._look, self._turn = -inf, -inf, 0
        self.finished: dict[int, float] = {}
        self.missed: list[int] = []
        self.events: list[str] = []
        self.fault = ""
        self.order = self._order(0)

    @property
    def idle(self) -> bool:
        """Whether no job is left."""
        return not any(lane.job or lane.queue for lane in self.lanes)

    @property
    def rests(self) -> bool:
        """Whether both robots rest."""
        return all(lane.pace == 0.0 for lane in self.lanes)

    def add(self, job: Job) -> None:
        """Add a job that has arrived.

        Raises:
            CoordinationError: It has no plan, an unknown one, or plans of two robots.
        """
        for name in job.plans:
            if name not in self.plans:
                raise CoordinationError(
                    f"job {job.number}: '{name}' is no plan; "
                    f"{did_you_mean(name, self.plans)}"
                )
        robots = {self.plans[name].robot for name in job.plans}
        if len(robots) != 1:
            raise CoordinationError(
                f"job {job.number}: its plans are of {', '.join(robots) or 'no robot'};"
                " give plans of one robot"
            )
        next(lane for lane in self.lanes if lane.robot in robots).queue.append(job)

    def motion(self) -> tuple[Floats, Floats]:
        """Joint positions and velocities of all robots now, each shape (n,)."""
        q, v = self._home.copy(), np.zeros_like(self._home)
        for lane, time, own in zip(
            self.lanes, self.plan_times(), self._own, strict=True
        ):
            at, rate = curve_at(self.plans[lane.plan].plan.plan.tube, time)
            q[own], v[own] = at[own], lane.pace * rate[own]
        return q, v

    def plan_times(self) -> tuple[float, float]:
        """Time on the plan of each robot now [s]."""
        a, b = (
            float(self.plans[lane.plan].plan.plan.tube.times[0]) + lane.place
            for lane in self.lanes
        )
        return a, b

    def step(self, now: float, travel: float = 0.0, speed: float = 0.0) -> bool:
        """Decide how far both robots go until the next cycle.

        Args:
            now: Time [s].
            travel: How far the belt has moved, as measured [m].
            speed: Its speed, as measured [m/s].

        Returns:
            Whether anything moves, or may move.
        """
        dt = min(now - self._now, STEP) if self._now > -inf else 0.0
        self._take(now, travel, speed)
        if not self.fault:
            self._begin()
            if now >= self._look:
                self._look = now + LOOKS
                self._look_again()
        # Both decide by where the other one is before this cycle.
        seen = [self.seen(k) for k in (0, 1)]
        for k, lane in enumerate(self.lanes):
            self._advance(k, lane, seen[1 - k], dt)
        return not (self.idle and self.rests)

    def seen(self, k: int) -> float:
        """Where a robot is on its plan, as the other one is to know it [s]."""
        return self.lanes[k].place

    def _take(self, now: float, travel: float, speed: float) -> None:
        """Take in time and belt; both stop where these cannot be right."""
        belt = self.conveyor
        if not (isfinite(now) and now >= self._now):
            self._stop(f"time went from {self._now:g} s to {now:g} s")
        elif belt and not belt.slowest <= speed <= belt.fastest:
            self._stop(
                f"the conveyor moves at {speed:.3f} m/s, declared are "
                f"{belt.slowest:g} to {belt.fastest:g} m/s; slow it down, or declare it"
            )
        elif belt and not isfinite(travel):
            self._stop(f"the conveyor is at {travel:g} m; measure it")
        if not self.fault:
            self._now, self._travel, self._speed = now, travel, speed

    def _stop(self, why: str) -> None:
        if not self.fault:
            self.fault = why
            self.events.append(f"both stop: {why}")

    def _item(self, lane: Lane) -> float | None:
        """Place on a robot's plan at which its item is now; None without an item."""
        job, track = lane.job, self.plans[lane.plan].track
        if job is None or track is None or lane.lost:
            return None
        first = float(self.plans[lane.plan].plan.plan.tube.times[0])
        on_belt = job.offset + self._travel - job.travel
        return track.start - first + (on_belt - track.at) / track.speed

    def _begin(self) -> None:
        """Begin jobs of robots that rest, with the first plan that comes in time.

        In a cycle one plan of a robot is tried.
        """
        for k, lane in enumerate(self.lanes):
            if lane.job is not None or not lane.queue or self._now < lane.tries_at:
                continue
            before = lane.plan, lane.place
            job = lane.queue[0]
            lane.job, lane.place, lane.lost, lane.apart = job, 0.0, False, 0.0
            lane.plan = job.plans[lane.tried]
            # The job that is under way goes first where both arrive together.
            found = self._order(1 - k)
            if not self._comes_in_time(k, found):
                lane.tried += 1
                if lane.tried == len(job.plans):
                    if not self._comes_in_time(k, None):
                        self._miss(lane)
                        lane.queue.popleft()
                    lane.tried, lane.tries_at = 0, self._now + LOOKS
                lane.job, (lane.plan, lane.place) = None, before
                continue
            lane.queue.popleft()
            # The order so far is that of another plan.
            self.order, self._look, lane.tried = found, self._now + LOOKS, 0
            self.events.append(f"{lane.robot} begins job {job.number}, {lane.plan}")
            return

    def _comes_in_time(self, k: int, order: Order | None) -> bool:
        """Whether a robot catches its item, this as fast as it may be.

        Args:
            k: The robot, 0 or 1.
            order: Who goes first where; None without the other robot.
        """
        lane = self.lanes[k]
        item, belt, one = self._item(lane), self.conveyor, self.plans[lane.plan]
        if item is None or belt is None or one.track is None or one.reserved is None:
            return True
        nodes, goal = self._nodes(), ceil(one.reserved[0] / STEP - SAME)
        steps = goal - nodes[k]
        if order is not None:
            goals = [len(needs) for needs in order.needs]
            goals[k] = goal
            steps = order.steps(nodes, self._holds(), (goals[0], goals[1]))[k]
        comes = item + STEP * steps * belt.fastest / one.track.speed
        return comes <= one.reserved[0] + self._lag(one.track, belt.fastest)

    def _look_again(self) -> None:
        """Take up another order if that saves enough, and nobody yields now."""
        if self._gain > 0.0 and any(lane.yields for lane in self.lanes):
            return
        cost = self._cost(self.order)
        if cost <= self._gain:
            return
        self._turn = 1 - self._turn
        found = self._order(self._turn)
        saves = cost - self._cost(found)
        if saves > self._gain:
            self.order = found
            self.events.append(f"another order, which saves {saves:.1f} s")

    def _order(self, first: int) -> Order:
        """The order in which one robot goes first where both arrive together."""
        a, b = self.lanes
        crossing = self.cell.crossings[a.plan, b.plan]
        found = crossing.order(self._nodes(), self._holds(), first)
        # Plans begin and end clear of each other: the way that is gone leads on.
        assert found is not None
        return found

    def _cost(self, order: Order) -> float:
        """What an order costs: delays of robots, by priority [s]."""
        weights = [self.plans[lane.plan].plan.priority for lane in self.lanes]
        delays = order.delays(self._nodes(), self._holds())
        return sum(
            delay * (1 + weight - min(weights))
            for delay, weight in zip(delays, weights, strict=True)
        )

    def _nodes(self) -> tuple[int, int]:
        """Nodes at which both robots can stop."""
        a, b = self.lanes
        k, m = self.cell.crossings[a.plan, b.plan].blocked.shape
        return min(self._node(a), k), min(self._node(b), m)

    def _holds(self) -> tuple[int, int]:
        """Steps in which each robot has time."""
        a, b = self.lanes
        return self._hold(a), self._hold(b)

    def _node(self, lane: Lane) -> int:
        """Node at which a robot can stop; past the part in which it cannot wait."""
        reserved = self.plans[lane.plan].reserved
        stop = lane.stop
        if reserved is not None and reserved[0] < stop <= reserved[1]:
            stop = reserved[1]
        return ceil(stop / STEP - SAME)

    def _hold(self, lane: Lane) -> int:
        """Steps in which a robot has time, its item as fast as it may be."""
        item, belt = self._item(lane), self.conveyor
        reserved, track = self.plans[lane.plan].reserved, self.plans[lane.plan].track
        if lane.job is None:
            return 0
        if item is None or belt is None or reserved is None or track is None:
            return 0
        left = reserved[0] - lane.place
        if left <= 0.0:
            return 0
        comes = (reserved[0] - item) * track.speed / belt.fastest
        return max(int((comes - left - EARLY) / STEP), 0)

    def _advance(self, k: int, lane: Lane, other: float, dt: float) -> None:
        """Let a robot go on for a cycle."""
        end = self._durations[lane.plan]
        least = max(lane.pace - RATE * dt, 0.0)
        if lane.job is None or self.fault:
            lane.pace = least if lane.job else 0.0
            lane.place = min(lane.place + lane.pace * dt, end)
            lane.yields = False
            return
        most = min(lane.pace + RATE * dt, 1.0)
        alone = min(self._alone(lane, dt), pace_before(end - lane.place, dt))
        limit = self.order.limit(k, other)
        held = pace_before(limit - lane.place, dt)
        pace = max(min(alone, held, most), least)
        wanted = min(alone, 1.0)
        bound = held < min(alone, most) - SAME
        yields = bound or (lane.yields and pace < wanted - SAME)
        if yields != lane.yields:
            what = "yields to" if yields else "goes on after"
            self.events.append(f"{lane.robot} {what} {self.lanes[1 - k].robot}")
        lane.yields, lane.pace = yields, pace
        lane.place = min(lane.place + pace * dt, end)
        self._grip(lane, dt)
        if end - lane.place < SAME * STEP:
            self._finish(lane, end)

    def _alone(self, lane: Lane, dt: float) -> float:
        """Pace of a robot without the other one, by its item [-]."""
        item, one = self._item(lane), self.plans[lane.plan]
        if item is None or one.track is None or one.reserved is None:
            return 1.0
        first = float(one.plan.plan.tube.times[0])
        if lane.place >= one.track.end - first:
            return 1.0
        start = one.reserved[0]
        if lane.place <= start:
            if item < start:
                return pace_before(start - lane.place, dt)
            if item > start + self._lag(one.track, self._speed):
                self._miss(lane)
                return 1.0
        pace = self._speed / one.track.speed
        ahead = item + pace * dt - lane.place
        return pace + pace_before(ahead - pace * dt, dt) if ahead > 0.0 else 0.0

    def _lag(self, track: Track, speed: float) -> float:
        """How far an item may be ahead and still be caught in time [s of the plan]."""
        pace = speed / track.speed
        time = track.end - GRIP - track.start
        return max(time, 0.0) * (1.0 - pace)

    def _grip(self, lane: Lane, dt: float) -> None:
        """Note how far the tool is from the item while it grips it."""
        item, one = self._item(lane), self.plans[lane.plan]
        if item is None or one.track is None:
            return
        first = float(one.plan.plan.tube.times[0])
        left = one.track.end - first - lane.place
        if 0.0 <= left <= GRIP:
            item += self._speed / one.track.speed * dt
            lane.apart = max(lane.apart, abs(item - lane.place) * one.track.speed)
            if lane.apart > NEAR:
                self._miss(lane)

    def _miss(self, lane: Lane) -> None:
        """An item is not picked; its robot executes the plan without it."""
        assert lane.job is not None
        lane.lost = True
        self.missed.append(lane.job.number)
        self.events.append(f"{lane.robot} misses the item of job {lane.job.number}")

    def _finish(self, lane: Lane, end: float) -> None:
        """End a job."""
        assert lane.job is not None
        self.finished[lane.job.number] = lane.apart
        self.events.append(f"{lane.robot} has done job {lane.job.number}")
        lane.place, lane.pace, lane.job, lane.yields = end, 0.0, None, False


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


def crossing_of(
    coordinator: Coordinator, a: str, b: str, plans: Mapping[str, LinePlan]
) -> Crossing:
    """The crossing of two plans.

    Raises:
        CoordinationError: One begins or ends where the other robot passes.
    """
    both = plans[a], plans[b]
    cell = coordinator.map({one.robot: one.plan for one in both}, resolution=FINEST)
    crossing = Crossing(cell.diagrams[0], [one.reserved for one in both], SPARE)
    for axis, (name, other) in enumerate(((a, b), (b, a))):
        grid = crossing.blocked if axis == 0 else crossing.blocked.T
        for end, where in ((0, "begins"), (-1, "ends")):
            if grid[end].any():
                raise CoordinationError(
                    f"plan '{name}' {where} where plan '{other}' passes; let it "
                    f"{where.removesuffix('s')} clear of the other robot"
                )
    return crossing


def check_tracks(plans: Mapping[str, LinePlan], conveyor: Conveyor | None) -> None:
    """Refuse plans that cannot follow the belt.

    Raises:
        CoordinationError: A part that follows it is none, or no belt is declared.
    """
    for name, one in plans.items():
        track = one.track
        if track is None:
            continue
        if conveyor is None:
            raise CoordinationError(
                f"plan '{name}' follows a belt, but there is no conveyor; declare it"
            )
        first, last = one.plan.plan.tube.times[[0, -1]]
        if not first + RUN_UP <= track.start < track.end - GRIP or track.end > last:
            raise CoordinationError(
                f"plan '{name}': it follows the belt from {track.start:g} s to "
                f"{track.end:g} s; it must begin {RUN_UP:g} s after the plan, take "
                f"more than {GRIP:g} s, and end within it"
            )
        if not track.speed > conveyor.fastest:
            raise CoordinationError(
                f"plan '{name}': it is made for {track.speed:g} m/s, the belt moves at "
                f"up to {conveyor.fastest:g} m/s; make it for a faster belt, so that "
                "the robot can catch up"
            )


def check_joined(plans: Mapping[str, LinePlan], names: Sequence[str]) -> None:
    """Refuse plans of a robot that do not begin where the others end.

    Raises:
        CoordinationError: They do not.
    """
    ends: dict[str, tuple[str, Floats]] = {}
    for name, one in plans.items():
        tube, own = one.plan.plan.tube, joints_of(tuple(names), one.robot)
        for q in tube.at(tube.times[[0, -1]])[:, own]:
            other, known = ends.setdefault(one.robot, (name, q))
            off = float(np.abs(q - known).max())
            if off > JOINED:
                raise CoordinationError(
                    f"plan '{name}' of {one.robot} begins or ends {off:.3f} rad or m "
                    f"from where '{other}' begins; give both the same rest position"
                )
