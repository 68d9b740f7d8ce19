"""The coordination on line as what drives the robots of a service."""

import threading
from collections.abc import Callable, Iterable, Mapping
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.cli.line_state import LineState
from armguard.maps.cell_plan import joints_of
from armguard.maps.job import LineJob
from armguard.maps.line_run import LEADS_BACK, LineRun
from armguard.maps.online import Line
from armguard.respond.command import Blocked
from armguard.service.link import LinkEnd

Floats = NDArray[np.float64]

# Called with the time of a decision [s], and its sentence.
Says = Callable[[float, str], None]

# How long what measures the belt gets to answer at first [s].
PATIENCE = 10.0

# A measurement of the belt that is older stops both robots [s].
STALE = 0.1

# Joints are led to where plans begin at most this fast [rad/s or m/s], up to this share
# of the errors that plans declare [-].
SLOW, WITHIN = 0.2, 0.5

# How long that may take [s].
LONGEST_WAY = 60.0


class Encoder:
    """Reads how far a belt has moved, and its speed, from lines of two numbers.

    Args:
        lines: Lines as they come: travel [m], and speed [m/s].
    """

    def __init__(self, lines: Iterable[str]) -> None:
        self._newest, self._stamp = (np.nan, np.nan), -np.inf
        self._wrong = ""
        threading.Thread(target=self._read, args=(lines,), daemon=True).start()

    def _read(self, lines: Iterable[str]) -> None:
        for line in lines:
            try:
                travel, speed = map(float, line.split())
            except ValueError:
                self._wrong = line.strip()[:40]
                return
            self._newest, self._stamp = (travel, speed), monotonic()

    def measured(self) -> tuple[float, float] | None:
        """The newest travel [m] and speed [m/s]; None if they are too old."""
        return self._newest if monotonic() - self._stamp <= STALE else None

    @property
    def problem(self) -> str:
        """Why there is no measurement, in words."""
        if self._wrong:
            return f"'{self._wrong}' is no travel and speed of the belt; give m and m/s"
        return f"the belt was not measured for {STALE:g} s"


class LineStart:
    """Where robots have to be before the first job begins, and the way there.

    Args:
        job: The cell job.
        line: Its coordination.
        leads: Whether robots that are elsewhere are led there.
    """

    def __init__(self, job: LineJob, line: Line, leads: bool) -> None:
        self._line, self._names, self._leads = line, job.scene.q_names, leads
        self._home, _ = line.motion()
        self._width = np.full(len(self._names), np.inf)
        for one in job.cell.plans.values():
            own = joints_of(self._names, one.robot)
            tube = one.plan.plan.widened(
                job.scene, one.plan.following_error, {one.robot: one.plan.skew}
            )
            self._width[own] = np.minimum(self._width[own], tube.wide[0][own])
        # When robots began to be led, without the time for which one was held [s].
        self._since: float | None = None

    def way(self, t: float, q: Floats) -> Floats | None:
        """Velocities that lead to where plans begin, shape (n,) [rad/s or m/s].

        None once all robots are there, or if both stop because one is not.

        Args:
            t: The present [s].
            q: Measured positions, shape (n,) [rad or m].
        """
        off, width = self._home - q, self._width
        if self._since is not None:
            width = WITHIN * width
        beyond = np.nan_to_num(np.abs(off) - width, nan=np.inf)
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 0.0:
            return None
        where = (
            f"{self._names[worst]} is {abs(off[worst]):.3f} rad or m from where its "
            "plans begin"
        )
        remedy = "drive it there, for example on the page of `armguard view`"
        if not self._leads or not np.isfinite(off).all():
            self._line.stop(
                f"{where}, {width[worst]:.3f} are declared; {remedy}, or start with "
                "--lead, which leads it there"
            )
            return None
        if self._since is None:
            self._since = t
            self._line.events.append(f"{where}; both robots are led there slowly")
        if t - self._since > LONGEST_WAY:
            self._line.stop(
                f"{where}, and has not come nearer in {LONGEST_WAY:g} s; {remedy}"
            )
            return None
        return np.clip(LEADS_BACK * off, -SLOW, SLOW)

    def wait(self, t: float) -> None:
        """Count no time while the guard holds a robot."""
        if self._since is not None:
            self._since = t


class LineHands:
    """The coordination as what drives the robots of a service.

    Attributes:
        engages: It engages no robot: both stop for good where the guard stops one.
        moves: Whether anything is left to do.
        now: Time since the start [s].
        run: What is executed.

    Args:
        job: The cell job.
        encoder: What measures the belt; None if it moves at its usual speed.
        says: Called with each decision.
        leads: Whether robots are led to where their plans begin.
        link: Where the live view requests the state; None if it does not.
    """

    def __init__(
        self,
        job: LineJob,
        encoder: Encoder | None,
        *,
        says: Says,
        leads: bool = False,
        link: LinkEnd | None = None,
    ) -> None:
        self.engages, self.moves, self.now = False, True, 0.0
        self.run, self._encoder, self._speed = LineRun(job), encoder, job.speed
        self._begin = LineStart(job, self.run.line, leads)
        self._start: float | None = None
        # Why no job has begun yet, in words.
        self._before = ""
        self._belt = 0.0, job.speed
        self._says, self._link, self._state = says, link, LineState(job, self.run.line)

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """See `Operator.drive`."""
        held = [name for name, why in blocked.items() if why.remedy]
        desired = self._before_start(t, q, held)
        if desired is None:
            desired = self._execute(t, q, blocked, held)
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

    def _before_start(self, t: float, q: Floats, held: list[str]) -> Floats | None:
        """Velocities until the first job may begin; None from then on."""
        if self._start is not None:
            return None
        # Robots of a service that has begun wait for velocities of zero.
        if held:
            self._begin.wait(t)
            self._before = "waits until the guard releases all robots"
            return np.zeros_like(q)
        desired = self._begin.way(t, q)
        if desired is not None:
            self._before = "is led slowly to where its plans begin"
            return desired
        belt = self._encoder is None or self._encoder.measured()
        if not belt and t < PATIENCE and not self.run.line.fault:
            self._before = "waits until the belt is measured"
            return np.zeros_like(q)
        self._start, self._before = t, ""
        return None

    def _execute(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked], held: list[str]
    ) -> Floats:
        """Velocities of robots that execute jobs."""
        line = self.run.line
        for name in held:
            line.stop(f"{name}: {blocked[name].sentence}")
        assert self._start is not None
        self.now = t - self._start
        self._belt = self._speed * self.now, self._speed
        measured = None
        if self._encoder is not None:
            measured = self._encoder.measured()
            if measured is None:
                line.stop(self._encoder.problem)
            else:
                self._belt = measured
        self.moves = self.run.step(self.now, measured)
        desired = self.run.velocities(q)
        if line.fault:
            # They slow down where they are: no proof covers the way back to a plan.
            _, desired = line.motion()
        return desired
