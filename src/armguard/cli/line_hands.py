"""The coordination on line as what drives the robots of a service."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.cli.line_input import PATIENCE, LineInput
from armguard.cli.line_state import LineState
from armguard.maps.cell_plan import CoordinationError, joints_of
from armguard.maps.job import LineJob, job_of
from armguard.maps.line_run import LEADS_BACK, LineRun
from armguard.maps.online import Line
from armguard.respond.command import Blocked
from armguard.service.link import LinkEnd

Floats = NDArray[np.float64]

# Called with the time of a decision [s], and its sentence.
Says = Callable[[float, str], None]

# Joints are led to where plans begin at most this fast [rad/s or m/s], up to this share
# of the errors that plans declare [-].
SLOW, WITHIN = 0.3, 0.5

# How long that may take, and time at rest before jobs go on [s].
LONGEST_WAY, PAUSE = 60.0, 1.0


class LineStart:
    """Where robots have to be before a job begins, and the way there.

    Attributes:
        remark: Which robot is elsewhere and is led there, in words; empty if none is.

    Args:
        job: The cell job.
        home: Where plans of all robots begin, shape (n,) [rad or m].
        leads: Whether robots that are elsewhere are led there.
    """

    def __init__(self, job: LineJob, home: Floats, leads: bool) -> None:
        self.remark, self._leads = "", leads
        self._home, self._names = home, job.scene.q_names
        self._width = np.full(len(home), np.inf)
        for one in job.cell.plans.values():
            own = joints_of(self._names, one.robot)
            tube = one.plan.plan.widened(
                job.scene, one.plan.following_error, {one.robot: one.plan.skew}
            )
            # At rest a plan is at its begin or at its end.
            least = tube.wide[[0, -1]].min(axis=0)[own]
            self._width[own] = np.minimum(self._width[own], least)
        # When robots began to be led; no time passes while the guard holds one [s].
        self._since: float | None = None

    def way(self, t: float, q: Floats, held: bool) -> Floats | None:
        """Velocities that lead there, shape (n,) [rad/s or m/s].

        None once all robots are there.

        Args:
            t: The present [s].
            q: Measured positions, shape (n,) [rad or m].
            held: Whether the guard holds a robot.

        Raises:
            CoordinationError: A robot is elsewhere, and is not led there.
        """
        if held:
            # Robots that are held wait for velocities of zero.
            self._since = None if self._since is None else t
            return np.zeros_like(q)
        off, width = self._home - q, self._width
        if self._since is not None:
            width = WITHIN * width
        beyond = np.nan_to_num(np.abs(off) - width, nan=np.inf)
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 0.0:
            self._since, self.remark = None, ""
            return None
        where = (
            f"{self._names[worst]} is {abs(off[worst]):.3f} rad or m from where its "
            "plans begin"
        )
        remedy = "drive it there, for example on the page of `armguard view`"
        if not self._leads or not np.isfinite(off).all():
            raise CoordinationError(
                f"{where}, {width[worst]:.3f} are declared; {remedy}, or start with "
                "--recover, which leads it there"
            )
        if self._since is None:
            self._since, self.remark = t, f"{where}; robots are led there slowly"
        if t - self._since > LONGEST_WAY:
            raise CoordinationError(
                f"{where}, and has not come there in {LONGEST_WAY:g} s; {remedy}"
            )
        return np.clip(LEADS_BACK * off, -SLOW, SLOW)


class LineHands:
    """The coordination as what drives the robots of a service.

    Attributes:
        engages: Whether robots are reset and engaged after a brake.
        moves: Whether anything is left to do.
        now: Time since the first job could begin [s].
        run: What is executed.

    Args:
        job: The cell job.
        reads: What measures the belt, which moves at its usual speed else, and what
            brings jobs; None for neither.
        says: Called with each decision.
        recovers: Whether robots are led to where their plans begin, at the start and
            after a stop, behind which later jobs are executed.
        engages: See above.
        link: Where the live view requests the state; None if it does not.
    """

    def __init__(
        self,
        job: LineJob,
        reads: LineInput | None,
        *,
        says: Says,
        recovers: bool = False,
        engages: bool = False,
        link: LinkEnd | None = None,
    ) -> None:
        self.engages, self.moves, self.now = engages, True, 0.0
        self.run, self._reads, self._recovers = LineRun(job), reads, recovers
        self._measures = reads is not None and reads.measures
        self._begin = LineStart(job, self.run.line.motion()[0], recovers)
        self._start: float | None = None
        # Why no job may begin, in words, and since when all robots are there [s].
        self._before = "waits for the guard"
        self._there: float | None = None
        self._speed, self._belt = job.speed, (0.0, job.speed)
        self._says, self._link = says, link
        self._state = LineState(job, self.run)

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """See `Operator.drive`."""
        held = [name for name, why in blocked.items() if why.remedy]
        if self._start is not None:
            self.now = t - self._start
        belt = self._measured()
        if self._reads is not None and belt is not None:
            self._take_jobs(self._reads, belt[0])
        desired = self._begins(t, q, bool(held), belt) if self._before else None
        if desired is None:
            desired = self._execute(q, blocked, held, belt)
        for sentence in self.run.take_events():
            self._says(self.now, sentence)
            self._state.decisions.append((self.now, sentence))
        self.answer()
        return desired, []

    def answer(self) -> None:
        """Answer the live view."""
        if self._link is not None:
            self._link.answer(lambda _: self.state())

    def state(self) -> dict[str, Any]:
        """State for the live view, ready for JSON."""
        return self._state.state(self.now, *self._belt, self._before)

    def _measured(self) -> tuple[float, float] | None:
        """Travel [m] and speed [m/s] of the belt; None if it is not measured."""
        if self._reads is None or not self._measures:
            return self._speed * self.now, self._speed
        return self._reads.measured()

    def _take_jobs(self, reads: LineInput, travel: float) -> None:
        """Take jobs that were read; a line that is none is refused in words.

        Args:
            reads: What brings them.
            travel: How far the belt has moved [m].
        """
        for line in reads.jobs():
            try:
                self.run.add(job_of(line), travel)
            except CoordinationError as error:
                self.run.line.events.append(f"refused: {error}")

    def _begins(
        self, t: float, q: Floats, held: bool, belt: tuple[float, float] | None
    ) -> Floats | None:
        """Velocities until jobs may begin; None once they may, or never will."""
        line, begin, before = self.run.line, self._begin, self._begin.remark
        try:
            way = begin.way(t, q, held)
        except CoordinationError as error:
            self._gives_up(str(error))
            return None
        if begin.remark and begin.remark != before:
            line.events.append(begin.remark)
        if way is not None:
            self._before = "is led slowly to where its plans begin"
            if held:
                self._before = "waits until the guard releases all robots"
            return way
        self._there = t if self._there is None else self._there
        if belt is None and t - self._there < PATIENCE:
            self._before = "waits until the belt is measured"
            return np.zeros_like(q)
        if belt is None and self._reads is not None:
            self._gives_up(self._reads.problem)
            return None
        if line.fault and t - self._there < PAUSE:
            self._before = "goes on soon"
            return np.zeros_like(q)
        self._before, self._there = "", None
        if self._start is None:
            self._start = t
        if line.fault:
            self._go_on()
        return None

    def _gives_up(self, why: str) -> None:
        """Stop all robots for good."""
        line, self._before, self._recovers = self.run.line, "", False
        if line.fault:
            line.events.append(f"all stay stopped: {why}")
        line.stop(why)

    def _go_on(self) -> None:
        """Go on behind a stop; jobs that came before are missed."""
        before = self.run.line
        # Those that came meanwhile are missed as well.
        self.run.step(self.now, self._belt)
        own = [lane.job for lane in before.lanes if lane.job and not lane.lost]
        line = self.run.line = Line(before.cell)
        lost = [job.number for job in (*own, *before.queue)]
        line.finished, line.missed = before.finished, before.missed + lost
        line.events = [*before.events, "jobs go on"]

    def _execute(
        self,
        q: Floats,
        blocked: Mapping[str, Blocked],
        held: list[str],
        belt: tuple[float, float] | None,
    ) -> Floats:
        """Velocities of robots that execute jobs."""
        line = self.run.line
        for name in held:
            line.stop(f"the guard holds {name}: {blocked[name].sentence}")
        if belt is None and self._reads is not None:
            line.stop(self._reads.problem)
        self.moves = self.run.step(self.now, belt or self._belt)
        if self._reads is not None and not line.fault:
            self.moves |= not self._reads.ended
        if not line.fault and belt is not None:
            self._belt = belt
        desired = self.run.velocities(q)
        if line.fault:
            # They slow down where they are: no proof covers the way back to a plan.
            _, desired = line.motion()
            if line.rests and self._recovers:
                self._before, self.moves = "waits for the guard", True
        return desired
