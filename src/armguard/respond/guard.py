"""The guard in the loop: what operators want goes in, what is safe comes out."""

from collections.abc import Callable, Mapping, Sequence
from threading import get_ident
from time import perf_counter_ns
from typing import Any, Literal, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.geometry.pose import Pose
from armguard.guard import layout
from armguard.guard.answer import stop_answer
from armguard.guard.checkpoint import chosen
from armguard.guard.given import (
    FLOAT64,
    NO_POSITIONS,
    is_mapping,
    kind_of,
    real_or_none,
)
from armguard.guard.levels import Reason
from armguard.guard.monitor import OTHER_THREAD, Monitor
from armguard.guard.self_test import SelfTestReport
from armguard.guard.verdict import Verdict
from armguard.respond.asked import as_vector, named_vector, reason_of_stop
from armguard.respond.command import Blocked, Command
from armguard.respond.compiling import compile_ahead
from armguard.respond.daqp_interface import FUNCTION
from armguard.respond.engagement import Standing
from armguard.respond.escape_state import escape_of
from armguard.respond.goals import engage_lead, find_retreat, set_goal
from armguard.respond.lead_state import lead_of
from armguard.respond.remembered import BOUNDS as RESPONSE_BOUNDS
from armguard.respond.remembered import more_of
from armguard.respond.self_test import filter_line
from armguard.respond.solver import nearest_velocity
from armguard.respond.state import (
    CROWDED,
    MOST_TWISTS,
    NEVER,
    ORDERED,
    POSITIONS,
    ROW_COUNT,
    ROWS,
    STANDSTILL,
    STATE,
    TOOL_POINT,
    TOOL_TWIST,
    TWIST_ROW,
    TWISTS,
    VELOCITIES,
    Response,
    response_of,
)
from armguard.respond.tool import Tool, tool_of
from armguard.respond.whole_cycle import (
    begin_filtered_cycle,
    end_filtered_cycle,
    run_filtered_cycle,
)
from armguard.scene.scene import Scene
from armguard.table import Ledger

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


class Guard(Monitor):
    """Watches a scene, and keeps what is told to its robots safe.

    Each `step` judges one joint configuration, and somebody else obeys the verdict.
    Each `filter` does the same and gives back what to tell the robots: what their
    operators ask for where that is proven, else something near it that is, else a stop.

    Args:
        scene: What to guard.
        budget: See `Monitor`, from here to `clock`. A filtered cycle judges up to five
            times, all of them out of one budget.
        self_test: Whether to test itself.
        compiling: Set where kernels are compiled ahead, which itself needs a guard.
        progress: Told before anything that takes long.
        clock: Clock in nanoseconds.

    Raises:
        SceneError: The scene contradicts itself.
        HomeContactError: Checked bodies overlap at the home configuration.
        SelfTestError: A level, a stop or a refusal did not come when it should have.

    Example:
        >>> import numpy as np
        >>> from armguard import Guard, bay_scene
        >>> guard = Guard(bay_scene("path"))
        >>> wish = np.full(len(guard.q_names), 0.005)
        >>> guard.filter(guard.home, wish, stamp=0.0, velocity=0.0 * wish).action
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
        self._tools: dict[str, Tool] = {}
        self._compiling = compiling
        super().__init__(
            scene, budget=budget, self_test=self_test, progress=progress, clock=clock
        )
        modes = {part.mode for part in self.tables.robots}
        if "fixed" not in modes and not compiling:
            # Compiles or loads what a filtered cycle needs, before the loop.
            still = np.zeros(len(self.q_names))
            self.filter(self.home, still, 0.0, velocity=still)
            self.reset()
            if self_test:
                lines = (*self.self_test.lines, filter_line(self, self._watch))
                self.self_test = SelfTestReport(lines)

    @property
    def ledgers(self) -> tuple[Longs, Longs]:
        """Ledgers of its responses and of its workspace, for `run_filtered_cycle`.

        For who hands over what was measured by himself, and calls nothing else between
        the beginning of a cycle and its end. Objects that come may bring another one of
        the workspace.
        """
        if self._response is None:
            self._prepare_filter()
        return self._response_lines, self._lines

    @property
    def solves_compiled(self) -> bool:
        """Whether kernels can call the solver of programs."""
        response = self._response or self._prepare_filter()
        return bool(response.solver[FUNCTION])

    def filter(
        self,
        q: ArrayLike,
        v_desired: ArrayLike | Mapping[str, float],
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
    ) -> Command:
        """What to tell robots whose operators want these velocities. Never raises.

        What is wanted and can be proven is passed on bit for bit. All that the robots
        are told must go through here, or the proof does not hold.

        Args:
            q: Measured joint positions in the order of `q_names`, (n,) [rad or m].
            v_desired: Joint velocities the operators want, shape (n,), or by joint name
                with nothing for the others [rad/s or m/s].
            stamp: When they were measured, see `step` [s].
            velocity: Measured velocities, see `step`.
            now: Time of this cycle, see `step`.

        Raises:
            SceneError: The scene has a robot whose mode is "fixed"; in the first cycle.
        """
        asked: Floats | None
        if self._is_vector(v_desired):
            asked, fault = v_desired, ""
        elif is_mapping(v_desired):
            asked, fault = named_vector("v_desired", v_desired, self.q_names)
        else:
            asked, fault = as_vector("v_desired", v_desired, self._input.shape[0])
        return self._filter(q, stamp, velocity, now, VELOCITIES, asked, fault)

    def filter_positions(
        self,
        q: ArrayLike,
        q_desired: ArrayLike,
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
    ) -> Command:
        """The same where operators want positions: `Command.position` is what to tell.

        A first position that is far from where the robot is, at the start or after a
        stop, is not simply followed: see `ResponseSettings.far`.

        Args:
            q: Measured joint positions, see `filter`.
            q_desired: Joint positions the operators want, shape (n,) [rad or m].
            stamp: See `filter`, from here to `now`.
            velocity: Measured velocities.
            now: Time of this cycle.

        Raises:
            SceneError: See `filter`.
        """
        goal, fault = as_vector("q_desired", q_desired, self._input.shape[0])
        return self._filter(q, stamp, velocity, now, POSITIONS, goal, fault)

    def filter_twists(
        self,
        q: ArrayLike,
        twists: Mapping[str, ArrayLike],
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
    ) -> Command:
        """The same where operators want their tools to move.

        Args:
            q: Measured joint positions, see `filter`.
            twists: Velocity of the tool's origin and angular velocity, both in the
                world, by robot, or by 'robot/link' for another link than its tool,
                shape (6,) [m/s], [rad/s]. Who is not named is asked for nothing.
            stamp: See `filter`, from here to `now`.
            velocity: Measured velocities.
            now: Time of this cycle.

        Raises:
            SceneError: See `filter`.
        """
        try:
            wanted, fault = self._wanted_twists(twists)
        except Exception:  # whatever a stranger's object raises, the loop goes on
            fault = f"twists is a {kind_of(twists)}; it must be 6 numbers by robot"
        if fault:
            return self._filter(q, stamp, velocity, now, VELOCITIES, None, fault)
        return self._filter(q, stamp, velocity, now, TWISTS, wanted, fault)

    def _wanted_twists(
        self, twists: Mapping[str, ArrayLike]
    ) -> tuple[list[tuple[Tool, Floats]], str]:
        """Twists with their tools, or why they are none."""
        wanted: list[tuple[Tool, Floats]] = []
        fault = ""
        if len(twists) > MOST_TWISTS:
            return wanted, (
                f"there are {len(twists)} twists; no more than {MOST_TWISTS} are led"
            )
        for name, twist in twists.items():
            tool = self._tool(name)
            vector, wrong = as_vector(f"the twist of '{name}'", twist, 6)
            if tool is None:
                known = (*self._input.robots, *self.tables.links)
                near = did_you_mean(str(name), known)
                wrong = f"there is a twist for '{name}', no tool; {near}"
            elif vector is not None:
                wanted.append((tool, vector))
            fault = fault or wrong
        return wanted, fault

    def stop(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
        reason: Reason = Reason.STOP_ORDERED,
    ) -> Command:
        """One cycle in which all robots are to stop, or to stand still. Never raises.

        Args:
            q: Measured joint positions, see `filter`.
            stamp: See `filter`, from here to `now`.
            velocity: Measured velocities.
            now: Time of this cycle.
            reason: Why, of `ORDERED`; anything else counts as `STOP_ORDERED`. After
                `STOP_ORDERED` and `RESTARTED` robots go on only when they are engaged.

        Raises:
            SceneError: See `filter`.
        """
        asked = np.array([reason_of_stop(reason)], dtype=np.float64)
        return self._filter(q, stamp, velocity, now, STANDSTILL, asked, "")

    def engage(self, name: str | None = None, *, ordered: bool = True) -> None:
        """Give a robot back to its operator after a stop, or all of them.

        What is asked for in velocities is then followed; positions are caught up with.

        Args:
            name: A robot; all of them if None.
            ordered: Whether also those that were ordered to stop, see `stop`. A program
                that engages by itself leaves these to a person: False.

        Raises:
            UnknownNameError: There is no such robot.
        """
        self._check_robot(name)
        if self._response is None:
            return
        for robot, r in self._input.robots.items():
            notes = self._response.notes[r]
            if name in (None, robot) and (ordered or not notes[ORDERED]):
                notes[ORDERED] = 0
                engage_lead(r, self._lead)
                if notes[STATE] == Standing.WAITING:
                    notes[STATE] = Standing.CATCHING_UP

    @property
    def ordered(self) -> dict[str, Reason]:
        """Robots that wait to be engaged after a stop that was ordered, and why."""
        if self._response is None:
            return {}
        notes = self._response.notes
        why = {name: notes[r][ORDERED] for name, r in self._input.robots.items()}
        return {name: Reason(int(reason)) for name, reason in why.items() if reason}

    def hold(self, ordered: Mapping[str, Reason]) -> None:
        """Have robots wait to be engaged, as after a stop that was ordered.

        Args:
            ordered: `ordered` of another guard of these robots.

        Raises:
            UnknownNameError: There is no such robot.
        """
        for name, reason in ordered.items():
            self._check_robot(name)
            if self._response is not None:
                notes = self._response.notes[self._input.robots[name]]
                notes[ORDERED], notes[STATE] = reason_of_stop(reason), Standing.WAITING

    def field_goal(
        self,
        name: str,
        *,
        q: ArrayLike | None = None,
        pose: Pose | ArrayLike | None = None,
    ) -> None:
        """Set what the field of a robot draws it to, in place of any other goal.

        For between two cycles. From the next one on the robot is led there where
        `filter` or `filter_twists` are asked for nothing of it. A stop suspends that
        until `engage` or another goal. With neither `q` nor `pose` it has no goal.

        Args:
            name: A robot whose response is "field", or 'robot/link' for the pose of
                another link than its tool.
            q: Its joint positions, in its own order, shape (k,) [rad or m].
            pose: Frame of the tool in the world, a `Pose` or a transform (4, 4).

        Raises:
            UnknownNameError: There is no such robot or link.
            GoalError: The robot's response is another one, or the positions are none
                it can be at, or both are given.
            PoseError: The transform is not rigid, or a number is not finite.
            SceneError: The scene has a robot whose mode is "fixed".
        """
        response = self._response or self._prepare_filter()
        tool = self._tool(name)
        if tool is None:
            known = (*self._input.robots, *self.tables.links)
            raise UnknownNameError(
                f"no robot or link is named '{name}'; {did_you_mean(name, known)}"
            )
        robot = name.split("/", 1)[0]
        r = self._input.robots[robot]
        set_goal(r, tool, q, pose, self._lead)
        notes = response.notes[r]
        if notes[STATE] == Standing.WAITING:
            notes[STATE] = Standing.CATCHING_UP

    def retreat(
        self, name: str | None = None, to: Literal["path"] | ArrayLike = "path"
    ) -> None:
        """Have a robot go back along the way that led it in, or to safe positions.

        For between two cycles; with positions it takes some milliseconds. The robot
        goes no faster than its `resume_speed`, as soon as it rests if it is being
        stopped, and waits where its way is not free any more. It ends when the robot is
        there, when its operator asks for something after he has let go of it, with
        `engage`, or with another stop. Where operators tell positions, these are not
        followed meanwhile.

        To positions it goes straight if `check_path` clears that, all others standing;
        else along the way that led in to where it does, and straight from there.

        Args:
            name: A robot; all of them if None.
            to: "path", or joint positions of that robot, shape (k,) [rad or m].

        Raises:
            UnknownNameError: There is no such robot.
            GoalError: `to` is neither, or not somewhere the robot can be.
            NoRetreatError: Nothing of the way that led in is known, or from no place on
                it a free way leads to the positions.
            SceneError: The scene has a robot whose mode is "fixed".
        """
        self._check_robot(name)
        if self._response is None:
            self._prepare_filter()
        find_retreat(self, name, to, self._lead)

    def reset(self) -> None:
        """See `Monitor.reset`; what was told, and goals, are forgotten as well."""
        super().reset()
        if self._response is not None:
            self._response.notes.fill(0)
            self._lead.notes.fill(0)
            self._escape.notes.fill(0)
            self._response.spare_of.fill(NEVER)
            self._response.missed.fill(0.0)
            self._response.held.fill(np.nan)
            self._response.held_since.fill(np.nan)
            self._response.asked.fill(0.0)
            self._response.far.fill(0.0)

    def _compile_ahead(self, progress: Callable[[str], None] | None) -> None:
        """See `compile_ahead`."""
        if not self._compiling:
            compile_ahead(progress, self._guarded, try_out)

    def _filter(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float],
        velocity: ArrayLike | None,
        now: float | None,
        form: int,
        asked: Floats | Sequence[tuple[Tool, Floats]] | None,
        refused: str,
    ) -> Command:
        """One cycle: judge, respond, prove, tell."""
        start = self._clock()
        response = self._response or self._prepare_filter()
        told: Any = stamp if now is None else now
        if type(told) is not float:
            told = real_or_none(told)
        thread = get_ident()
        if self._thread and self._thread != thread:
            return self._crowded_command(response, told)
        self._thread = thread
        try:
            data, fault = self._filtered(response, q, stamp, velocity, now, form, asked)
            numbers = response.told.copy()
        finally:
            alone = self._thread == thread
            self._thread = 0 if alone else self._leave_others()
        if not alone:
            return self._crowded_command(response, told)
        elapsed = (self._clock() - start) * 1e-9
        verdict = Verdict(data, self._names, told, elapsed, fault or refused)
        return Command(numbers, self.tables.robots, verdict)

    def _filtered(
        self,
        response: Response,
        q: ArrayLike,
        stamp: float | Mapping[str, float],
        velocity: ArrayLike | None,
        now: float | None,
        form: int,
        asked: Floats | Sequence[tuple[Tool, Floats]] | None,
    ) -> tuple[Floats, str]:
        """The numbers of the verdict, and what was wrong with the input in words."""
        array, fault = self._input.take(q, stamp, velocity, now)
        if asked is None:
            wish = NO_POSITIONS
        elif isinstance(asked, np.ndarray):
            wish = asked
        else:
            wish = rows_of_twists(asked)
        lines = self._response_lines, self._lines
        if response.solver[FUNCTION]:
            used = run_filtered_cycle(array, form, wish, *lines)
        else:
            unsolved = begin_filtered_cycle(array, form, wish, *lines)
            if unsolved > 0:
                unsolved = self.solve_programs(unsolved)
            used = end_filtered_cycle(array, unsolved, *lines)
        data = self._out[:used].copy()
        self._pace.note(data)
        if fault:
            data[layout.REASON] = Reason.WRONG_INPUT
            data[layout.JOINT] = -1.0
        return data, fault

    def _crowded_command(self, response: Response, stamp: float | None) -> Command:
        """What a cycle says that another thread is in the way of: all stop."""
        numbers = np.zeros_like(response.told)
        n, r = len(self.q_names), len(self._input.robots)
        numbers[n : 2 * n] = np.nan
        # Why each is blocked, then its phase: at rest, so that it is not driven.
        numbers[4 * n : 4 * n + r] = Blocked.STOPPED
        numbers[4 * n + 2 * r : 4 * n + 3 * r] = np.nan
        verdict = Verdict(
            stop_answer(self._names, Reason.WRONG_INPUT),
            self._names,
            stamp,
            0.0,
            OTHER_THREAD,
        )
        return Command(numbers, self.tables.robots, verdict)

    def solve_programs(self, programs: int) -> int:
        """Solve the programs of the robots whose bit is set, by way of Python.

        Between `begin_filtered_cycle` and `end_filtered_cycle`.

        Returns:
            Those of them for which that did not succeed.
        """
        response = self._response or self._prepare_filter()
        unsolved = 0
        for r, own in enumerate(self._parts_of_q):
            if not programs >> r & 1:
                continue
            first = r * ROWS
            last = first + response.notes[r, ROW_COUNT]
            found = None
            for limits in (response.limits, response.eased):
                if found is None and not response.notes[r, CROWDED]:
                    found = nearest_velocity(
                        response.target[own],
                        response.low[own],
                        response.high[own],
                        response.rows[first:last, own],
                        limits[first:last],
                    )
            if found is None:
                unsolved |= 1 << r
            else:
                response.target[own] = found
        return unsolved

    def _prepare_filter(self) -> Response:
        """Make what only filtered cycles need.

        Raises:
            SceneError: A robot's mode is "fixed".
        """
        for part in self.tables.robots:
            if part.mode == "fixed":
                raise SceneError(
                    f"robot '{part.name}' has the mode 'fixed', which predicts no "
                    "stops; to filter commands it needs 'path' or 'speed'"
                )
        self._lead = lead_of(self.tables)
        self._lead_ledger = Ledger(self._lead)
        self._escape = escape_of(self.tables)
        self._escape_ledger = Ledger(self._escape)
        response = response_of(
            self.tables, self._lead_ledger.lines, self._escape_ledger.lines
        )
        self._response_ledger = Ledger(response)
        self._response_lines = self._response_ledger.lines
        self._parts_of_q = tuple(
            slice(part.first_joint, part.first_joint + part.joint_count)
            for part in self.tables.robots
        )
        self._response = response
        kept = {
            **chosen("response", response._asdict()),
            **chosen("lead", self._lead._asdict()),
            **chosen("escape", self._escape._asdict()),
        }
        self._saving.add(kept, RESPONSE_BOUNDS, more_of(self.tables))
        return response

    def _check_robot(self, name: str | None) -> None:
        """Raise an error if no robot has that name.

        Raises:
            UnknownNameError: None has.
        """
        if name is not None and name not in self._input.robots:
            raise UnknownNameError(
                f"no robot is named '{name}'; {did_you_mean(name, self._input.robots)}"
            )

    def _is_vector(self, value: object) -> TypeGuard[Floats]:
        """Whether a value is the array a kernel takes."""
        return (
            type(value) is np.ndarray
            and value.dtype is FLOAT64
            and value.shape == self._input.shape
            and value.flags.carray
        )

    def _tool(self, name: str) -> Tool | None:
        """How a tool follows the joints of its robot; None if there is none."""
        if name not in self._tools:
            if name not in self._input.robots and name not in self.tables.links:
                return None
            self._tools[name] = tool_of(self.tables, name)
        return self._tools[name]


def try_out(scene: Scene) -> None:
    """Guard a scene for a cycle, for kernels to be compiled."""
    guard = Guard(scene, self_test=False, compiling=True)
    guard.step(guard.home, 0.0)
    if guard._guarded:
        guard.check_path([guard.home, guard.home])


def rows_of_twists(wanted: Sequence[tuple[Tool, Floats]]) -> Floats:
    """Twists of tools as a cycle takes them, one after another."""
    rows = np.zeros((len(wanted), TWIST_ROW))
    for row, (tool, twist) in zip(rows, wanted, strict=True):
        row[:TOOL_POINT] = tool.robot, tool.body
        row[TOOL_POINT:TOOL_TWIST] = tool.p_body
        row[TOOL_TWIST:] = twist
    return rows.reshape(-1)
