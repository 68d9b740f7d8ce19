"""The guard: joint positions in, a verdict out, every cycle."""

from collections.abc import Callable, Mapping
from time import perf_counter_ns

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.guard.answer import Names
from armguard.guard.clusters import ClusterTable
from armguard.guard.continuous import RESOLUTION, PathCheck, check_path
from armguard.guard.contract import Contract, ContractTable
from armguard.guard.given import NO_POSITIONS
from armguard.guard.grippers import Grippers
from armguard.guard.guarded_cycle import run_guarded_cycle
from armguard.guard.holding import Holding
from armguard.guard.look_ahead import Announced, LookAhead
from armguard.guard.loop import Loop
from armguard.guard.objects import Objects, load_kernels
from armguard.guard.parts import delegated
from armguard.guard.proven_lines import ProvenLines
from armguard.guard.saving import Saving
from armguard.guard.segment import run_segment
from armguard.guard.self_test import NOT_TESTED, check_home
from armguard.guard.self_test import self_test as run_self_test
from armguard.guard.sensed_space import SensedSpace
from armguard.guard.verdict import Verdict
from armguard.guard.watch import RUNNING
from armguard.kernel import check_cache
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene

Floats = NDArray[np.float64]


class Monitor(Loop):
    """Monitors a scene: each `step` judges one joint configuration.

    All slow work is done at construction, before the loop: the scene is compiled to
    tables, kernels are compiled or loaded, the home configuration is judged. `step`
    never raises: an input it cannot judge gives a verdict whose level is a stop.

    Attributes:
        tables: The compiled scene.
        index: The octree, or brute force; for pictures and statistics.
        home_verdict: Verdict of the home configuration.
        self_test: Report of the self-test.

    Args:
        scene: The scene to monitor.
        budget: Spans of a stop path that a cycle may test for all pairs together, at
            one to five microseconds each; when they are used up, the arms stop.
        self_test: Whether a simulated robot is led through every level first; for
            scenes in which stops are predicted.
        progress: Called with one sentence before each slow step.
        clock: Clock in nanoseconds that measures `Verdict.cycle_time`; no decision
            depends on it.

    Raises:
        CacheError: The cache folder belongs to another user, or others may write to it.
        SceneError: The scene contradicts itself.
        HomeContactError: Checked bodies overlap at the home configuration.
        SelfTestError: A level, a stop or a refusal was missing in the self-test.

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
        self._guarded = any(part.mode != "fixed" for part in tables.robots)
        self._compile_ahead(progress)
        super().__init__(tables, budget, clock)
        if self._guarded:
            # Compiles or loads the cycle; positions that are none change nothing.
            run_guarded_cycle(NO_POSITIONS, self._lines)
        load_kernels()
        self._clusters = ClusterTable(self._watch.clusters, self._watch.cluster_evaded)
        self._proven = ProvenLines(tables, self._objects, self._holding)
        self.home_verdict = self.judge_at_rest(self.tables.home)
        check_home(self.home_verdict, scene)
        self.reset()
        self.self_test = run_self_test(self) if self_test else NOT_TESTED

    def _compile_ahead(self, progress: Callable[[str], None] | None) -> None:
        """Compile the kernels of the loop in advance, where a subclass can do so."""

    @property
    def budget(self) -> int:
        """Spans of a stop path that a cycle may test for all pairs together."""
        return self._budget

    @property
    def names(self) -> Names:
        """Names of its verdicts, for clients that store the numbers of a verdict."""
        return self._names

    @property
    def poses(self) -> NDArray[np.float64]:
        """Poses of all bodies in the last judged cycle, shape (b, 12).

        The upper three rows of their transforms. The guard's own array: read-only.
        """
        return self._poses

    def q(self, positions: Mapping[str, float]) -> NDArray[np.float64]:
        """Joint vector from positions by name, shape (n,) [rad or m].

        Raises:
            UnknownNameError: A joint is missing, or no joint has that name.
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

    place = delegated("_objects", Objects.place)
    remove = delegated("_objects", Objects.remove)
    grasp = delegated("_holding", Holding.grasp)
    release = delegated("_holding", Holding.release)
    allow = delegated("_contracts", ContractTable.allow)
    swap_model = delegated("_grippers", Grippers.swap_model)
    update_cells = delegated("_sensed", SensedSpace.update_cells)
    update_clusters = delegated("_clusters", ClusterTable.update_clusters)
    forgetting = delegated("_sensed", SensedSpace.forgetting)
    knowledge = delegated("_sensed", SensedSpace.knowledge)
    checker = delegated("_proven", ProvenLines.checker)
    checkpoint = delegated("_saving", Saving.checkpoint)
    restore = delegated("_saving", Saving.restore)

    @property
    def contracts(self) -> tuple[Contract, ...]:
        """All contracts in force, those of held objects included."""
        return self._holding.contracts

    @property
    def held(self) -> Mapping[str, tuple[str, ...]]:
        """Robots that hold each held object; the first one carries it."""
        return {name: tuple(by) for name, by in self._holding.holders.items()}

    def check_path(
        self,
        rows: ArrayLike,
        *,
        resolution: float = RESOLUTION,
        sensed: bool = True,
    ) -> PathCheck:
        """Prove that a path of joint positions keeps every buffer, or find where not.

        Straight lines in joint space between the rows are bounded as a whole and
        bisected where that does not suffice, so nothing can be missed between samples.
        The state of the loop does not change; objects count as static at their present
        poses. The first path of 32 lines or more loads the kernels of `Checker`, which
        proves most lines of such a path at once.

        In a scene with `sensing` the cells count as static obstacles as the guard knows
        them now, space that is not known free among them if the scene says so.

        Args:
            rows: Joint positions in the order of `q_names`, shape (k, n) [rad or m].
            resolution: A line on which no joint moves more than this is not bisected
                further [rad or m].
            sensed: Whether cells count. False judges the model alone, for paths that
                are planned before sensors have seen anything.

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
        has_cells = self.tables.sensing is not None
        if sensed and has_cells:
            # The checker of batches knows no cells.
            none = np.zeros(max(len(array) - 1, 1), dtype=np.bool_)
            return check_path(array, self._judge_line, resolution, none)
        self._settings.sensed = 0
        try:
            proven = self._proven.among(array, resolution)
            return check_path(array, self._judge_line, resolution, proven)
        finally:
            self._settings.sensed = has_cells

    def announce(
        self,
        plan: Announced,
        start: float,
        *,
        following_error: float | Mapping[str, float],
    ) -> None:
        """Announce a plan: each verdict then says how long it is proven ahead.

        See `Verdict.ahead` and docs/verify.md. No decision of the guard depends on it.
        Each cycle proves a bounded part of the rest of the plan; after an object was
        placed or removed all of it is proven again. Objects count as static where they
        were placed last. The plan counts until the next one or `reset`. It takes
        milliseconds, and the first one loads kernels: call it while the arms rest.

        Args:
            plan: A plan of this scene, an `armguard.Plan` with times.
            start: Time of the plan's time 0, on the clock of `step` [s].
            following_error: How far a joint may be off its curve, for all or by name of
                a robot or of 'robot/joint'; a clock that is off counts as well
                [rad or m].

        Raises:
            TrajectoryError: The plan has no times or is of another scene, or a figure
                is no such figure.
            SceneError: The scene predicts no stops, or has sensed space.

        Example:
            >>> import numpy as np
            >>> import armguard as ag
            >>> scene = ag.bay_scene("path")
            >>> guard, times = ag.Guard(scene), np.array([0.0, 1.0])
            >>> rows = np.array([scene.home, scene.home + 0.01])
            >>> motion = ag.Trajectory(scene.q_names, rows, times, "a line")
            >>> guard.announce(ag.Plan.of(motion, scene), 0.0, following_error=0.001)
            >>> rest = 0.0 * guard.home
            >>> guard.step(guard.home, 0.0, velocity=rest).ahead.enough
            True
        """
        world = self._proven, self._watch, self._outlook.changes
        self._outlook.take(LookAhead(plan, start, following_error, *world))

    def _judge_line(self, start: Floats, end: Floats) -> Verdict:
        """Verdict on a straight line in joint space as a whole."""
        with self._grippers.detailed():
            used = run_segment(
                np.ascontiguousarray(start), np.ascontiguousarray(end), self._lines
            )
        return Verdict(self._out[:used].copy(), self._names, None, 0.0)

    def take_over(self, other: "Monitor") -> None:
        """Copy the state of another guard, without the poses of objects.

        It serves to compare the verdicts of both, cycle by cycle. The scenes may differ
        in settings, not in content.

        Raises:
            CheckpointError: They differ in more than that.
        """
        self._saving.take_over(other._saving)

    def stand_as(self, other: "Monitor") -> None:
        """Copy the poses and the presence of all objects of another guard."""
        self._saving.stand_as(other._saving)

    def forget_stops(self) -> None:
        """Set all robots to running, as if no stop had been ordered.

        For judging a motion that does not obey the guard.
        """
        self._watch.phase.fill(RUNNING)
        self._watch.must.fill(0)
