"""Look-ahead: an announced plan, proven ahead of the arms by a part in each cycle."""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from math import comb, inf, isfinite
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError, TrajectoryError
from armguard.guard import layout
from armguard.guard.ahead import NO_PLAN, Ahead, AheadReason
from armguard.guard.layout import IN_HEADER, IN_ROBOT
from armguard.guard.levels import Level, Reason
from armguard.guard.proven_lines import ProvenLines
from armguard.guard.watch import Watch
from armguard.prove.frontier import Frontier
from armguard.prove.tube import Tube
from armguard.record import attributes
from armguard.robot.stopping.distance import stop_travel
from armguard.scene.tables import RobotPart, SceneTables

Floats = NDArray[np.float64]

# Share of a period that is not divided further: where a lead ends is this exact.
RESOLUTION = 0.5


class Announced(Protocol):
    """A plan that can be announced: an `armguard.Plan`."""

    @property
    def source(self) -> str:
        """Where it is from."""

    @property
    def timed(self) -> bool:
        """Whether it has times."""

    @property
    def tube(self) -> Tube:
        """Its curves."""

    def widened(
        self,
        scene: Any,
        following_error: float | Mapping[str, float] = 0.0,
    ) -> Tube:
        """The tube that holds what controllers execute, see `Plan.widened`."""


class LookAhead:
    """An announced plan, and how far it is proven ahead of the arms.

    Args:
        plan: The plan.
        start: Time of its time 0 on the clock of `step` [s].
        following_error: See `Monitor.announce` [rad or m].
        proven: Makes a checker of the guard's world.
        watch: Watch of the guard.
        changes: How often the guard's world has changed.

    Raises:
        TrajectoryError: The plan has no times, or is of another scene; or a figure is
            no such figure.
        SceneError: The scene has no robot whose stop is predicted, or has sensed space.
    """

    def __init__(
        self,
        plan: Announced,
        start: float,
        following_error: float | Mapping[str, float],
        proven: ProvenLines,
        watch: Watch,
        changes: int,
    ) -> None:
        tables = proven.tables
        tube = tube_of(plan, start, following_error, tables)
        self._tube, self._start = tube, start
        self._proven, self._changes = proven, changes
        self._placed: dict[str, bytes] = {}
        self._checker = proven.strict_checker(self._placed)
        self._bound = bindings_of(tables)
        # Positions measured on the plan may be off it by the error of the sensor.
        truly = tube.widened(position_errors(tables))
        self._frontier = Frontier(self._checker, truly, RESOLUTION * tables.period)
        parts = tables.robots
        rates = tube.degree * np.diff(tube.control, axis=1)
        self._rates: Floats = rates / np.diff(tube.times)[:, None, None]
        self._times: list[float] = tube.times.tolist()
        self._given, self._stamps = attributes(watch.given), watch.stamps
        self._names = tuple(f"{part.name}/" for part in parts)
        self._joints = [
            slice(part.first_joint, part.first_joint + part.joint_count)
            for part in parts
        ]
        self._levels = slice(
            layout.HEADER + IN_ROBOT.level,
            layout.HEADER + len(parts) * layout.ROBOT_WIDTH,
            layout.ROBOT_WIDTH,
        )
        self._fresh, self._lost = True, False

    def look(self, q: Floats, answer: Floats, changes: int) -> Ahead:
        """Prove a part of the rest of the plan; returns how far. Never raises.

        Args:
            q: Measured positions of a cycle; empty if its input was refused.
            answer: Numbers of its verdict.
            changes: How often the guard's world has changed.
        """
        given, stamps = float(self._given.now), self._stamps.tolist()
        now = (given if given == given else max(stamps)) - self._start
        stopped = answer[self._levels].max() >= Level.STOP
        reason = Reason(int(answer[IN_HEADER.reason]))
        if not len(q) or stopped or reason.level >= Level.STOP or not isfinite(now):
            return Ahead(AheadReason.STOPPED)
        if changes != self._changes:
            self._changes, self._fresh = changes, True
            self._lost = self._lost or self._bound != bindings_of(self._proven.tables)
            if not self._lost:
                self._proven.place_objects(self._checker, self._placed)
        if self._lost:
            return Ahead(AheadReason.CHANGED)
        if not self._follows(q, stamps):
            return Ahead(AheadReason.NOT_FOLLOWED)
        frontier = self._frontier
        if self._fresh or now > frontier.until:
            frontier.restart(now)
            self._fresh = False
        frontier.advance()
        return self._answer(now)

    def _answer(self, now: float) -> Ahead:
        """The answer of a cycle at a time of the plan."""
        frontier = self._frontier
        _, speeds = self._at(now, self._rates)
        reason, concerned = AheadReason.UNPROVEN, [*range(len(self._names))]
        a, b = frontier.pair
        if frontier.until == inf:
            return Ahead(AheadReason.PROVEN, inf, 0.0)
        if frontier.crowded:
            reason = AheadReason.CROWDED
        elif a:
            reason = AheadReason.NEAR
            names = enumerate(self._names)
            concerned = [
                r for r, own in names if a.startswith(own) or b.startswith(own)
            ]
        # Before its time 0 the arms are at the plan's first row already.
        lead = frontier.until - now if frontier.until > self._times[0] else 0.0
        tables, given = self._proven.tables, np.abs(speeds).tolist()
        stops = [time_to_stop(tables.robots[r], given, tables) for r in concerned]
        worst = max(stops, default=inf)
        return Ahead(reason, lead, worst, a, b)

    def _follows(self, q: Floats, stamps: list[float]) -> bool:
        """Whether each robot was within its widths of the plan at its stamp."""
        last, segment, there = inf, 0, q
        for own, stamp in zip(self._joints, stamps, strict=True):
            if stamp != last:
                last, (segment, there) = (
                    stamp,
                    self._at(stamp - self._start, self._tube.control),
                )
            away = np.abs(q[own] - there[own])
            if not (away <= self._tube.wide[segment, own]).all():
                return False
        return True

    def _at(self, time: float, control: Floats) -> tuple[int, Floats]:
        """Segment at a time, the nearest outside the plan, and the curves there.

        Args:
            time: Time of the plan; for NaN the curves are NaN [s].
            control: Control points of the curves, shape (s, degree + 1, n).
        """
        at = bisect_right(self._times, time) - 1
        segment = min(max(at, 0), len(self._times) - 2)
        start, end = self._times[segment], self._times[segment + 1]
        share = min(max((time - start) / (end - start), 0.0), 1.0)
        degree = control.shape[1] - 1
        basis = [
            comb(degree, k) * share**k * (1.0 - share) ** (degree - k)
            for k in range(degree + 1)
        ]
        return segment, np.asarray(basis @ control[segment])


def tube_of(
    plan: Announced,
    start: float,
    following_error: float | Mapping[str, float],
    tables: SceneTables,
) -> Tube:
    """The tube of a plan that can be announced, see `LookAhead` for errors."""
    if not any(part.mode != "fixed" for part in tables.robots):
        raise SceneError(
            "the mode of every robot is 'fixed': no stop is predicted, so no lead can "
            "be compared with one; give the robots another mode"
        )
    if tables.sensing is not None:
        raise SceneError(
            "the scene has `sensing`: the proof ahead does not know cells; announce "
            "plans to a guard of the scene without it"
        )
    if not plan.timed:
        raise TrajectoryError(
            f"{plan.source}: it has no times, so it has no lead; give times"
        )
    if not isfinite(start):
        raise TrajectoryError(f"start is {start}; it must be a finite time [s]")
    joints = plan.tube.control.shape[2]
    if joints != len(tables.q_names):
        raise TrajectoryError(
            f"{plan.source}: it is of a scene with {joints} joints, and the guard has "
            f"{len(tables.q_names)}; read it for the guard's scene"
        )
    return plan.widened(tables, following_error)


def time_to_stop(part: RobotPart, speeds: list[float], tables: SceneTables) -> float:
    """Reaction and stop of a robot's slowest joint; infinite without figures [s].

    Args:
        part: The robot.
        speeds: Speeds of all joints [rad/s or m/s].
        tables: The scene.
    """
    figures, first = part.stopping, part.first_joint
    if figures is None:
        return inf
    stops = (
        stop_travel(figures, j, speeds[first + j], tables.period, tables.late).time
        for j in range(part.joint_count)
    )
    return max(stops, default=0.0)


def position_errors(tables: SceneTables) -> Floats:
    """Greatest error of each measured joint position, shape (n,) [rad or m]."""
    errors = np.zeros(len(tables.q_names))
    for part in tables.robots:
        if part.stopping is not None:
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            errors[own] = part.stopping.position_error
    return errors


def bindings_of(tables: SceneTables) -> tuple[bytes, bytes]:
    """Which bodies carry which, and which groups are checked, as bytes."""
    return tables.parent.tobytes(), tables.checked.tobytes()


@dataclass(slots=True)
class Outlook:
    """The announced plan of a loop, and the last look at it.

    Attributes:
        plan: The plan; None if there is none.
        last: Answer of the last cycle.
        changes: How often the world has changed.
    """

    plan: LookAhead | None = None
    last: Ahead = NO_PLAN
    changes: int = 0

    def take(self, plan: LookAhead | None) -> None:
        """Put a plan, or none, in the place of the last one."""
        self.plan, self.last = plan, NO_PLAN

    def note(self, q: Floats, answer: Floats) -> None:
        """Look ahead in a cycle, see `LookAhead.look`."""
        if self.plan is not None:
            self.last = self.plan.look(q, answer, self.changes)
