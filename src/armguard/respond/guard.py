"""Guard: a monitor that also filters the operators' desired motion."""

from collections.abc import Callable, Mapping
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.guard.answer import stop_answer
from armguard.guard.checkpoint import chosen
from armguard.guard.given import NO_POSITIONS, JointVector, real_or_none
from armguard.guard.levels import Reason
from armguard.guard.loop import OTHER_THREAD
from armguard.guard.monitor import Monitor
from armguard.guard.parts import delegated
from armguard.guard.self_test import SelfTestReport
from armguard.guard.verdict import Verdict
from armguard.respond import remembered
from armguard.respond.command import Blocked, Command
from armguard.respond.compiling import compile_ahead
from armguard.respond.daqp_interface import FUNCTION
from armguard.respond.escape_state import escape_of
from armguard.respond.evasion import evade_all
from armguard.respond.goals import Guidance, check_modes
from armguard.respond.lead_state import lead_of
from armguard.respond.requested import (
    positions_in,
    reason_of_stop,
    twists_in,
    velocities_in,
)
from armguard.respond.responses import behaviours
from armguard.respond.self_test import filter_line
from armguard.respond.solver import nearest_velocity
from armguard.respond.state import (
    NEVER,
    POSITIONS,
    ROWS,
    STANDSTILL,
    TWISTS,
    VELOCITIES,
    Response,
    response_of,
)
from armguard.respond.tool import Tools
from armguard.respond.units import DesiredUnits
from armguard.respond.whole_cycle import (
    begin_filtered_cycle,
    end_filtered_cycle,
    run_filtered_cycle,
)
from armguard.scene.scene import Scene
from armguard.separate import link_missing
from armguard.table import Ledger

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Positions, stamps, velocities and the time of a cycle, see `Guard.filter`.
Given = tuple[
    JointVector, float | Mapping[str, float], JointVector | None, float | None
]


class Guard(Monitor):
    """Guard of a scene: judges its robots and filters their commands.

    Each `step` judges one joint configuration, and its caller obeys the verdict. Each
    `filter` also returns a command: the desired motion if it is proven safe, else a
    proven motion near it, else a stop.

    Args:
        scene: Scene to guard.
        budget: See `Monitor`, from here to `clock`. A filtered cycle judges up to five
            times within one budget.
        self_test: Whether to run the self-test.
        compiling: Whether this guard only serves to compile kernels ahead.
        progress: Function that takes a sentence before each long operation.
        clock: Clock in nanoseconds.

    Raises:
        SceneError: The scene contradicts itself.
        HomeContactError: Checked bodies overlap at the home configuration.
        SelfTestError: The self-test missed a level, a stop or a refusal.

    Example:
        >>> import numpy as np
        >>> from armguard import Guard, bay_scene
        >>> guard = Guard(bay_scene("path"))
        >>> desired = np.full(len(guard.q_names), 0.005)
        >>> guard.filter(guard.home, desired, stamp=0.0, velocity=0.0 * desired).action
        <Action.FOLLOW: 0>
    """

    def __init__(
        self,
        scene: Scene,
        *,
        budget: int = 1024,
        self_test: bool = True,
        compiling: bool = False,
        progress: Callable[[str], None] | None = None,
        clock: Callable[[], int] = perf_counter_ns,
    ) -> None:
        self._response: Response | None = None
        self._compiling = compiling
        super().__init__(
            scene, budget=budget, self_test=self_test, progress=progress, clock=clock
        )
        tables = self.tables
        self._tools, self._units = Tools(tables), DesiredUnits(tables)
        self._guidance = Guidance(tables, self._watch, self._tools, self.check_path)
        if not compiling and all(part.mode != "fixed" for part in tables.robots):
            # Compiles or loads the kernels of a filtered cycle before the loop.
            still = np.zeros(len(self.q_names))
            self.filter(self.home, still, 0.0, velocity=still)
            self.reset()
            if self_test:
                line = filter_line(self, self.filter, self.engage)
                self.self_test = SelfTestReport((*self.self_test.lines, line))

    def __repr__(self) -> str:
        """Names of the robots, counts of bodies, and the period."""
        tables = self.tables
        robots = ", ".join(part.name for part in tables.robots) or "none"
        return (
            f"<Guard period {tables.period * 1e3:g} ms; robots: {robots}; "
            f"{len(self.q_names)} joints, {len(tables.kinds)} primitives>"
        )

    @property
    def ledgers(self) -> tuple[Longs, Longs]:
        """Ledgers of its responses and of its workspace, for `run_filtered_cycle`.

        For clients that pass measurements to the kernels themselves, and call nothing
        else between the begin and the end of a cycle. A new object may replace the
        ledger of the workspace.
        """
        if self._response is None:
            self._prepare_filter()
        return self._response_lines, self._lines

    @property
    def solves_compiled(self) -> bool:
        """Whether kernels can call the solver of quadratic programs."""
        response = self._response or self._prepare_filter()
        return bool(response.solver[FUNCTION])

    def filter(
        self,
        q: JointVector,
        v_desired: JointVector | Mapping[str, float],
        stamp: float | Mapping[str, float],
        *,
        velocity: JointVector | None = None,
        now: float | None = None,
    ) -> Command:
        """Command for desired joint velocities. Never raises after the first cycle.

        Desired velocities that are provably safe pass bit for bit. All commands to the
        robots must pass this filter, or the proof does not hold.

        Args:
            q: Measured joint positions in the order of `q_names`, (n,), or a vector of
                each robot by its name [rad or m].
            v_desired: Desired joint velocities, shape (n,), or by joint name or as
                vectors by robot name, with zero for those not named [rad/s or m/s].
            stamp: Time of the measurement, see `step` [s].
            velocity: Measured joint velocities, see `step` [rad/s or m/s].
            now: Time of this cycle, see `step` [s].

        Raises:
            SceneError: The scene has a robot whose mode is "fixed"; in the first cycle.
        """
        requested, fault = velocities_in(v_desired, self._input.shape, self.tables)
        return self._filter((q, stamp, velocity, now), VELOCITIES, requested, fault)

    def filter_positions(
        self,
        q: JointVector,
        q_desired: JointVector,
        stamp: float | Mapping[str, float],
        *,
        velocity: JointVector | None = None,
        now: float | None = None,
    ) -> Command:
        """Command for desired joint positions: send `Command.position`.

        A first position that is far from the robot, at the start or after a stop, is
        refused or followed slowly: see `ResponseSettings.far`.

        Args:
            q: Measured joint positions, see `filter`.
            q_desired: Desired joint positions, as `q` [rad or m].
            stamp: See `filter`, from here to `now`.
            velocity: Measured joint velocities.
            now: Time of this cycle.

        Raises:
            SceneError: See `filter`.
        """
        goal = positions_in(q_desired, self.tables)
        return self._filter((q, stamp, velocity, now), POSITIONS, *goal)

    def filter_twists(
        self,
        q: JointVector,
        twists: Mapping[str, ArrayLike],
        stamp: float | Mapping[str, float],
        *,
        velocity: JointVector | None = None,
        now: float | None = None,
    ) -> Command:
        """Command for desired twists of tools.

        Args:
            q: Measured joint positions, see `filter`.
            twists: Velocity of the tool's origin and angular velocity, both in the
                world, by robot, or by 'robot/link' for a link other than its tool,
                shape (6,) [m/s], [rad/s]. No motion is requested of other robots.
            stamp: See `filter`, from here to `now`.
            velocity: Measured joint velocities.
            now: Time of this cycle.

        Raises:
            SceneError: See `filter`.
        """
        rows, fault = twists_in(twists, self._tools)
        form = TWISTS if rows is not None else VELOCITIES
        return self._filter((q, stamp, velocity, now), form, rows, fault)

    def stop(
        self,
        q: JointVector,
        stamp: float | Mapping[str, float],
        *,
        velocity: JointVector | None = None,
        now: float | None = None,
        reason: Reason = Reason.STOP_ORDERED,
    ) -> Command:
        """Order all robots to stop, or to stay at rest, for one cycle.

        Never raises after the first cycle.

        Args:
            q: Measured joint positions, see `filter`.
            stamp: See `filter`, from here to `now`.
            velocity: Measured joint velocities.
            now: Time of this cycle.
            reason: Reason of the stop, one of `ORDERED`; others count as
                `STOP_ORDERED`. After `STOP_ORDERED` and `RESTARTED` only `engage`
                releases the robots.

        Raises:
            SceneError: See `filter`.
        """
        requested = np.array([reason_of_stop(reason)], dtype=np.float64)
        return self._filter((q, stamp, velocity, now), STANDSTILL, requested, "")

    engage = delegated("_guidance", Guidance.engage)
    hold = delegated("_guidance", Guidance.hold)
    field_goal = delegated("_guidance", Guidance.field_goal)
    retreat = delegated("_guidance", Guidance.retreat)

    @property
    def ordered(self) -> dict[str, Reason]:
        """Reasons of ordered stops, by name of each robot that waits for `engage`."""
        return self._guidance.ordered

    def reset(self) -> None:
        """Reset as in `Monitor.reset`, and clear commands and goals."""
        super().reset()
        if (response := self._response) is not None:
            response.spare_of.fill(NEVER)
            for notes in (response.notes, self._lead.notes, self._escape.notes):
                notes.fill(0)
            for array in (response.missed, response.requested, response.far):
                array.fill(0.0)
            for array in (response.held, response.held_since):
                array.fill(np.nan)

    def _compile_ahead(self, progress: Callable[[str], None] | None) -> None:
        """Compile the kernels ahead, see `compile_ahead`."""
        if not self._compiling:
            compile_ahead(progress, self._guarded, try_out)

    def _filter(
        self, given: Given, form: int, requested: Floats | None, refused: str
    ) -> Command:
        """Run one cycle: judge, respond, prove, command."""
        start = self._clock()
        response = self._response or self._prepare_filter()
        time: Any = given[1] if given[3] is None else given[3]
        if type(time) is not float:
            time = real_or_none(time)
        if self._busy:
            return self._crowded_command(response, time)
        self._busy = True
        try:
            data, fault = self._filtered(response, given, form, requested)
            numbers = response.commanded.copy()
            self._units.note(form, requested)
        finally:
            self._busy = False
        elapsed = (self._clock() - start) * 1e-9
        about = fault or refused, self._cells_seen(time), self._outlook.last
        verdict = Verdict(data, self._names, time, elapsed, *about)
        return Command(numbers, self.tables.robots, verdict)

    def _filtered(
        self, response: Response, given: Given, form: int, requested: Floats | None
    ) -> tuple[Floats, str]:
        """Numbers of the verdict, and the fault of the input in words."""
        array, fault = self._input.take(*given)
        desired = NO_POSITIONS if requested is None else requested
        answers, lines = self._response_lines, self._lines
        if response.solver[FUNCTION]:
            used = run_filtered_cycle(array, form, desired, answers, lines)
        else:
            unsolved = begin_filtered_cycle(array, form, desired, answers, lines)
            if unsolved > 0:
                unsolved = self.solve_programs(unsolved)
            used = end_filtered_cycle(array, unsolved, answers, lines)
        return self._answer(used, fault, array)

    def _crowded_command(self, response: Response, stamp: float | None) -> Command:
        """Stop command for a cycle during which another thread called the guard."""
        numbers = np.zeros_like(response.commanded)
        n, r = len(self.q_names), len(self._input.robots)
        numbers[n : 2 * n] = np.nan
        # Blocked reason of each robot; its phase stays 0, RESTING: it is not driven.
        numbers[4 * n : 4 * n + r] = Blocked.STOPPED
        numbers[4 * n + 2 * r : 4 * n + 3 * r] = np.nan
        stopped = stop_answer(self._names, Reason.WRONG_INPUT)
        verdict = Verdict(stopped, self._names, stamp, 0.0, OTHER_THREAD)
        return Command(numbers, self.tables.robots, verdict)

    def solve_programs(self, programs: int) -> int:
        """Solve the programs of some robots in Python.

        Call it between `begin_filtered_cycle` and `end_filtered_cycle`.

        Args:
            programs: The robots, a bit for each.

        Returns:
            Robots whose program has no solution, a bit for each.
        """
        response = self._response or self._prepare_filter()
        unsolved = 0
        for r, part in enumerate(self.tables.robots):
            if not programs >> r & 1:
                continue
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            rows = slice(r * ROWS, r * ROWS + response.notes[r].row_count)
            found = None
            for limits in (response.limits, response.eased):
                if found is None and not response.notes[r].overflows:
                    found = nearest_velocity(
                        response.target[own],
                        response.low[own],
                        response.high[own],
                        response.rows[rows, own],
                        limits[rows],
                    )
            if found is None:
                unsolved |= 1 << r
            else:
                response.target[own] = found
        return unsolved

    def _prepare_filter(self) -> Response:
        """Allocate the responses; a mode "fixed" raises `SceneError`."""
        check_modes(self.tables)
        settings = behaviours(self.tables)
        evades = len(self._watch.clusters) > 0 and settings["evade_time"].any()
        if len(self._watch.movers) or evades:
            link_missing(evade_all)
        self._lead = lead_of(self.tables)
        self._escape = escape_of(self.tables)
        given = self.tables, settings, self._lead, self._escape
        self._response = response = response_of(*given)
        self._response_ledger = Ledger(response)
        self._response_lines = self._response_ledger.lines
        self._guidance.response, self._guidance.lead = response, self._lead
        kept = chosen(response=response, lead=self._lead, escape=self._escape)
        self._saving.add(kept, remembered.BOUNDS, remembered.more_of(self.tables))
        return response


def try_out(scene: Scene) -> None:
    """Guard a scene for a cycle, so that its kernels are compiled."""
    guard = Guard(scene, self_test=False, compiling=True)
    guard.step(guard.home, 0.0)
    if guard._guarded:
        guard.check_path([guard.home, guard.home])
