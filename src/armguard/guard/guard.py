"""The guard: joint positions in, a verdict out, every cycle."""

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter_ns

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import HomeContactError, UnknownNameError, did_you_mean
from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import place_row
from armguard.geometry.pose import Pose, check_transform
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard import layout
from armguard.guard.compiling import compile_ahead
from armguard.guard.cycle import run_cycle
from armguard.guard.levels import Reason
from armguard.guard.memory import FORCE, MEMORY
from armguard.guard.objects import stand_at, take_out
from armguard.guard.planes import PLANE_COUNT
from armguard.guard.refine import MEMO_SIZE, MEMO_WIDTH
from armguard.guard.verdict import Names, NearPair, Verdict
from armguard.guard.workspace import (
    BRUTE_FORCE,
    INDEX_KIND,
    MOVING_COUNT,
    OCTREE,
    Workspace,
    ledger_of,
)
from armguard.index import BruteForce, Octree, World
from armguard.kernel import kernel
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.standing import Standing
from armguard.scene.tables import SceneTables

# Near pairs an answer has room for. More than this many at once is a reason to stop
# (`Reason.CAPACITY`), not to count on.
NEAR_CAPACITY = 4096

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FLOAT64 = np.dtype(np.float64)


class Guard:
    """Watches a scene: each `step` judges one joint configuration.

    Everything slow happens here, before the loop: the scene is compiled to tables,
    kernels are compiled or loaded, the home configuration is judged. `step` never
    raises: an input it cannot judge gives a verdict whose level is a stop.

    Attributes:
        tables: The compiled scene.
        index: The octree, or brute force; for pictures and statistics.
        home_verdict: Verdict of the home configuration.

    Args:
        scene: What to guard.
        progress: Called with one sentence before anything that takes long.
        clock: Clock in nanoseconds that measures `Verdict.cycle_time`; no decision
            depends on it.

    Raises:
        SceneError: The scene contradicts itself.
        HomeContactError: Checked bodies overlap at the home configuration.

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
        progress: Callable[[str], None] | None = None,
        clock: Callable[[], int] = perf_counter_ns,
    ) -> None:
        self.tables: SceneTables = compile_scene(scene)
        self._memory = np.zeros(MEMORY, dtype=np.int64)
        self._last_stamp = -np.inf
        self._clock = clock
        compile_ahead(progress)
        self._prepare(self.tables)
        self.home_verdict = self.step(self.tables.home)
        contacts = tuple(p for p in self.home_verdict.near if not p.distance >= 0.0)
        if contacts:
            raise HomeContactError(home_sentence(contacts), contacts)
        self.reset()

    @property
    def q_names(self) -> tuple[str, ...]:
        """'robot/joint' of each place of q."""
        return self.tables.q_names

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

    def step(self, q: ArrayLike, stamp: float | None = None) -> Verdict:
        """Judge one joint configuration. Never raises.

        Args:
            q: Joint positions in the order of `q_names`, shape (n,) [rad or m].
            stamp: Time of the measurement [s]; must not go back.

        Returns:
            The verdict; a snapshot that later cycles do not change.
        """
        start = self._clock()
        fault = ""
        if stamp is not None:
            fault = self._judge_stamp(stamp)
        if fault:
            data = self._fault_answer(Reason.TIME_BACKWARDS)
        else:
            if not (
                type(q) is np.ndarray
                and q.dtype is FLOAT64
                and q.shape == self._shape
                and q.flags.carray
            ):
                q, fault = self._convert(q)
            if fault:
                data = self._fault_answer(Reason.WRONG_INPUT)
            else:
                used = run_cycle(q, self._lines)
                data = self._out[:used].copy()
        return Verdict(data, self._names, stamp, (self._clock() - start) * 1e-9, fault)

    def place(self, name: str, pose: Pose | ArrayLike) -> None:
        """Put an object where it stands from now on, whether it was there or not.

        For between two cycles: it takes microseconds for each primitive of the object,
        and may take longer where the index has to grow.

        Args:
            name: An object of the scene that is attached to nothing.
            pose: Its frame in the world, a `Pose` or a transform of shape (4, 4).

        Raises:
            UnknownNameError: There is no such object.
            PoseError: The transform is not rigid, or a number is not finite.

        Example:
            >>> from armguard import Guard, Pose, Sphere, bay_scene
            >>> scene = bay_scene()
            >>> cart = scene.add(Sphere(radius=0.05), name="cart", present=False)
            >>> guard = Guard(scene)
            >>> guard.place("cart", Pose(xyz=(0.0, 0.0, 1.0)))
            >>> guard.remove("cart")
        """
        thing = self._standing(name)
        T = pose.matrix() if isinstance(pose, Pose) else check_transform("pose", pose)
        stand_at(self.index, thing, T)
        self._world_changed()

    def remove(self, name: str) -> None:
        """Leave an object out from now on; `place` brings it back.

        Raises:
            UnknownNameError: There is no such object.
        """
        take_out(self.index, self._standing(name))
        self._world_changed()

    def reset(self) -> None:
        """Forget the last cycle and the last stamp.

        The next verdict is the same either way; only the work is done anew.
        """
        self._memory[FORCE] = 1
        self._last_stamp = -np.inf

    def _prepare(self, tables: SceneTables) -> None:
        """Allocate everything the loop will ever need."""
        count, bodies = len(tables.kinds), len(tables.parent)
        capacity = max(1, min(tables.checkable_pairs, NEAR_CAPACITY))
        T_world = np.zeros((bodies, 12))
        world = world_at_home(tables, T_world)
        self.index = build_index(tables, world)
        for thing in tables.standing.values():
            if not thing.present:
                take_out(self.index, thing)
        self._shape = (len(tables.q_names),)
        self._memory[FORCE] = 1
        self._out = np.zeros(layout.HEADER + capacity * layout.NEAR_WIDTH)
        settings = np.zeros(2, dtype=np.int32)
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
            world=world,
            octree=self.index.state,
        )
        self._open_ledger(workspace)
        self._names = Names(
            joints=tables.q_names,
            lower=tables.lower,
            upper=tables.upper,
            bodies=tables.body_names,
            labels=tables.labels,
            model_errors=tables.model_errors,
            exact_errors=tables.exact.errors,
            checkable_pairs=tables.checkable_pairs,
        )

    def _standing(self, name: str) -> Standing:
        """The object of that name that is attached to nothing."""
        known = self.tables.standing
        if name not in known:
            raise UnknownNameError(
                f"no object that stands still is named '{name}'; "
                f"{did_you_mean(name, known)}"
            )
        return known[name]

    def _world_changed(self) -> None:
        """Take over an index that was built anew; measure every pair afresh."""
        self._open_ledger(self._workspace._replace(octree=self.index.state))
        self._memory[FORCE] = 1

    def _open_ledger(self, workspace: Workspace) -> None:
        """Tell the loop where everything lies."""
        self._workspace = workspace
        self._ledger = ledger_of(workspace)
        self._lines = self._ledger.lines

    def _judge_stamp(self, stamp: float) -> str:
        """Take the stamp over, or say why not."""
        try:
            newer = stamp >= self._last_stamp
        except (TypeError, ValueError):
            newer = False
        if not newer:
            return (
                f"stamp is {stamp!r}; it must be a number not less than the last "
                f"one, {self._last_stamp}"
            )
        self._last_stamp = stamp
        return ""

    def _convert(self, q: ArrayLike) -> tuple[NDArray[np.float64], str]:
        """`q` as the array the kernel takes, or in words what it is instead."""
        wanted = f"it must be {self._shape[0]} numbers in the order of guard.q_names"
        try:
            array = np.array(q, dtype=np.float64)
        except Exception:  # whatever a stranger's object raises, the loop goes on
            return self.tables.home, f"q is a {type(q).__name__}; {wanted}"
        if array.shape != self._shape:
            return array, f"q has shape {array.shape}; {wanted}"
        return array, ""

    def _fault_answer(self, reason: Reason) -> NDArray[np.float64]:
        """An answer without near pairs: the configuration was not judged."""
        data = np.zeros(layout.HEADER)
        data[layout.REASON] = reason
        data[layout.JOINT] = -1.0
        data[layout.NEAREST] = -1.0
        return data


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


def world_at_home(tables: SceneTables, T_world: NDArray[np.float64]) -> World:
    """The primitives, placed at the home configuration."""
    world = World(
        kinds=tables.kinds,
        rows=tables.local_rows.copy(),
        boxes=np.zeros((len(tables.kinds), 6)),
        owners=tables.owners,
        growth=tables.growth,
    )
    forward_kinematics(
        tables.home,
        tables.parent,
        tables.joint_kind,
        tables.q_index,
        tables.gain,
        tables.T_parent_joint,
        tables.axis,
        T_world,
    )
    place_all(tables.kinds, tables.bodies, tables.local_rows, T_world, world)
    return world


@kernel(inline=False, entry=True)
def place_all(
    kinds: Ints, bodies: Ints, local_rows: Floats, T_world: Floats, world: World
) -> None:
    """Write the world row and the bounding box of every primitive."""
    for i in range(kinds.shape[0]):
        if bodies[i] >= 0:
            place_row(kinds[i], local_rows[i], T_world[bodies[i]], world.rows[i])
        row_bounds(kinds[i], world.rows[i], 0.0, world.boxes[i])


def build_index(tables: SceneTables, world: World) -> Octree | BruteForce:
    """The index the scene asks for."""
    if tables.index.kind == "brute_force":
        return BruteForce(world)
    return Octree(
        world,
        leaf_capacity=tables.index.leaf_capacity,
        max_depth=tables.index.max_depth,
        cube=(tables.cube_centre, tables.cube_edge),
    )
