"""Coordination on line: two robots execute plans as jobs arrive, some at a conveyor.

Each cycle decides how far each robot goes on its plan. A robot keeps to the pace of its
plan, or less. One that has to wait for the other slows down in time. Where an
alternative to its plan saves a wait, a redundant robot begins that instead: its tool
keeps the path, its elbow does not. In the part of a plan that follows the belt, the
place on the plan is that of the item on the belt, so no robot has to wait there.
"""

from collections import deque
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.errors import did_you_mean
from armguard.maps.cell_plan import CoordinationError, joints_of
from armguard.maps.lane import SAME, Lane, Lanes, Way, curve_at, pace_before
from armguard.maps.line_cell import GRIP, RATE, Job, LineCell
from armguard.maps.right_of_way import STEP, Order

Floats = NDArray[np.float64]

# An item is picked if the tool is so near to its place [m].
NEAR = 0.005

# Time between two looks for another order, and what that, or an alternative to a plan,
# has to save [s].
LOOKS, GAIN = 0.25, 0.5


class Line:
    """Two robots that execute jobs beside each other.

    Attributes:
        cell: What is known of them.
        lanes: Both robots.
        queue: Jobs that wait.
        order: Which robot waits where for which.
        finished: Numbers of jobs that are done, each with the item's greatest distance
            from the tool while it was gripped, 0 without an item [m].
        missed: Numbers of jobs whose item was not picked.
        events: What was decided, in words, to be taken away by the caller.
        fault: Why both robots stop, in words; empty if they need not.

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
        first = next(iter(cell.crossings))
        # Robots rest where their plans begin and end; no way leads from there.
        self.lanes = (
            Lane(cell.robots[0], first[0], self._durations[first[0]]),
            Lane(cell.robots[1], first[1], self._durations[first[1]]),
        )
        self._both = Lanes(cell, self.lanes)
        tube = self.plans[first[0]].plan.plan.tube
        self._home = tube.at(tube.times[:1])[0]
        self.queue: deque[Job] = deque()
        self._gain, self._dt, self._speed = gain, 0.0, 0.0
        self._now, self._look, self._turn = -inf, -inf, 0
        self.finished: dict[int, float] = {}
        self.missed: list[int] = []
        self.events: list[str] = []
        self.fault = ""
        order = self._order(0)
        assert order is not None, "`LineCell` has plans that begin clear of each other"
        self.order = order

    @property
    def idle(self) -> bool:
        """Whether no job is left."""
        return not self.queue and not any(lane.job for lane in self.lanes)

    @property
    def rests(self) -> bool:
        """Whether both robots rest."""
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

    def plan_times(self) -> tuple[float, float]:
        """Time on the plan of each robot now [s]."""
        a, b = (self.plans[lane.plan].begin + lane.place for lane in self.lanes)
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
        self._take(now, travel, speed)
        dt = self._dt
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
            self._both.travel, self._speed = travel, speed

    def stop(self, why: str) -> None:
        """Let both robots slow down and stop, for good.

        Args:
            why: Why, in words.
        """
        if not self.fault:
            self.fault = why
            self.events.append(f"both stop: {why}")

    def _begin(self) -> None:
        """Begin a job with the first plan that comes in time; a cycle tries one way.

        Of a plan with alternatives the way that saves enough is begun.
        """
        self._drop_passed()
        for k, lane in enumerate(self.lanes):
            if lane.job is not None or self._now < lane.tries_at:
                continue
            ways = self._ways(k)
            left, best = ways[lane.tried :], lane.best
            compared = best and (not left or left[0][:2] != best[0][:2])
            if not left and not compared:
                lane.tried, lane.tries_at = 0, self._now + LOOKS
                continue
            way = best[0] if best and compared else left[0]
            found = self._tried(k, way)
            if compared:
                lane.best = None
            else:
                lane.tried += 1
            if found is None:
                return
            order, cost = found
            if not compared and len(self._same[way.plan]) > 1:
                saves = best is None or cost < best[1] - self._gain
                if saves:
                    lane.best = way, cost
                if not saves or cost > self._gain:
                    return
            self._put(lane, way)
            self.queue.remove(way.job)
            # The order so far is that of another plan.
            self.order, self._look = order, self._now + LOOKS
            lane.tried, lane.best = 0, None
            self.events.append(f"{lane.robot} begins job {way.job.number}, {way.name}")
            return

    def _ways(self, k: int) -> list[Way]:
        """Ways in which a robot may begin a job, in the order of trial."""
        # The job that is under way goes first where both arrive together.
        return [
            Way(job, plan, name, first)
            for job in self.queue
            for plan in job.plans
            if self.plans[plan].robot == self.lanes[k].robot
            for name in self._same[plan]
            for first in (1 - k, k)
        ]

    def _put(self, lane: Lane, way: Way) -> None:
        """Let a robot be at the start of a way."""
        lane.job, lane.plan, lane.place = way.job, way.name, 0.0
        lane.lost, lane.apart = False, 0.0

    def _tried(self, k: int, way: Way) -> tuple[Order, float] | None:
        """Order of a way that comes in time, and its cost [s]; the robot stays."""
        if way.job not in self.queue:
            return None
        lane = self.lanes[k]
        before = lane.plan, lane.place
        self._put(lane, way)
        order = self._order(way.first)
        # In a tight order both may yield, unless the other one rests.
        tight = order is not None and order.tight and self.lanes[1 - k].job
        found = None
        if order is not None and not tight and self._both.in_time(order):
            found = order, self._both.cost(order)
        lane.job, (lane.plan, lane.place) = None, before
        return found

    def _drop_passed(self) -> None:
        """Drop a job whose item no robot can catch any more."""
        for job in tuple(self.queue):
            belt = self.conveyor
            ends = [
                track.at + track.lag(self._speed) * track.speed
                for track in (self.plans[name].track for name in job.plans)
                if track is not None and belt is not None
            ]
            on_belt = job.offset + self._both.travel - job.travel
            if len(ends) == len(job.plans) and on_belt > max(ends):
                self.queue.remove(job)
                self.missed.append(job.number)
                self.events.append(f"no robot reaches the item of job {job.number}")

    def _look_again(self) -> None:
        """Take up another order if that saves enough and no robot yields now."""
        if self._gain > 0.0 and any(lane.yields for lane in self.lanes):
            return
        cost = self._both.cost(self.order)
        if cost <= self._gain:
            return
        self._turn = 1 - self._turn
        found = self._order(self._turn)
        saves = cost - self._both.cost(found) if found and not found.tight else 0.0
        if found and saves > self._gain and self._both.in_time(found):
            self.order = found
            self.events.append(f"another order, which saves {saves:.1f} s")

    def _order(self, first: int) -> Order | None:
        """The order in which one robot goes first where both arrive together."""
        return self._both.order(first)

    def _advance(self, k: int, lane: Lane, other: float, dt: float) -> None:
        """Let a robot go on for a cycle."""
        end = self._durations[lane.plan]
        least = max(lane.pace - RATE * dt, 0.0)
        if lane.job is None or self.fault:
            lane.pace = least if lane.job else 0.0
            lane.place = min(lane.place + lane.pace * dt, end)
            lane.yields, lane.yielded = False, None
            return
        most = min(lane.pace + RATE * dt, 1.0)
        alone = min(self._alone(lane, dt), pace_before(end - lane.place, dt))
        limit = self.order.limit(k, other)
        held = pace_before(limit - lane.place, dt)
        pace = max(min(alone, held, most), least)
        wanted = min(alone, 1.0)
        bound = held < min(alone, most) - SAME
        lane.yields = bound or (lane.yields and pace < wanted - SAME)
        lane.pace = pace
        says = lane.report(self._now, self.lanes[1 - k].robot)
        self.events += [says] if says else []
        lane.place = min(lane.place + pace * dt, end)
        self._grip(lane, dt)
        if end - lane.place < SAME * STEP:
            self._finish(lane, end)

    def _alone(self, lane: Lane, dt: float) -> float:
        """Pace of a robot without the other one, by its item [-]."""
        item, belt, one = self._both.item(lane), self.conveyor, self.plans[lane.plan]
        if item is None or belt is None or one.track is None or one.reserved is None:
            return 1.0
        if lane.place >= one.track.end - one.begin:
            return 1.0
        start = one.reserved[0]
        if lane.place == 0.0 and self._both.hold(lane, belt.fastest)[0] > 0:
            # It rests clear of the other robot as long as it can.
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
        item, one = self._both.item(lane), self.plans[lane.plan]
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
        lane.yields, lane.yielded = False, None
        # Alternatives end where their plan does.
        lane.plan = self.plans[lane.plan].instead_of or lane.plan
