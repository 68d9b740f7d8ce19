"""Everything a cycle reads and writes, and its order in the ledger."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.guard.grips import Grips
from armguard.guard.watch import Watch
from armguard.index.octree_state import OctreeState
from armguard.index.world import World
from armguard.motion.state import Motion
from armguard.table import (
    TABLE,
    ByteMatrix,
    ByteVector,
    IntMatrix,
    IntVector,
    LongMatrix,
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


@table
class Workspace(NamedTuple):
    """Tables of a scene, state of its index, memory and scratch of its guard.

    Attributes:
        lower: See `SceneTables`, from here to `buffers`.
        upper: Greatest joint positions.
        parent: Parent bodies.
        joint_kind: Joint kinds.
        q_index: Places in q.
        gain: Multipliers and offsets.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        bodies: Bodies the primitives ride on.
        local_rows: Primitives in their bodies.
        groups: Rule groups.
        checked: Which groups are checked.
        buffers: Required distances.
        margin: Reporting distance, shape (1,).
        settings: See MOVING_COUNT, shape (SETTINGS,).
        T_next: Scratch for poses, shape (b, 12).
        T_world: Poses of the last good cycle, shape (b, 12).
        body_moved: 1 where a body's pose changed, shape (b,).
        moved: 1 where a primitive rides on such a body, shape (p,).
        candidates: Scratch for ids, shape (p,).
        seen: Scratch of the index, shape (p,).
        kept: Near pairs of the last good cycle, shape (k, NEAR_WIDTH).
        memory: What is carried over, see `memory`, shape (MEMORY,).
        out: Answer, see `layout`, shape (HEADER + k · NEAR_WIDTH,).
        exact_of: See `ExactTables`, from here to `exact_rows`.
        exact_kinds: Kinds of the exact shapes.
        exact_rows: Exact shapes in their bodies.
        memo: Pairs of links whose exact distance is known, see `refine`.
        memo_rows: Their witness rows, shape (m, 10).
        planes: Pairs that were found far apart, see `planes`, shape (n,).
        normals: Their normals, shape (n, 3).
        look: More than any pair must keep for other reasons than motion, (1,) [m].
        look_box: Scratch for a box, shape (6,).
        motion: Stops that may come, and what they sweep.
        watch: Inputs, commands and the state of the robots.
        grips: Contracts and grippers.
        world: Primitives in the world.
        octree: State of the octree.
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
    margin: Vector
    settings: IntVector
    T_next: Matrix
    T_world: Matrix
    body_moved: ByteVector
    moved: ByteVector
    candidates: IntVector
    seen: LongVector
    kept: Matrix
    memory: LongVector
    out: Vector
    exact_of: IntMatrix
    exact_kinds: IntVector
    exact_rows: Matrix
    memo: LongMatrix
    memo_rows: Matrix
    planes: LongVector
    normals: Matrix
    look: Vector
    look_box: Vector
    motion: Annotated[Motion, TABLE]
    watch: Annotated[Watch, TABLE]
    grips: Annotated[Grips, TABLE]
    world: World
    octree: OctreeState


# Places in `Workspace.settings`.
MOVING_COUNT = 0
INDEX_KIND = 1
FIRST_ROW = 2  # where the rows of the answer start
CONTRACTS = 3  # 1 where contracts may be in force
INTENTS = 4  # 1 where contracts by intent are opened
SETTINGS = 5

# Kinds of index.
OCTREE = 0
BRUTE_FORCE = 1


open_workspace = opener(Workspace)
