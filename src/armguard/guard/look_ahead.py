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
from armguard.prove.stop_order import stop_times
from armguard.prove.tube import Tube
from armguard.record import attributes
from armguard.scene.tables import SceneTables

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
        self._frontier = Frontier(self._checker, tube, RESOLUTION * tables.period)
        parts = tables.robots
        self._needed = needed_times(tube, tables).tolist()
        self._times: list[float] = tube.times.tolist()
        self._chosen = [comb(tube.degree, k) for k in range(tube.degree + 1)]
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
        """Prove a part of what follows, and say how far it is proven. Never raises.

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
        """What is proven from a time of the plan on."""
        frontier = self._frontier
        needed = self._needed[self._segment(now)]
        reason, concerned = AheadReason.UNPROVEN, [*range(len(self._names))]
        a, b = frontier.pair
        if frontier.until == inf:
            reason = AheadReason.PROVEN
        elif frontier.crowded:
            reason = AheadReason.CROWDED
        elif a:
            reason = AheadReason.NEAR
            names = enumerate(self._names)
            concerned = [
                r for r, own in names if a.startswith(own) or b.startswith(own)
            ]
        # Before its time 0 the arms are at the plan's first row already.
        lead = frontier.until - now if frontier.until > self._times[0] else 0.0
        worst = max((needed[r] for r in concerned), default=inf)
        return Ahead(reason, lead, worst, a, b)

    def _follows(self, q: Floats, stamps: list[float]) -> bool:
        """Whether each robot was within its widths of the plan at its stamp."""
        last, segment, there = inf, 0, q
        for own, stamp in zip(self._joints, stamps, strict=True):
            if stamp != last:
                last, (segment, there) = stamp, self._at(stamp - self._start)
            away = np.abs(q[own] - there[own])
            if not (away <= self._tube.wide[segment, own]).all():
                return False
        return True

    def _segment(self, time: float) -> int:
        """Segment of the plan at a time; the nearest one outside it."""
        at = bisect_right(self._times, time) - 1
        return min(max(at, 0), len(self._times) - 2)

    def _at(self, time: float) -> tuple[int, Floats]:
        """Segment of the plan at a time, and joint positions; NaN for NaN."""
        segment = self._segment(time)
        start, end = self._times[segment], self._times[segment + 1]
        share = min(max((time - start) / (end - start), 0.0), 1.0)
        degree = len(self._chosen) - 1
        basis = [
            chosen * share**k * (1.0 - share) ** (degree - k)
            for k, chosen in enumerate(self._chosen)
        ]
        return segment, np.asarray(basis @ self._tube.control[segment])


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


def needed_times(tube: Tube, tables: SceneTables) -> Floats:
    """Reaction and stop of each robot in each segment, shape (s, r) [s].

    From the greatest speeds in the segment; infinite without stopping figures.
    """
    speeds = tube.top_speeds()
    needed = np.full((len(speeds), len(tables.robots)), inf)
    for r, part in enumerate(tables.robots):
        if part.stopping is None:
            continue
        for k, own in enumerate(speeds):
            needed[k, r] = sum(stop_times(part, own, tables))
    return needed


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
