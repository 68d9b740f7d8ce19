"""All arrays that a cycle reads and writes, and their order in the ledger."""

from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.grips import Grips
from armguard.guard.layout import Header, NearRow, RobotRow
from armguard.guard.sensed import Sensed
from armguard.guard.watch import Watch
from armguard.index.joint_cells import JointCells
from armguard.index.octree_state import OctreeState
from armguard.index.world import World
from armguard.motion.state import Motion
from armguard.record import Records, record
from armguard.table import (
    TABLE,
    ByteMatrix,
    ByteVector,
    IntMatrix,
    IntVector,
    LongVector,
    Matrix,
    Vector,
    opener,
    table,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]


class IndexKind(IntEnum):
    """How a cycle without a prediction of stops searches for near pairs.

    Attributes:
        OCTREE: By the octree.
        BRUTE_FORCE: By boxes, one primitive against all others.
        LISTED: By no index: it tests all checked pairs in turn.
        JOINT_TABLE: By the cells of the joint positions.
    """

    OCTREE = 0
    BRUTE_FORCE = 1
    LISTED = 2
    JOINT_TABLE = 3


@record
class Settings:
    """Settings of a loop, constant during a cycle.

    Attributes:
        moving_count: Number of primitives that move with a body; they come first.
        index_kind: See `IndexKind`.
        first_row: Index at which the rows of near pairs start in the answer.
        contracts: 1 where contracts may be in force.
        intents: 1 where contracts by intent are opened.
        margin: Reporting distance [m].
        static_need: Upper bound of the static need of any pair [m].
        modelled: Number of primitives of the scene; slots come after them.
        sensed: 1 where sensed cells are judged.
    """

    moving_count: int
    index_kind: int
    first_row: int
    contracts: int
    intents: int
    margin: float
    static_need: float
    modelled: int
    sensed: int


@record
class Memory:
    """Integers that a loop carries from one cycle to the next.

    Attributes:
        token: Count of lists of candidates, so that `seen` needs no clearing.
        kept_count: Count of near pairs of the last valid cycle.
        measure_all: 1 if no row of the last cycle may be kept.
        cycle: Count of cycles.
    """

    token: int
    kept_count: int
    measure_all: int
    cycle: int


@record
class Measured:
    """Distance of the exact shapes of two links, measured in a cycle.

    Attributes:
        key_a: Key of side A, see `refine_pair`.
        key_b: Key of side B.
        cycle: The cycle.
        witness: Witness row.
    """

    key_a: int
    key_b: int
    cycle: int
    witness: Annotated[Floats, (WITNESS_WIDTH,)]


@table
class Workspace(NamedTuple):
    """Tables of a scene, state of its index, memory and scratch of its guard.

    Sizes: b bodies, p primitives, k near pairs at most.

    Attributes:
        lower: Least joint positions. See `SceneTables`, from here to `buffers`.
        upper: Greatest joint positions.
        parent: Parent of each body.
        joint_kind: Kind of the joint above each body.
        q_index: Index in q of that joint.
        gain: Multiplier and offset of that joint.
        T_parent_joint: Joint frames in their parents.
        axis: Joint axes.
        bodies: Body of each primitive.
        local_rows: Primitives in the frames of their bodies.
        groups: Rule group of each primitive.
        checked: 1 where two groups are checked.
        buffers: Buffer of each pair of groups [m].
        settings: Settings of the loop.
        T_next: Scratch for poses, shape (b, 12).
        T_world: Poses of the last valid cycle, shape (b, 12).
        body_moved: 1 where a body's pose changed, shape (b,).
        moved: 1 where a primitive belongs to such a body, shape (p,).
        candidates: Scratch for ids of primitives, shape (p,).
        seen: Scratch of the index: token of the last query, shape (p,).
        kept: Rows of near pairs of the last valid cycle, shape (k,).
        memory: What a cycle carries to the next one.
        out: Answer, see `layout`, shape (first row + k · NEAR_WIDTH,).
        header: Its header, in the same memory.
        robots: Its rows of the robots, likewise, shape (r,) or (0,).
        escape: Its escape directions in joint space, likewise, shape (n,) or (0,).
        near: Its rows of the near pairs, likewise, shape (k,).
        exact_of: See `ExactTables`, from here to `exact_rows`.
        exact_kinds: Kinds of the exact shapes.
        exact_rows: Exact shapes in the frames of their bodies.
        memo: Cached distances of exact shapes, see `refine`, shape (MEMO_SIZE,).
        planes: Keys of pairs with a separating plane, see `planes`, (PLANE_COUNT,).
        normals: Normals of these planes, shape (PLANE_COUNT, 3).
        look_box: Scratch for a bounding box, shape (6,) [m].
        motion: Predicted stops and the displacements they cause.
        watch: Inputs, commands and the state of the robots.
        grips: Contracts and grippers.
        world: Primitives in the world.
        octree: State of the octree.
        joint_cells: The joint-space table; without links if the index is another.
        sensed: Sensed cells.
    """

    lower: Vector
    upper: Vector
    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    T_parent_joint: Matrix
    axis: Matrix
    bodies: IntVector
    local_rows: Matrix
    groups: IntVector
    checked: ByteMatrix
    buffers: Matrix
    settings: Settings
    T_next: Matrix
    T_world: Matrix
    body_moved: ByteVector
    moved: ByteVector
    candidates: IntVector
    seen: LongVector
    kept: Annotated[Records[NearRow], 1]
    memory: Memory
    out: Vector
    header: Header
    robots: Annotated[Records[RobotRow], 1]
    escape: Vector
    near: Annotated[Records[NearRow], 1]
    exact_of: IntMatrix
    exact_kinds: IntVector
    exact_rows: Matrix
    memo: Annotated[Records[Measured], 1]
    planes: LongVector
    normals: Matrix
    look_box: Vector
    motion: Annotated[Motion, TABLE]
    watch: Annotated[Watch, TABLE]
    grips: Annotated[Grips, TABLE]
    world: World
    octree: OctreeState
    joint_cells: JointCells
    sensed: Annotated[Sensed, TABLE]


open_workspace = opener(Workspace)
