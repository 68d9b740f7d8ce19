"""The guard: joint positions in, a verdict out, every cycle."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from threading import get_ident
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import (
    HomeContactError,
    SceneError,
    UnknownNameError,
    did_you_mean,
)
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Shape
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard import layout
from armguard.guard.checkpoint import (
    TABLES_KEPT,
    CheckpointError,
    arrays_in,
    chosen,
    layout_of,
    pack,
    put_back,
    stand,
    unpack,
    whereabouts,
)
from armguard.guard.checkpoint_bounds import (
    BOUNDS,
    Greatest,
    Rules,
    check_about,
    check_bounds,
    check_contracts,
    check_poses,
    check_whereabouts,
    greatest_of,
)
from armguard.guard.continuous import RESOLUTION, PathCheck, check_path
from armguard.guard.contract import Contract, Region
from armguard.guard.cycle import run_cycle
from armguard.guard.given import NO_POSITIONS, CycleInput, real_or_none
from armguard.guard.grips import grips_of
from armguard.guard.guarded_cycle import run_guarded_cycle
from armguard.guard.holding import Holding, snapshot
from armguard.guard.levels import Level, Reason
from armguard.guard.memory import FORCE, KEPT_COUNT, MEMORY
from armguard.guard.objects import (
    Sighting,
    SightingError,
    check_sighting,
    frame_seen,
    load_kernels,
    reshaped,
    stand_at,
    take_out,
    transform_of,
    velocity_seen,
)
from armguard.guard.pace import Pace
from armguard.guard.planes import PLANE_COUNT
from armguard.guard.refine import MEMO_SIZE, MEMO_WIDTH
from armguard.guard.segment import run_segment
from armguard.guard.self_test import SelfTestLine, SelfTestReport, keep
from armguard.guard.self_test import self_test as run_self_test
from armguard.guard.verdict import (
    Names,
    NearPair,
    Verdict,
    first_row_of,
    names_of,
)
from armguard.guard.watch import (
    RUNNING,
    Watch,
    all_pairs,
    standing_needs,
    watch_of,
)
from armguard.guard.workspace import (
    BRUTE_FORCE,
    CONTRACTS,
    FIRST_ROW,
    GRIPS,
    INDEX_KIND,
    INTENTS,
    MOTION,
    MOVING_COUNT,
    OCTREE,
    PARTS,
    SELF,
    SETTINGS,
    WATCH,
    Workspace,
)
from armguard.guard.world_at_home import build_index, world_at_home
from armguard.kernel import check_cache
from armguard.motion import motion_of
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.standing import Standing
from armguard.scene.tables import SceneTables
from armguard.table import Ledger

# Near pairs an answer has room for. More than this many at once is a reason to stop
# (`Reason.CAPACITY`), not to count on.
NEAR_CAPACITY = 4096

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# In place of a thread: two of them were in a cycle at once.
SEVERAL = -1
OTHER_THREAD = "another thread is in a cycle of this guard; a guard is for one thread"

NOT_TESTED = SelfTestReport((SelfTestLine("SKIP", "nobody asked for it"),))

# What `reset` leaves as it is: what the scene says, and where objects were seen.
KEPT = (
    "pace",
    "model",
    "base",
    "top_speed",
    "seen_at",
    "object_velocity",
    "doubt",
    "object_stale",
    "robot_of",
    "movers",
    "pairs",
    "pair_need",
)


class Monitor:
    """Watches a scene: each `step` judges one joint configuration.

    Everything slow happens here, before the loop: the scene is compiled to tables,
    kernels are compiled or loaded, the home configuration is judged. `step` never
    raises: an input it cannot judge gives a verdict whose level is a stop.

    Attributes:
        tables: The compiled scene.
        index: The octree, or brute force; for pictures and statistics.
        home_verdict: Verdict of the home configuration.
        self_test: What the guard's test of itself came to.

    Args:
        scene: What to guard.
        budget: Spans of a stop path a cycle may test for all pairs together, at one to
            five microseconds each; when they are used up, the arms stop.
        self_test: Whether a synthetic robot is led through every level first; for
            scenes in which stops are predicted.
        progress: Called with one sentence before anything that takes long.
        clock: Clock in nanoseconds that measures `Verdict.cycle_time`; no decision
            depends on it.

    Raises:
        CacheError: The cache folder belongs to another user, or others may write to it.
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
        progress: Callable[[str], None] | None = None,
        clock: Callable[[], int] = perf_counter_ns,
    ) -> None:
        check_cache()
        self.tables: SceneTables = compile_scene(scene)
        self._memory = np.zeros(MEMORY, dtype=np.int64)
        self._pace = Pace(self.tables.period, self.tables.late)
        self._changed: set[str] = set()
        self._kept: dict[str, NDArray[Any]] = {}
        self._layout = b""
        self._clock = clock
        self._thread = 0
        self._budget = budget
        self._guarded = any(part.mode != "fixed" for part in self.tables.robots)
        self._compile_ahead(progress)
        self._prepare(self.tables)
        if self._guarded:
            # Compiles or loads the cycle; positions that are none change nothing.
            run_guarded_cycle(NO_POSITIONS, self._lines)
        load_kernels()
        self.home_verdict = self.judge_at_rest(self.tables.home)
        contacts = tuple(p for p in self.home_verdict.near if not p.distance >= 0.0)
        if contacts:
            raise HomeContactError(home_sentence(contacts), contacts)
        self.reset()
        self.self_test = run_self_test(self) if self_test else NOT_TESTED

    def _compile_ahead(self, progress: Callable[[str], None] | None) -> None:
        """Compile what the loop needs, if there is a quicker way than on the way."""

    @property
    def budget(self) -> int:
        """Spans of a stop path a cycle may test for all pairs together."""
        return self._budget

    @property
    def q_names(self) -> tuple[str, ...]:
        """'robot/joint' of each place of q."""
        return self.tables.q_names

    @property
    def names(self) -> Names:
        """What its verdicts read names from, for who keeps their numbers himself."""
        return self._names

    @property
    def poses(self) -> NDArray[np.float64]:
        """Poses of all bodies as they were judged last, shape (b, 12).

        The upper three rows of their transforms. The guard's own array: only to look.
        """
        return self._poses

    @property
    def home(self) -> NDArray[np.float64]:
        """Home configuration, a copy, shape (n,) [rad or m]."""
        return self.tables.home.copy()

    def q(self, positions: Mapping[str, float]) -> NDArray[np.float64]:
        """Joint vector from positions by name, shape (n,).

        Raises:
            UnknownNameError: A joint is missing, or nobody has that name.
        """
        for name in positions:
            if name not in self.q_names:
                near = did_you_mean(name, self.q_names)
                raise UnknownNameError(f"no joint is named '{name}'; {near}")
        missing = [name for name in self.q_names if name not in positions]
        if missing:
            raise UnknownNameError(
                "positions are missing for " + ", ".join(f"'{m}'" for m in missing)
            )
        return np.array([positions[name] for name in self.q_names], dtype=np.float64)

    def step(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float] | None = None,
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
    ) -> Verdict:
        """Judge the joint positions of a cycle. Never raises.

        A guard is for one thread at a time: a cycle that finds another one under way is
        a stop (`Reason.WRONG_INPUT`).

        Args:
            q: Joint positions in the order of `q_names`, shape (n,) [rad or m].
            stamp: When they were measured [s], for all robots or by robot name; on
                any clock, the same for all. Where every robot's mode is "fixed" it may
                be left out.
            velocity: Joint velocities that were measured with them, shape (n,)
                [rad/s or m/s]; if left out they are estimated from the stamps.
            now: Time of this cycle on the same clock [s]; if left out the newest
                stamp, and measurements count as late as they may be.

        Returns:
            The verdict; a snapshot that later cycles do not change.
        """
        start = self._clock()
        told: Any = stamp if now is None else now
        if type(told) is not float:
            told = real_or_none(told)
        thread = get_ident()
        if self._thread and self._thread != thread:
            return Verdict(self._crowded_answer(), self._names, told, 0.0, OTHER_THREAD)
        self._thread = thread
        try:
            if self._guarded:
                data, fault = self._judge(q, stamp, velocity, now)
                self._pace.note(data)
            else:
                fault = "" if stamp is None else self._input.judge_stamp(stamp)
                if fault:
                    data = self._fault_answer(Reason.TIME_BACKWARDS)
                else:
                    array, fault = self._input.positions(q)
                    if fault:
                        data = self._fault_answer(Reason.WRONG_INPUT)
                    else:
                        data = self._out[: run_cycle(array, self._lines)].copy()
        finally:
            alone = self._thread == thread
            self._thread = 0 if alone else self._leave_others()
        if not alone:
            data, fault = self._crowded_answer(), OTHER_THREAD
        elapsed = (self._clock() - start) * 1e-9
        return Verdict(data, self._names, told, elapsed, fault)

    def judge_at_rest(self, q: ArrayLike) -> Verdict:
        """Judge a configuration as if nothing moved in it. Never raises.

        For poses that are only thought of: whether each pair keeps its buffer there.
        What is remembered of the loop does not change, and no stop is ordered.

        Args:
            q: Joint positions in the order of `q_names`, shape (n,) [rad or m].
        """
        start = self._clock()
        array, fault = self._input.positions(q)
        if fault:
            data = self._fault_answer(Reason.WRONG_INPUT)
        else:
            swapped = self._detail()
            used = run_cycle(array, self._lines)
            data = self._out[:used].copy()
            self._coarsen(swapped)
        return Verdict(data, self._names, None, (self._clock() - start) * 1e-9, fault)

    def _judge(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float] | None,
        velocity: ArrayLike | None,
        now: float | None,
    ) -> tuple[NDArray[np.float64], str]:
        """The numbers of a cycle that predicts stops, and what was wrong in words."""
        array, fault = self._input.take(q, stamp, velocity, now)
        used = run_guarded_cycle(array, self._lines)
        data = self._out[:used].copy()
        if fault:
            data[layout.REASON] = Reason.WRONG_INPUT
            data[layout.JOINT] = -1.0
        return data, fault

    def place(
        self,
        name: str,
        pose: Pose | ArrayLike,
        stamp: float | None = None,
        *,
        velocity: ArrayLike | None = None,
        shape: Shape | None = None,
    ) -> None:
        """Put an object where it stands from now on, whether it was there or not.

        For between two cycles: it takes microseconds for each primitive of the object,
        and may take longer where the index has to grow.

        Args:
            name: An object of the scene that is attached to nothing.
            pose: Its frame in the world, a `Pose` or a transform of shape (4, 4).
            stamp: When it was seen there, on the clock of `step` [s]; needed for an
                object that has a `top_speed`, which may be elsewhere since.
            velocity: How fast it was seen to move, in the world, shape (3,) [m/s];
                robots that evade look where it is going.
            shape: Its shape from now on, of the kind it has: what was not foreseen can
                be kept out of by a box that the scene holds ready, not present. Only
                of an object that is one shape, no hull or mesh, and not graspable.

        Raises:
            UnknownNameError: There is no such object.
            PoseError: The transform is not rigid, or a number is not finite.
            SceneError: The object moves and there is no stamp, or it cannot have that
                shape.
            SightingError: An object with a `top_speed` was seen before it was seen
                last, elsewhere at the same time, farther away than it can be, with a
                velocity it cannot have, or nowhere (a pose that is none). It counts as
                where it was seen before, and every cycle is a stop that names it until
                a sighting is believed.
            GraspError: A gripper holds it.

        Example:
            >>> from armguard import Guard, Pose, Sphere, bay_scene
            >>> scene = bay_scene()
            >>> cart = scene.add(Sphere(radius=0.05), name="cart", present=False)
            >>> guard = Guard(scene)
            >>> guard.place("cart", Pose(xyz=(0.0, 0.0, 1.0)))
            >>> guard.remove("cart")
        """
        thing = self._standing(name)
        if shape is not None:
            thing = reshaped(name, thing, shape)
        speeds = self._watch.top_speed
        moves = len(speeds) > 0 and speeds[thing.first] > 0.0
        if not moves and velocity is not None:
            raise SceneError(
                f"object '{name}' has no top_speed; one that moves needs it"
            )
        if moves:
            T = self._take_sighting(name, thing, pose, stamp, velocity)
        else:
            T = transform_of(pose)
        if thing.body >= 0:
            self._holding.check_free(name)
            self._holding.put(name, T)
        stand_at(self.index, thing, T)
        self._standing_now[name] = thing
        self._changed.add(name)
        self._world_changed()

    def remove(self, name: str) -> None:
        """Leave an object out from now on; `place` brings it back.

        Raises:
            UnknownNameError: There is no such object.
            GraspError: A gripper holds it.
        """
        thing = self._standing(name)
        self._holding.check_free(name)
        take_out(self.index, thing)
        self._seen(thing, np.inf)
        if len(self._watch.doubt):
            self._watch.doubt[thing.places] = Reason.OK
            self._watch.sighted_at[thing.places] = -np.inf
        self._changed.add(name)
        self._world_changed()

    def grasp(self, robot: str, name: str) -> None:
        """Make an object part of a robot, now that its gripper has closed on it.

        One transaction between two cycles: the object rides on the gripper and is
        checked as the robot's links are. What it stands on it may touch until it has
        lifted clear, and where it is put down again. A second robot may grasp what the
        first one holds; it carries it from when the first one releases it.

        Args:
            robot: The robot.
            name: The object.

        Raises:
            UnknownNameError: There is no such robot or object.
            GraspError: The robot has no gripper, the object is not graspable, not
                there or held already, no finger touches it, or the gripper is too
                fast.
        """
        self._transact(lambda: self._holding.grasp(robot, name, self._lines))

    def release(self, robot: str, name: str) -> None:
        """Leave an object where it is, now that the robot's gripper has opened.

        One transaction: it stands free, or rides on the other robot that holds it, and
        every pair is checked again. What is nearer to it than it may be may leave.

        Args:
            robot: The robot.
            name: The object.

        Raises:
            UnknownNameError: There is no such robot or object.
            GraspError: The robot does not hold the object.
        """
        self._transact(lambda: self._holding.release(robot, name, self._lines))

    def allow(
        self,
        a: str,
        b: str,
        *,
        region: Region | None = None,
        depth: float = 0.002,
        speed: float = 0.02,
        until: float | None = None,
    ) -> None:
        """Allow two bodies to touch for a while: a contract.

        One that is in force between them is replaced.

        Args:
            a: 'robot/link' or an object, held or not.
            b: The other body.
            region: Where they may touch; anywhere if None.
            depth: How far they may overlap [m].
            speed: Greatest closing speed at contact [m/s].
            until: When it expires, on the clock of `step` [s]; 30 s from now if None.

        Raises:
            UnknownNameError: A body or the frame of the region does not exist.
            GraspError: It is one body, nobody checks the pair, a number cannot be true,
                or there is no room for another contract.
        """
        self._transact(
            lambda: self._holding.allow(
                a, b, depth=depth, speed=speed, until=until, region=region
            )
        )

    def swap_model(self, robot: str, model: str) -> None:
        """Choose the model of a robot's gripper, from the next cycle on.

        Args:
            robot: The robot.
            model: "coarse", one box; "detailed", the links' own primitives; "auto",
                the box while nothing is near.

        Raises:
            UnknownNameError: There is no such robot.
            GraspError: It has no gripper or no box, or there is no such model.
        """
        self._holding.swap_model(robot, model)

    @property
    def contracts(self) -> tuple[Contract, ...]:
        """Every allowance in force: what is held, and each contract."""
        return self._holding.contracts

    @property
    def held(self) -> Mapping[str, tuple[str, ...]]:
        """Robots that hold each object that is held; the first one carries it."""
        return {name: tuple(by) for name, by in self._holding.holders.items()}

    def check_path(
        self, rows: ArrayLike, *, resolution: float = RESOLUTION
    ) -> PathCheck:
        """Prove that a path of joint positions keeps every buffer, or find where not.

        Straight lines in joint space between the rows are bounded as a whole and
        halved where that does not suffice, so nothing can be missed between samples.
        What is remembered of the loop does not change; objects count as standing
        where they are.

        Args:
            rows: Joint positions in the order of `q_names`, shape (k, n) [rad or m].
            resolution: A line on which no joint moves more is not divided further
                [rad or m].

        Raises:
            SceneError: The rows have the wrong shape or are not finite.

        Example:
            >>> from armguard import Guard, bay_scene
            >>> guard = Guard(bay_scene())
            >>> guard.check_path([guard.home, guard.home]).clear
            True
        """
        array = np.atleast_2d(np.array(rows, dtype=np.float64))
        if array.shape[1:] != self._input.shape or not np.isfinite(array).all():
            raise SceneError(
                f"a path needs rows of {self._input.shape[0]} finite positions, not an "
                f"array of shape {array.shape}"
            )
        return check_path(array, self._judge_line, self.judge_at_rest, resolution)

    def _judge_line(self, start: Floats, end: Floats) -> Verdict:
        """Verdict on a straight line of joint positions as a whole."""
        swapped = self._detail()
        used = run_segment(
            np.ascontiguousarray(start), np.ascontiguousarray(end), self._lines
        )
        self._coarsen(swapped)
        return Verdict(self._out[:used].copy(), self._names, None, 0.0)

    def reset(self) -> None:
        """Forget the last cycle, the last stamps, ordered stops and broken figures.

        Robots count as at rest. What is held is held, and contracts somebody asked for
        stay in force; those by intent are over. Where every mode is "fixed" the next
        verdict is the same either way; only the work is done anew.
        """
        self._memory[FORCE] = 1
        self._input.last_stamp = -np.inf
        for name, fresh in watch_of(self.tables)._asdict().items():
            if name not in KEPT:
                getattr(self._watch, name)[:] = fresh
        self._motion.v_low[:] = self._motion.v_high[:] = 0.0
        self._motion.clock.fill(0.0)
        if len(self.tables.holds.grippers):
            self._holding.forget()
            self._world_changed()

    def checkpoint(self) -> bytes:
        """All that is remembered, for `restore`.

        For between two cycles. The next cycle measures everything anew, here as there.
        """
        self._memory[FORCE], self._memory[KEPT_COUNT] = 1, 0
        remembered, layout = self._remembered()
        changed = sorted(self._changed)
        about = {
            "last_stamp": float(self._input.last_stamp),
            "changed": changed,
            "holders": self._holding.holders,
        }
        where = whereabouts(self.index, self._places_of(changed))
        return pack(layout, about, {**remembered, **where})

    def restore(self, data: bytes) -> None:
        """Go on from a checkpoint of another guard of the same scene.

        For between two cycles; it takes some milliseconds. From here on the same inputs
        give the same bits as they do there.

        Args:
            data: What `checkpoint` gave.

        Raises:
            CheckpointError: It is none, it is damaged, or it was made of another scene
                or by another version; nothing has changed.
        """
        remembered, own = self._remembered()
        layout, about, numbers = unpack(data)
        if layout != own:
            raise CheckpointError(
                "this checkpoint was made of another scene, of other modes or by "
                "another version; a guard of the very same scene can take it over"
            )
        last_stamp, changed, holders = check_about(about, self.tables)
        places = self._places_of(changed)
        where = whereabouts(self.index, places)
        found = arrays_in(numbers, {**remembered, **where})
        known = {**remembered, **self._holding.as_held(holders)}
        rules, greatest = self._bounds()
        check_bounds(found, known, rules, greatest)
        check_poses("workspace.T_world", found["workspace.T_world"])
        check_poses("tables.T_parent_joint", found["tables.T_parent_joint"])
        check_contracts(found["grips.contracts"], self.tables)
        check_whereabouts(found, places, holders, self.index, self.tables)
        for name, array in remembered.items():
            array[...] = found[name]
        self._input.last_stamp = last_stamp
        self._holding.holders.clear()
        self._holding.holders.update(holders)
        for name in self._changed.difference(changed):
            put_back(self.index, self.tables.standing[name], self.tables.local_rows)
        self._changed = set(changed)
        stand(self.index, places, **{name: found[name] for name in where})
        self._take_over_tables()
        self._memory[KEPT_COUNT] = 0

    def take_over(self, other: "Monitor") -> None:
        """Remember what another guard remembers; where objects are is no part of it.

        For asking what this guard would say in that one's place, cycle by cycle. They
        may differ in settings, not in what is in their scenes.

        Raises:
            CheckpointError: They differ in more than that.
        """
        own, layout = self._remembered()
        theirs, their_layout = other._remembered()
        if layout != their_layout:
            raise CheckpointError(
                "two guards remember different things: their scenes differ in more "
                "than settings, or in modes"
            )
        swaps = len(self.tables.holds.grippers) > 0
        if swaps:
            self._holding.show_detailed()
        for name, array in own.items():
            array[...] = theirs[name]
        if swaps:
            self._holding.show_those_coarse()
            self._world_changed()
        self._input.last_stamp = other._input.last_stamp

    def stand_as(self, other: "Monitor") -> None:
        """Put all objects where they are for another guard, or leave them out."""
        changed = {**dict.fromkeys(self._changed), **dict.fromkeys(other._changed)}
        self._changed = set(changed)
        places = self._places_of(changed)
        stand(self.index, places, **whereabouts(other.index, places))
        self._watch.seen_at[:] = other._watch.seen_at
        self._watch.object_velocity[:] = other._watch.object_velocity
        self._watch.doubt[:] = other._watch.doubt
        self._watch.sighted_at[:] = other._watch.sighted_at
        self._take_over_tables()

    def set_aside(self) -> AbstractContextManager[None]:
        """Leave everything as it is, whatever is asked within; for the self-test."""
        return keep(self._watch, self._grips, self._settings, self.reset)

    def forget_stops(self) -> None:
        """Let robots that were stopped go on, as if nobody had been told to stop.

        For a guard that is asked about a motion that does not obey it.
        """
        self._watch.phase.fill(RUNNING)
        self._watch.must.fill(0)

    def _remembered(self) -> tuple[dict[str, NDArray[Any]], bytes]:
        """Arrays that a checkpoint keeps, by name, and the digest of their layout."""
        if not self._kept:
            self._kept = self._arrays_kept()
            things = self.tables.standing.items()
            self._layout = layout_of(
                self._kept,
                [*self.q_names, *self._input.robots, len(self.tables.kinds)],
                [[name, thing.first, thing.count] for name, thing in things],
            )
        return self._kept, self._layout

    def _bounds(self) -> tuple[Rules, Greatest]:
        """What whole numbers of a checkpoint may be, and the greatest places."""
        return BOUNDS, greatest_of(self.tables)

    def _arrays_kept(self) -> dict[str, NDArray[Any]]:
        """The same, gathered from all ledgers."""
        tables = {name: getattr(self.tables, name) for name in TABLES_KEPT}
        return {
            **chosen("tables", tables),
            **chosen("watch", self._watch._asdict()),
            **chosen("motion", self._motion._asdict()),
            **chosen("grips", self._grips._asdict()),
            **chosen("workspace", self._workspace._asdict()),
        }

    def _places_of(self, changed: Iterable[str]) -> NDArray[np.int64]:
        """What a robot moves, and the primitives of some objects, shape (k,)."""
        things = [self.tables.standing[name] for name in changed]
        return np.concatenate(
            [
                np.arange(self.tables.moving_count),
                *(np.arange(t.first, t.first + t.count) for t in things if t.body < 0),
            ]
        )

    def _prepare(self, tables: SceneTables) -> None:
        """Allocate everything the loop will ever need."""
        count, bodies = len(tables.kinds), len(tables.parent)
        capacity = max(1, min(tables.checkable_pairs, NEAR_CAPACITY))
        T_world = np.zeros((bodies, 12))
        world = world_at_home(tables, T_world)
        self._poses = T_world
        self.index = build_index(tables, world)
        self._standing_now = dict(tables.standing)
        for thing in tables.standing.values():
            if not thing.present:
                take_out(self.index, thing)
        self._memory[FORCE] = 1
        first_row = first_row_of(tables)
        self._out = np.zeros(first_row + capacity * layout.NEAR_WIDTH)
        self._watch = watch_of(tables)
        self._input = CycleInput(self._watch, (part.name for part in tables.robots))
        for thing in tables.standing.values():
            if not thing.present:
                self._seen(thing, np.inf)
        self._settings = settings = np.zeros(SETTINGS, dtype=np.int32)
        settings[FIRST_ROW] = first_row
        self._motion = motion_of(tables, self._budget)
        self._parts = Ledger(self._motion), Ledger(self._watch)
        self._addresses = np.zeros(PARTS, dtype=np.int64)
        for k, ledger in zip((MOTION, WATCH), self._parts, strict=True):
            self._addresses[k] = ledger.lines.ctypes.data
        self._grips = grips_of(tables)
        self._grips_ledger = Ledger(self._grips)
        self._addresses[GRIPS] = self._grips_ledger.lines.ctypes.data
        self._holding = Holding(
            tables, self._watch, self._motion, self.index, T_world, self._grips
        )
        self._holding.show_detailed()
        self._expect_contracts()
        settings[MOVING_COUNT] = tables.moving_count
        brute_force = tables.index.kind == "brute_force"
        settings[INDEX_KIND] = BRUTE_FORCE if brute_force else OCTREE
        workspace = Workspace(
            lower=tables.lower,
            upper=tables.upper,
            parent=tables.parent,
            joint_kind=tables.joint_kind,
            q_index=tables.q_index,
            gain=tables.gain,
            T_parent_joint=tables.T_parent_joint,
            axis=tables.axis,
            bodies=tables.bodies,
            local_rows=tables.local_rows,
            groups=tables.groups,
            checked=tables.checked,
            buffers=tables.buffers,
            margin=np.array([tables.margin]),
            settings=settings,
            T_next=np.zeros((bodies, 12)),
            T_world=T_world,
            body_moved=np.zeros(bodies, dtype=np.uint8),
            moved=np.zeros(count, dtype=np.uint8),
            candidates=np.zeros(count, dtype=np.int32),
            seen=np.zeros(count, dtype=np.int64),
            kept=np.zeros((capacity, layout.NEAR_WIDTH)),
            memory=self._memory,
            out=self._out,
            exact_of=tables.exact.of_primitive,
            exact_kinds=tables.exact.kinds,
            exact_rows=tables.exact.rows,
            memo=np.zeros((MEMO_SIZE, MEMO_WIDTH), dtype=np.int64),
            memo_rows=np.zeros((MEMO_SIZE, WITNESS_WIDTH)),
            planes=np.zeros(PLANE_COUNT, dtype=np.int64),
            normals=np.zeros((PLANE_COUNT, 3)),
            look=np.array([largest_standing_need(tables, self._watch)]),
            look_box=np.zeros(6),
            parts=self._addresses,
            world=world,
            octree=self.index.state,
        )
        self._open_ledger(workspace)
        self._holding.warm_up(self._lines)
        self._names = names_of(snapshot(tables), self._watch.disproved)

    def _expect_contracts(self) -> None:
        """Have the loop look at contracts where there may be any, and only there."""
        may_be = len(self._grips.grippers) > 0 or self._grips.may.any()
        self._settings[CONTRACTS] = self._settings[INTENTS] = may_be

    def _transact(self, change: Callable[[], None]) -> None:
        """Change who holds or may touch what, all at once.

        Raises:
            ArmguardError: Whatever the change raises; then nothing has changed.
        """
        swapped = self._detail()
        try:
            change()
        finally:
            self._coarsen(swapped)
        self._take_over_tables()

    def _take_over_tables(self) -> None:
        """Judge by tables in which who rides on whom, or may touch whom, is new."""
        tables = self.tables
        pairs = all_pairs(tables)
        watch = self._watch
        needs = standing_needs(pairs, watch.model, watch.base, tables)
        self._watch = watch._replace(pairs=pairs, pair_need=needs)
        self._holding.watch = self._watch
        for name, table in (("pairs", pairs), ("pair_need", needs)):
            self._parts[1].put(Watch._fields.index(name), table)
        self._workspace.look[0] = largest_standing_need(tables, self._watch)
        self._names = replace(self._names, tables=snapshot(tables))
        self._expect_contracts()
        self._world_changed()

    def _detail(self) -> list[int]:
        """Let its links' own primitives stand for every gripper, outside of the loop.

        Returns:
            Grippers whose box stood for them.
        """
        if not len(self.tables.holds.grippers):
            return []
        swapped = self._holding.show_detailed()
        if swapped:
            self._world_changed()
        return swapped

    def _coarsen(self, grippers: Sequence[int]) -> None:
        """Let their boxes stand for grippers again."""
        for g in grippers:
            self._holding.show_coarse(g)
        if grippers:
            self._world_changed()

    def _seen(self, thing: Standing, stamp: float) -> None:
        """Note when an object was seen; infinite for one that is not there."""
        if len(self._watch.seen_at):
            self._watch.seen_at[thing.places] = stamp

    def _take_sighting(
        self,
        name: str,
        thing: Standing,
        pose: Pose | ArrayLike,
        stamp: float | None,
        velocity: ArrayLike | None,
    ) -> Floats:
        """Take over when an object was seen to be where; its frame, shape (4, 4).

        Raises:
            SceneError: There is no stamp.
            SightingError: It cannot be true; the object is in doubt.
        """
        watch, world = self._watch, self.index.world
        if stamp is None:
            raise SceneError(f"object '{name}' moves: say when it was seen")
        top = float(watch.top_speed[thing.first])
        kinds = world.kinds[thing.places]
        before = Sighting(
            float(watch.sighted_at[thing.first]), world.rows[thing.places]
        )
        try:
            T = frame_seen(name, pose)
            speeds = velocity_seen(name, velocity, top)
            now = Sighting(stamp, thing.rows(T))
            check_sighting(name, thing, kinds, before, now, top)
        except SightingError as error:
            watch.doubt[thing.places] = Reason[error.reason]
            raise
        watch.object_velocity[thing.places] = speeds
        watch.sighted_at[thing.places] = stamp
        watch.doubt[thing.places] = Reason.OK
        # It may be off by `error`: as if it had gone that far since it was seen.
        self._seen(thing, stamp - thing.error / top)
        return T

    def _standing(self, name: str) -> Standing:
        """The object of that name that is attached to nothing."""
        known = self._standing_now
        if name not in known:
            raise UnknownNameError(
                f"no object that stands still is named '{name}'; "
                f"{did_you_mean(name, known)}"
            )
        return known[name]

    def _world_changed(self) -> None:
        """Take over an index that was built anew; measure every pair afresh."""
        if self._workspace.octree is not self.index.state:
            self._open_ledger(self._workspace._replace(octree=self.index.state))
        self._memory[FORCE] = 1

    def _open_ledger(self, workspace: Workspace) -> None:
        """Tell the loop where everything lies."""
        self._workspace = workspace
        self._ledger = Ledger(workspace)
        self._lines = self._ledger.lines
        self._addresses[SELF] = self._lines.ctypes.data

    def _fault_answer(self, reason: Reason) -> NDArray[np.float64]:
        """An answer without near pairs: the configuration was not judged."""
        data = np.zeros(layout.HEADER)
        data[layout.REASON] = reason
        data[[layout.JOINT, layout.NEAREST, layout.ROBOT]] = -1.0
        return data

    def _leave_others(self) -> int:
        """What marks the guard when a cycle ends that was not alone in it."""
        return 0 if self._thread == SEVERAL else SEVERAL

    def _crowded_answer(self) -> NDArray[np.float64]:
        """The numbers of a cycle that another thread is in the way of: all stop."""
        data = np.zeros(self._names.first_row)
        data[layout.REASON] = Reason.WRONG_INPUT
        data[[layout.JOINT, layout.NEAREST, layout.ROBOT]] = -1.0
        for r in range(len(self._names.robots)):
            row = data[layout.HEADER + r * layout.ROBOT_WIDTH :]
            row[layout.ROBOT_LEVEL] = Level.STOP
            row[layout.ROBOT_CAUSE] = Reason.WRONG_INPUT
            row[[layout.ROBOT_AGE, layout.ROBOT_TIME]] = np.inf
        return data


def largest_standing_need(tables: SceneTables, watch: Watch) -> float:
    """More than any pair must keep for other reasons than motion [m]."""
    errors = watch.model + watch.base
    return float(tables.buffers.max(initial=0.0) + 2.0 * errors.max(initial=0.0))


def home_sentence(contacts: Sequence[NearPair]) -> str:
    """What overlaps at home, and what to do about it."""
    pairs = "; ".join(
        f"{c.a} and {c.b} by {-c.distance * 1e3:.1f} mm" for c in contacts[:8]
    )
    more = f" and {len(contacts) - 8} more" if len(contacts) > 8 else ""
    return (
        f"at the home configuration these overlap: {pairs}{more}; give another "
        "`home`, fit the links more closely (fit_target), or allow the pair with a "
        "reason"
    )
