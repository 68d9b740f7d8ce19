"""A cell job on line: its jobs arrive, its belt moves, and its robots are followed."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import CoordinationError, joints_of
from armguard.maps.job import JobEntry, LineJob
from armguard.maps.lane import curve_at
from armguard.maps.line_cell import Job
from armguard.maps.online import Line

Floats = NDArray[np.float64]

# Desired velocities lead a joint back to its plan at this rate [1/s].
LEADS_BACK = 4.0

# Robots that rest for so long while jobs wait stay at rest [s].
PATIENCE = 30.0

# Jobs from outside that wait at most; a cycle looks through them.
MOST_WAITING = 50


class LineRun:
    """Executes a cell job on line.

    Attributes:
        line: The coordination.

    Args:
        job: The cell job.
    """

    def __init__(self, job: LineJob) -> None:
        self.line, self._speed = Line(job.cell), job.speed
        self._arrivals = list(enumerate(job.arrivals, 1))
        self._count, self._moved = len(job.arrivals), 0.0
        self._names = job.scene.q_names
        self._own = [joints_of(self._names, robot) for robot in job.cell.robots]
        self._tubes = {
            name: one.plan.plan.widened(
                job.scene, one.plan.following_error, {one.robot: one.plan.skew}
            )
            for name, one in job.cell.plans.items()
        }

    def step(self, now: float, belt: tuple[float, float] | None = None) -> bool:
        """Decide how far all robots go until the next cycle.

        Args:
            now: Time since the start of the job [s].
            belt: How far the belt has moved [m], and its speed [m/s], as measured; None
                if it moves at its usual speed.

        Returns:
            Whether anything moves, or may move.
        """
        line, usual = self.line, (self._speed * now, self._speed)
        travel, speed = usual if belt is None else belt
        while self._arrivals and self._arrivals[0][1].t <= now:
            number, one = self._arrivals.pop(0)
            line.add(Job(number, one.plans, one.offset, travel))
        moves = line.step(now, travel, speed)
        if not line.rests or not line.queue:
            self._moved = now
        if now - self._moved > PATIENCE:
            line.stop(f"{len(line.queue)} jobs wait, and none can begin")
        if line.fault:
            return not line.rests
        return moves or bool(self._arrivals)

    def add(self, job: JobEntry, travel: float) -> None:
        """Add a job that arrives now, besides those of the file.

        Args:
            job: The job.
            travel: How far the belt has moved [m].

        Raises:
            CoordinationError: It has an unknown plan, or too many jobs wait.
        """
        if len(self.line.queue) >= MOST_WAITING:
            raise CoordinationError(
                f"{MOST_WAITING} jobs wait already; send more once one of them begins"
            )
        self.line.add(Job(self._count + 1, job.plans, job.offset, travel))
        self._count += 1

    def velocities(self, q: Floats) -> Floats:
        """Desired velocities of all joints, shape (n,) [rad/s or m/s].

        All robots stop if one of them is not where the plans were proven for.

        Args:
            q: Measured positions, shape (n,) [rad or m].
        """
        line = self.line
        goal, rate = line.motion()
        each = zip(line.lanes, line.plan_times(), self._own, strict=True)
        for lane, time, own in each:
            tube = self._tubes[lane.plan]
            span = int(np.searchsorted(tube.times, time, side="right")) - 1
            width = tube.wide[min(max(span, 0), len(tube.wide) - 1)]
            curve, _ = curve_at(tube, time)
            beyond = np.where(own, np.abs(q - curve) - width, 0.0)
            # A number that is not finite is beyond as well.
            worst = int(np.argmax(np.nan_to_num(beyond, nan=np.inf)))
            if not beyond[worst] <= 0.0:
                line.stop(
                    f"{self._names[worst]} is {abs(q[worst] - curve[worst]):.3f} rad "
                    f"or m from its plan, {width[worst]:.3f} are declared by "
                    "following_error and skew"
                )
        return np.asarray(rate + LEADS_BACK * (goal - q))

    def take_events(self) -> Iterator[str]:
        """What was decided since the last call, in words."""
        while self.line.events:
            yield self.line.events.pop(0)

    def summary(self) -> dict[str, object]:
        """What came of the jobs."""
        line = self.line
        done = sorted(set(line.finished) - set(line.missed))
        return {
            "jobs": self._count,
            "done": done,
            "missed": sorted(line.missed),
            "fault": line.fault,
        }
