"""The guard: joint positions in, a verdict out, every cycle."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from threading import get_ident
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.guard import layout
from armguard.guard.answer import Names, stop_answer
from armguard.guard.continuous import RESOLUTION, PathCheck, check_path
from armguard.guard.contract import Contract, ContractTable
from armguard.guard.cycle import run_cycle
from armguard.guard.given import NO_POSITIONS, real_or_none
from armguard.guard.grippers import Grippers
from armguard.guard.guarded_cycle import run_guarded_cycle
from armguard.guard.holding import Holding
from armguard.guard.levels import Reason
from armguard.guard.loop import Loop
from armguard.guard.memory import FORCE
from armguard.guard.objects import Objects, load_kernels
from armguard.guard.pace import Pace
from armguard.guard.parts import delegated
from armguard.guard.saving import Saving
from armguard.guard.segment import run_segment
from armguard.guard.self_test import NOT_TESTED, check_home, keep
from armguard.guard.self_test import self_test as run_self_test
from armguard.guard.verdict import Verdict
from armguard.guard.watch import RUNNING, watch_of
from armguard.kernel import check_cache
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene

Floats = NDArray[np.float64]

# In place of a thread: two of them were in a cycle at once.
SEVERAL = -1
OTHER_THREAD = "another thread is in a cycle of this guard; a guard is for one thread"

# What `reset` leaves as it is: what the scene says, and where objects were seen.
KEPT = (
    "pace model base top_speed seen_at object_velocity doubt object_stale robot_of "
    "movers pairs pair_need"
).split()


class Monitor(Loop):
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
        tables = compile_scene(scene)
        self._pace = Pace(tables.period, tables.late)
        self._clock = clock
        self._thread = 0
        self._guarded = any(part.mode != "fixed" for part in tables.robots)
        self._compile_ahead(progress)
        super().__init__(tables, budget)
        if self._guarded:
            # Compiles or loads the cycle; positions that are none change nothing.
            run_guarded_cycle(NO_POSITIONS, self._lines)
        load_kernels()
        self.home_verdict = self.judge_at_rest(self.tables.home)
        check_home(self.home_verdict)
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
        time: Any = stamp if now is None else now
        if type(time) is not float:
            time = real_or_none(time)
        thread = get_ident()
        if self._thread and self._thread != thread:
            return Verdict(
                stop_answer(self._names, Reason.WRONG_INPUT),
                self._names,
                time,
                0.0,
                OTHER_THREAD,
            )
        self._thread = thread
        try:
            if self._guarded:
                data, fault = self._judge(q, stamp, velocity, now)
                self._pace.note(data)
            else:
                fault = "" if stamp is None else self._input.judge_stamp(stamp)
                if fault:
                    data = stop_answer(self._names, Reason.TIME_BACKWARDS)
                else:
                    array, fault = self._input.positions(q)
                    if fault:
                        data = stop_answer(self._names, Reason.WRONG_INPUT)
                    else:
                        data = self._out[: run_cycle(array, self._lines)].copy()
        finally:
            alone = self._thread == thread
            self._thread = 0 if alone else self._leave_others()
        if not alone:
            data, fault = stop_answer(self._names, Reason.WRONG_INPUT), OTHER_THREAD
        elapsed = (self._clock() - start) * 1e-9
        return Verdict(data, self._names, time, elapsed, fault)

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
            data = stop_answer(self._names, Reason.WRONG_INPUT)
        else:
            with self._grippers.detailed():
                used = run_cycle(array, self._lines)
                data = self._out[:used].copy()
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

    place = delegated("_objects", Objects.place)
    remove = delegated("_objects", Objects.remove)
    grasp = delegated("_holding", Holding.grasp)
    release = delegated("_holding", Holding.release)
    allow = delegated("_contracts", ContractTable.allow)
    swap_model = delegated("_grippers", Grippers.swap_model)
    checkpoint = delegated("_saving", Saving.checkpoint)
    restore = delegated("_saving", Saving.restore)

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
        with self._grippers.detailed():
            used = run_segment(
                np.ascontiguousarray(start), np.ascontiguousarray(end), self._lines
            )
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

    def take_over(self, other: "Monitor") -> None:
        """Remember what another guard remembers; where objects are is no part of it.

        For asking what this guard would say in that one's place, cycle by cycle. They
        may differ in settings, not in what is in their scenes.

        Raises:
            CheckpointError: They differ in more than that.
        """
        self._saving.take_over(other._saving)

    def stand_as(self, other: "Monitor") -> None:
        """Put all objects where they are for another guard, or leave them out."""
        self._saving.stand_as(other._saving)

    def _set_aside(self) -> AbstractContextManager[None]:
        """Leave everything as it is, whatever is asked within; for the self-test."""
        return keep(self._watch, self._grips, self._settings, self.reset)

    def forget_stops(self) -> None:
        """Let robots that were stopped go on, as if no stop had been ordered.

        For a guard that is asked about a motion that does not obey it.
        """
        self._watch.phase.fill(RUNNING)
        self._watch.must.fill(0)

    def _leave_others(self) -> int:
        """What marks the guard when a cycle ends that was not alone in it."""
        return 0 if self._thread == SEVERAL else SEVERAL
