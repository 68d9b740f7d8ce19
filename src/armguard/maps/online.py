"""Coordination on line: robots execute plans as jobs arrive, some at a conveyor.

Each cycle decides how far each robot goes on its plan. A robot keeps to the pace of its
plan, or less. One that has to wait for another slows down in time. Where an
alternative to its plan saves a wait, a redundant robot begins that instead: its tool
keeps the path, its elbow does not. In the part of a plan that follows the belt, the
place on the plan is that of the item on the belt, so no robot has to wait there.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from itertools import combinations, islice, product
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.errors import did_you_mean
from armguard.maps.cell_plan import CoordinationError, joints_of
from armguard.maps.lane import SAME, Lane, Lanes, Way, curve_at, pace_before
from armguard.maps.line_cell import GRIP, RATE, Job, LineCell
from armguard.maps.right_of_way import STEP, Order, Pair, RightOfWay

Floats = NDArray[np.float64]

# An item is picked if the tool is so near to its place [m].
NEAR = 0.005

# Time between two looks for another order, and what that, or an alternative to a plan,
# has to save [s].
LOOKS, GAIN = 0.25, 0.5


class Line:
    """Two or more robots that execute jobs beside each other.

    Attributes:
        cell: What is known of them.
        lanes: The robots.
        queue: Jobs that wait.
        right_of_way: Which robot waits where for which.
        finished: Numbers of jobs that are done, each with the item's greatest distance
            from the tool while it was gripped, 0 without an item [m].
        missed: Numbers of jobs whose item was not picked.
        events: What was decided, in words, to be taken away by the caller.
        fault: Why all robots stop, in words; empty if they need not.

    Args:
        cell: What is known of them.
        gain: What another order has to save before it is taken up [s].
    """

    def __init__(self, cell: LineCell, *, gain: float = GAIN) -> None:
        self.cell, self.plans, self.conveyor = cell, cell.plans, cell.conveyor
        self._durations = {n: one.plan.plan.duration for n, one in self.plans.items()}
        self._own = [joints_of(cell.q_names, robot) for robot in cell.robots]
        # A plan and its alternatives.
        self._same = {name: cell.ways(name) for name in self.plans}
        # Robots rest where their plans begin and end; no way leads from there.
        rests = {one.robot: n for n, one in reversed([*self.plans.items()])}
        self.lanes = tuple(
            Lane(robot, rests[robot], self._durations[rests[robot]])
            for robot in cell.robots
        )
        self._lanes = Lanes(cell, self.lanes)
        tube = self.plans[self.lanes[0].plan].plan.plan.tube
        self._home = tube.at(tube.times[:1])[0]
        self.queue: deque[Job] = deque()
        self._gain, self._dt, self._speed = gain, 0.0, 0.0
        self._now, self._look, self._turn = -inf, -inf, 0
        self.finished: dict[int, float] = {}
        self.missed: list[int] = []
        self.events: list[str] = []
        self.fault = ""
        pairs = combinations(range(len(self.lanes)), 2)
        self.right_of_way = RightOfWay({}, len(self.lanes))
        begin = self._right({pair: pair[0] for pair in pairs})
        assert begin is not None, "`LineCell` has plans that begin clear of each other"
        self.right_of_way = begin

    @property
    def idle(self) -> bool:
        """Whether no job is left."""
        return not self.queue and not any(lane.job for lane in self.lanes)

    @property
    def rests(self) -> bool:
        """Whether all robots rest."""
        return all(lane.pace == 0.0 for lane in self.lanes)

    def add(self, job: Job) -> None:
        """Add a job that has arrived.

        Raises:
            CoordinationError: It has no plan, or an unknown one.
        """
        if not job.plans:
            raise CoordinationError(f"job {job.number} has no plan; give one")
        for name in job.plans:
            if name not in self.plans:
                raise CoordinationError(
                    f"job {job.number}: '{name}' is no plan; "
                    f"{did_you_mean(name, self.plans)}"
                )
        self.queue.append(job)

    def motion(self) -> tuple[Floats, Floats]:
        """Joint positions and velocities of all robots now, each shape (n,)."""
        q, v = self._home.copy(), np.zeros_like(self._home)
        each = zip(self.lanes, self.plan_times(), self._own, strict=True)
        for lane, time, own in each:
            at, rate = curve_at(self.plans[lane.plan].plan.plan.tube, time)
            q[own], v[own] = at[own], lane.pace * rate[own]
        return q, v

    def plan_times(self) -> tuple[float, ...]:
        """Time on the plan of each robot now [s]."""
        return tuple(self.plans[lane.plan].begin + lane.place for lane in self.lanes)

    def step(self, now: float, travel: float = 0.0, speed: float = 0.0) -> bool:
        """Decide how far all robots go until the next cycle.

        Args:
            now: Time [s].
            travel: How far the belt has moved, as measured [m].
            speed: Its speed, as measured [m/s].

        Returns:
            Whether anything moves, or may move.
        """
        self._take(now, travel, speed)
        dt = self._dt
        if not self.fault:
            self._begin()
            if now >= self._look:
                self._look = now + LOOKS
                self._look_again()
        # All decide by where the others are before this cycle.
        seen = [self.seen(k) for k in range(len(self.lanes))]
        for k, lane in enumerate(self.lanes):
            self._advance(k, lane, seen, dt)
        return not (self.idle and self.rests)

    def seen(self, k: int) -> float:
        """Where a robot is on its plan, as the others are to know it [s]."""
        return self.lanes[k].place

    def _take(self, now: float, travel: float, speed: float) -> None:
        """Take in time and belt; all stop where these cannot be right."""
        belt = self.conveyor
        if isfinite(now) and now >= self._now:
            self._dt = min(now - self._now, STEP) if self._now > -inf else 0.0
            self._now = now
        else:
            self.stop(f"time went from {self._now:g} s to {now:g} s")
        if belt and not belt.slowest <= speed <= belt.fastest:
            self.stop(
                f"the conveyor moves at {speed:.3f} m/s, declared are "
                f"{belt.slowest:g} to {belt.fastest:g} m/s; slow it down, or declare it"
            )
        if belt and not isfinite(travel):
            self.stop(f"the conveyor is at {travel:g} m; measure it")
        if not self.fault:
            self._lanes.travel, self._speed = travel, speed

    def stop(self, why: str) -> None:
        """Let all robots slow down and stop, for good.

        Args:
            why: Why, in words.
        """
        if not self.fault:
            self.fault = why
            self.events.append(f"all stop: {why}")

    def _begin(self) -> None:
        """Begin a job with the first plan that comes in time; a cycle tries one way.

        Of a plan with alternatives the way that saves enough is begun.
        """
        self._drop_passed()
        for k, lane in enumerate(self.lanes):
            if lane.job is not None or self._now < lane.tries_at:
                continue
            left = list(islice(self._ways(k), lane.tried, lane.tried + 1))
            best = lane.best
            compared = best and (not left or left[0][:2] != best[0][:2])
            if not left and not compared:
                lane.tried, lane.tries_at = 0, self._now + LOOKS
                continue
            way = best[0] if best and compared else left[0]
            # Where robots would wait in a circle, this one goes behind all others.
            way = way._replace(behind=way.behind or lane.circle)
            found = self._tried(k, way)
            if lane.circle:
                return
            if compared:
                lane.best = None
            else:
                lane.tried += 1
            if found is None:
                return
            right, cost = found
            if not compared and len(self._same[way.plan]) > 1:
                # Others may delay each other without it.
                cost -= self._lanes.cost(self.right_of_way)
                saves = best is None or cost < best[1] - self._gain
                if saves:
                    lane.best = way, cost
                if not saves or cost > self._gain:
                    return
            self._put(lane, way)
            self.queue.remove(way.job)
            # The right of way so far is that of another plan.
            self.right_of_way, self._look = right, self._now + LOOKS
            lane.tried, lane.best = 0, None
            self.events.append(f"{lane.robot} begins job {way.job.number}, {way.name}")
            return

    def _ways(self, k: int) -> Iterable[Way]:
        """Ways in which a robot may begin a job, in the order of trial."""
        # Jobs that are under way go first where robots arrive together.
        firsts = [*product(*((other, k) for other in self._others(k)))]
        return (
            Way(job, plan, name, first)
            for job in self.queue
            for plan in job.plans
            if self.plans[plan].robot == self.lanes[k].robot
            for name in self._same[plan]
            for first in firsts
        )

    def _others(self, k: int) -> list[int]:
        """Numbers of the other robots."""
        return [other for other in range(len(self.lanes)) if other != k]

    def _put(self, lane: Lane, way: Way) -> None:
        """Let a robot be at the start of a way."""
        lane.job, lane.plan, lane.place = way.job, way.name, 0.0
        lane.lost, lane.apart = False, 0.0

    def _tried(self, k: int, way: Way) -> tuple[RightOfWay, float] | None:
        """Right of way of one that comes in time, and its cost [s]; the robot stays."""
        lane = self.lanes[k]
        lane.circle = False
        if way.job not in self.queue:
            return None
        before = lane.plan, lane.place
        self._put(lane, way)
        pairs = [(min(k, other), max(k, other)) for other in self._others(k)]
        firsts = dict(zip(pairs, way.firsts, strict=True))
        right, found = self._right(firsts, k if way.behind else None), None
        cost = self._lanes.cost(right) if right else inf
        lane.circle = right is not None and cost == inf and not way.behind
        if right and cost < inf and self._lanes.in_time(right):
            found = right, cost
        lane.job, (lane.plan, lane.place) = None, before
        return found

    def _right(
        self, firsts: Mapping[Pair, int], last: int | None = None
    ) -> RightOfWay | None:
        """The right of way with other orders of some pairs; None without one.

        Args:
            firsts: Robot of each pair that goes first where both arrive together.
            last: See `Lanes.order`.
        """
        orders = dict(self.right_of_way.orders)
        for pair, first in firsts.items():
            order = self._order(pair, first, last)
            # In a tight order both may yield, unless one of them rests.
            rests = any(self.lanes[k].job is None for k in pair)
            if order is None or (order.tight and not rests):
                return None
            orders[pair] = order
        return RightOfWay(orders, len(self.lanes))

    def _drop_passed(self) -> None:
        """Drop a job whose item no robot can catch any more."""
        for job in tuple(self.queue):
            belt = self.conveyor
            ends = [
                track.at + track.lag(self._speed) * track.speed
                for track in (self.plans[name].track for name in job.plans)
                if track is not None and belt is not None
            ]
            on_belt = job.offset + self._lanes.travel - job.travel
            if len(ends) == len(job.plans) and on_belt > max(ends):
                self.queue.remove(job)
                self.missed.append(job.number)
                self.events.append(f"no robot reaches the item of job {job.number}")

    def _look_again(self) -> None:
        """Take up another order of two robots that saves enough and yield to none."""
        choices = [
            (pair, first)
            for pair in combinations(range(len(self.lanes)), 2)
            if all(self._may_reorder(self.lanes[k]) for k in pair)
            for first in pair
        ]
        cost = self._lanes.cost(self.right_of_way) if choices else 0.0
        if cost <= self._gain:
            return
        self._turn = (self._turn + 1) % len(choices)
        pair, first = choices[self._turn]
        found = self._right({pair: first})
        saves = cost - self._lanes.cost(found) if found else 0.0
        if found and saves > self._gain and self._lanes.in_time(found):
            self.right_of_way = found
            self.events.append(f"another order, which saves {saves:.1f} s")

    def _may_reorder(self, lane: Lane) -> bool:
        """Whether a robot executes a job and yields to none."""
        return lane.job is not None and not (lane.yields_to and self._gain > 0.0)

    def _order(self, pair: Pair, first: int, last: int | None) -> Order | None:
        """The order of two robots, see `Lanes.order`."""
        return self._lanes.order(pair, first, last)

    def _advance(self, k: int, lane: Lane, seen: list[float], dt: float) -> None:
        """Let a robot go on for a cycle; others are where they are seen [s]."""
        end = self._durations[lane.plan]
        least = max(lane.pace - RATE * dt, 0.0)
        if lane.job is None or self.fault:
            lane.pace = least if lane.job else 0.0
            lane.place = min(lane.place + lane.pace * dt, end)
            lane.forget()
            return
        most = min(lane.pace + RATE * dt, 1.0)
        alone = min(self._alone(lane, dt), pace_before(end - lane.place, dt))
        limit, other = self.right_of_way.limit(k, seen)
        held = pace_before(limit - lane.place, dt)
        pace = max(min(alone, held, most), least)
        wanted = min(alone, 1.0)
        bound = held < min(alone, most) - SAME
        if bound:
            lane.yields_to = self.lanes[other].robot
        elif not pace < wanted - SAME:
            lane.yields_to = ""
        lane.pace = pace
        self.events += lane.report(self._now)
        lane.place = min(lane.place + pace * dt, end)
        self._grip(lane, dt)
        if end - lane.place < SAME * STEP:
            self._finish(lane, end)

    def _alone(self, lane: Lane, dt: float) -> float:
        """Pace of a robot without the others, by its item [-]."""
        item, belt, one = self._lanes.item(lane), self.conveyor, self.plans[lane.plan]
        if item is None or belt is None or one.track is None or one.reserved is None:
            return 1.0
        if lane.place >= one.track.end - one.begin:
            return 1.0
        start = one.reserved[0]
        if lane.place == 0.0 and self._lanes.hold(lane, belt.fastest)[0] > 0:
            # It rests clear of the other robots as long as it can.
            return 0.0
        if lane.place <= start:
            if item < start:
                return pace_before(start - lane.place, dt)
            if item > start + one.track.lag(self._speed):
                self._miss(lane)
                return 1.0
        pace = self._speed / one.track.speed
        ahead = item + pace * dt - lane.place
        return pace + pace_before(ahead - pace * dt, dt) if ahead > 0.0 else 0.0

    def _grip(self, lane: Lane, dt: float) -> None:
        """Note how far the tool is from the item while it grips it."""
        item, one = self._lanes.item(lane), self.plans[lane.plan]
        if item is None or one.track is None:
            return
        left = one.track.end - one.begin - lane.place
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
        lane.place, lane.pace, lane.job = end, 0.0, None
        lane.forget()
        # Alternatives end where their plan does.
        lane.plan = self.plans[lane.plan].instead_of or lane.plan
