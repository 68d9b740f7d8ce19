"""The guard in the loop: what operators want goes in, what is safe comes out."""

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter_ns

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.guard import layout
from armguard.guard.filtered_cycle import close_cycle, open_cycle
from armguard.guard.levels import Reason
from armguard.guard.monitor import Monitor
from armguard.guard.verdict import Verdict
from armguard.guard.watch import FORCED, RECOVERING, RESTING, RUNNING
from armguard.motion.figures import DECELERATION, POSITION_ERROR
from armguard.respond.asked import as_vector, named_vector, velocity_towards
from armguard.respond.command import ACTIONS, Action, Blocked, Command
from armguard.respond.engagement import Engagement
from armguard.respond.programs import Programs
from armguard.respond.responses import RESPONSES
from armguard.respond.tool import Tool, joint_velocity, tool_of
from armguard.scene.scene import Scene

Floats = NDArray[np.float64]

# Below this no joint counts as asked to move [rad/s or m/s].
NOTHING_ASKED = 1e-6

# How far what was sent may lead the measured positions before it is drawn back [s].
LEAD_TIME = 0.1


class Guard(Monitor):
    """Watches a scene, and keeps what is told to its robots safe.

    Each `step` judges one joint configuration, and somebody else obeys the verdict.
    Each `filter` does the same and gives back what to tell the robots: what their
    operators ask for where that is proven, else something near it that is, else a stop.

    Args:
        scene: What to guard.
        budget: See `Monitor`, from here to `clock`. A filtered cycle judges up to five
            times and may use it as often.
        self_test: Whether to test itself.
        compiling: Set where kernels are compiled ahead.
        progress: Told before anything that takes long.
        clock: Clock in nanoseconds.

    Raises:
        SceneError: The scene contradicts itself.
        HomeContactError: Checked bodies overlap at the home configuration.
        SelfTestError: A level, a stop or a refusal did not come when it should have.

    Example:
        >>> from armguard import Guard, bay_scene
        >>> guard = Guard(bay_scene())
        >>> guard.step(guard.home).level
        <Level.CLEAR: 0>
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
        self._programs: Programs | None = None
        super().__init__(
            scene,
            budget=budget,
            self_test=self_test,
            compiling=compiling,
            progress=progress,
            clock=clock,
        )
        parts = self.tables.robots
        self._engagements = tuple(Engagement(part.response) for part in parts)
        self._responses = tuple(RESPONSES[part.response.kind] for part in parts)
        self._gives_way = np.array(
            [r.gives_way for r in self._responses], dtype=np.int64
        )
        self._recover = np.zeros(len(parts), dtype=np.int64)
        self._held = self.tables.home.copy()
        self._tools: dict[str, Tool] = {}

    def filter(
        self,
        q: ArrayLike,
        v_desired: ArrayLike | Mapping[str, float],
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
    ) -> Command:
        """What to tell the robots whose operators want these velocities. Never raises.

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
            SceneError: The scene has a robot whose mode is "fixed"; before the first
                cycle.
        """
        names = self.q_names
        if isinstance(v_desired, Mapping):
            asked, fault = named_vector("v_desired", v_desired, names)
        else:
            asked, fault = as_vector("v_desired", v_desired, len(names))
        return self._filter(q, stamp, velocity, now, lambda: (asked, None), fault)

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
        wanted, fault = as_vector("q_desired", q_desired, len(self.q_names))
        deceleration = self._motion.joint_figures[:, DECELERATION]

        def ask() -> tuple[Floats | None, Floats | None]:
            if wanted is None:
                return None, None
            period = self.tables.period
            return velocity_towards(wanted, self._held, deceleration, period), wanted

        return self._filter(q, stamp, velocity, now, ask, fault)

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
                shape (6,) [m/s], [rad/s]. A robot that is not named is asked for nothing.
            stamp: See `filter`, from here to `now`.
            velocity: Measured velocities.
            now: Time of this cycle.

        Raises:
            SceneError: See `filter`.
        """
        wanted: list[tuple[Tool, Floats]] = []
        fault = ""
        for name, twist in twists.items():
            tool = self._tool(name)
            if tool is None:
                known = (*self._robot_places, *self.tables.links)
                near = did_you_mean(str(name), known)
                fault = fault or f"there is a twist for '{name}', no tool; {near}"
                continue
            vector, wrong = as_vector(f"twist of '{name}'", twist, 6)
            fault = fault or wrong
            if vector is not None:
                wanted.append((tool, vector))

        def ask() -> tuple[Floats | None, Floats | None]:
            return self._for_tools(wanted), None

        return self._filter(q, stamp, velocity, now, ask, fault)

    def engage(self, name: str | None = None) -> None:
        """Give a robot back to its operator after a stop, or all of them.

        Raises:
            UnknownNameError: There is no such robot.
        """
        if name is not None and name not in self._robot_places:
            raise UnknownNameError(
                f"no robot is named '{name}'; {did_you_mean(name, self._robot_places)}"
            )
        for part, engagement in zip(self.tables.robots, self._engagements, strict=True):
            if name in (None, part.name):
                engagement.engage()

    def reset(self) -> None:
        """See `Monitor.reset`; nothing that was told or held is remembered either."""
        super().reset()
        if self._programs is not None:
            for engagement in self._engagements:
                engagement.reset()

    def _filter(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float],
        velocity: ArrayLike | None,
        now: float | None,
        ask: Callable[[], tuple[Floats | None, Floats | None]],
        refused: str,
    ) -> Command:
        """One cycle: judge, ask, respond, prove, tell."""
        start = self._clock()
        programs = self._programs or self._prepare_filter()
        watch = self._watch
        fault = self._take_times(stamp, now) or self._take_velocity(velocity)
        array = self._nowhere
        if not fault:
            array, fault = self._as_positions(q)
        if fault:
            array = self._nowhere
        judged = open_cycle(array, self._lines)
        self._recover.fill(0)
        asked: Floats | None = None
        far: Floats | None = None
        if judged:
            if not watch.sent_count[0]:
                self._held[:] = array
            asked, wanted = ask()
            if wanted is not None:
                far = np.abs(wanted - self._held)
            if asked is None:
                watch.last[FORCED] = Reason.WRONG_COMMAND
                programs.asked.fill(0.0)
            else:
                programs.asked[:] = asked
            if refused:
                watch.last[FORCED] = Reason.WRONG_COMMAND
            self._respond(programs, far)
        used = close_cycle(judged, self._recover, self._gives_way, self._lines)
        data = self._out[:used].copy()
        if fault:
            data[layout.REASON] = Reason.WRONG_INPUT
            data[layout.JOINT] = -1.0
        told = stamp if now is None else now
        if isinstance(told, Mapping):
            told = None
        velocities = watch.wanted.copy()
        self._hold(array, judged, velocities)
        elapsed = (self._clock() - start) * 1e-9
        verdict = Verdict(data, self._names, told, elapsed, fault or refused)
        return self._command(velocities, asked, far, verdict)

    def _respond(self, programs: Programs, far: Floats | None) -> None:
        """Turn what is asked for into what is to be proven."""
        watch = self._watch
        for r, (part, engagement) in enumerate(
            zip(programs.parts, self._engagements, strict=True)
        ):
            phase = int(watch.phase[r])
            stuck = phase == RESTING and watch.must[r] != 0
            resting = bool((np.abs(programs.asked[part]) <= NOTHING_ASKED).all())
            distance = None if far is None else float(far[part].max())
            engagement.look(phase, stuck, resting, distance)
            leaves = stuck or phase == RECOVERING
            # Who rests too near may leave: that he asks for it is sign enough.
            follows = leaves or (phase == RUNNING and engagement.follows)
            programs.set_robot(
                r,
                follows=follows,
                speed_share=engagement.speed_share(leaves),
                retreats=leaves,
            )
        programs.frame()
        for r, (part, response) in enumerate(
            zip(programs.parts, self._responses, strict=True)
        ):
            if programs.breaks(r) and not response.change(programs, r):
                self._engagements[r].blocked = Blocked.NO_WAY
                programs.target[part] = programs.brake[part]
                watch.last[FORCED] = Reason.NO_WAY
            own = programs.target[part]
            if watch.phase[r] == RESTING and watch.must[r] != 0:
                moves = bool((np.abs(own) > NOTHING_ASKED).any())
                self._recover[r] = moves
                pinched = not (programs.low[part] < 0.0).any()
                pinched &= not (programs.high[part] > 0.0).any()
                if pinched:
                    self._engagements[r].blocked = Blocked.PINCHED
        watch.wanted[:] = programs.target

    def _command(
        self,
        velocities: Floats,
        asked: Floats | None,
        far: Floats | None,
        verdict: Verdict,
    ) -> Command:
        """What the robots are told, with who is told what and why."""
        actions, blocked, passed = {}, {}, {}
        levels = verdict.levels
        for part, own, engagement in zip(
            self.tables.robots, self._parts_of_q, self._engagements, strict=True
        ):
            name = part.name
            actions[name] = ACTIONS.get(levels[name], Action.FOLLOW)
            blocked[name] = engagement.blocked
            passed[name] = share_passed(velocities[own], asked, own)
        far_joints: tuple[str, ...] = ()
        if far is not None:
            limits = self._far_limits
            far_joints = tuple(
                name
                for name, way, limit in zip(self.q_names, far, limits, strict=True)
                if way > limit
            )
        return Command(
            velocities, self._held.copy(), actions, blocked, far_joints, passed, verdict
        )

    def _prepare_filter(self) -> Programs:
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
        self._programs = Programs(self.tables.robots, self._lines)
        self._parts_of_q = self._programs.parts
        self._far_limits = np.concatenate(
            [
                np.full(part.joint_count, part.response.far)
                for part in self.tables.robots
            ]
        )
        return self._programs

    def _hold(self, array: Floats, judged: bool, velocities: Floats) -> None:
        """Sum up where the joints were told to be; never far from where they are."""
        held, period = self._held, self.tables.period
        held += velocities * period
        if judged:
            speed = np.maximum(np.abs(velocities), np.abs(self._motion.v_high))
            room = (
                LEAD_TIME * speed + self._motion.joint_figures[:, POSITION_ERROR] + 1e-6
            )
            np.clip(held, array - room, array + room, out=held)

    def _for_tools(self, wanted: Sequence[tuple[Tool, Floats]]) -> Floats:
        """Velocities of all joints for twists of tools, shape (n,)."""
        asked = np.zeros(len(self.q_names))
        T_world = self._workspace.T_world
        for part in self._parts_of_q:
            own = [(t, twist) for t, twist in wanted if t.own == part]
            if own:
                J = np.concatenate([tool.jacobian(T_world) for tool, _ in own])
                twists = np.concatenate([twist for _, twist in own])
                asked[part] = joint_velocity(J, twists)
        return asked

    def _tool(self, name: str) -> Tool | None:
        """How a tool follows the joints of its robot; None if there is none."""
        if name not in self._tools:
            if name not in self._robot_places and name not in self.tables.links:
                return None
            self._tools[name] = tool_of(self.tables, name)
        return self._tools[name]


def share_passed(told: Floats, asked: Floats | None, own: slice) -> float:
    """How much of what was asked for was told: along it, in [0, 1]."""
    if asked is None:
        return 0.0
    wish = asked[own]
    size = float(wish @ wish)
    if size == 0.0:
        return 1.0
    return min(max(float(told @ wish) / size, 0.0), 1.0)
