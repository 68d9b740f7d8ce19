"""One cycle: joint angles -> poses -> index -> near pairs -> clearances -> verdict."""

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import place_row
from armguard.guard.layout import (
    BODIES_MOVED,
    HEADER,
    JOINT,
    LINKS_CHECKED,
    NEAR_COUNT,
    NEAREST,
    REASON,
    VALUE,
)
from armguard.guard.levels import Reason
from armguard.guard.memory import FORCE
from armguard.guard.near_pairs import judge_pairs
from armguard.guard.reindex import update_index
from armguard.index.octree_state import OctreeState
from armguard.index.world import World
from armguard.kernel import kernel
from armguard.robot.kinematics import forward_kinematics

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]

NOT_FINITE = int(Reason.NOT_FINITE)
OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)
WRONG_INPUT = int(Reason.WRONG_INPUT)

@kernel
def run_cycle(
    q: Floats,
    lower: Floats,
    upper: Floats,
    parent: Ints,
    joint_kind: Ints,
    q_index: Ints,
    gain: Floats,
    T_parent_joint: Floats,
    axis: Floats,
    bodies: Ints,
    local_rows: Floats,
    groups: Ints,
    checked: Bytes,
    buffers: Floats,
    margin: float,
    moving_count: int,
    index_kind: int,
    world: World,
    octree: OctreeState,
    T_next: Floats,
    T_world: Floats,
    body_moved: Bytes,
    candidates: Ints,
    seen: Longs,
    kept: Floats,
    memory: Longs,
    out: Floats,
) -> int:
    """Judge one joint configuration.

    The world is rebuilt from `q` alone. A pair whose two sides stand exactly where
    they stood keeps its row of the last cycle, which is what measuring it again
    would give, bit for bit.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        lower: See `SceneTables`, from here to `moving_count`.
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
        margin: Reporting distance.
        moving_count: Moving primitives.
        index_kind: OCTREE or BRUTE_FORCE.
        world: Primitives in the world; rows and boxes are updated.
        octree: State of the octree, updated.
        T_next: Scratch for poses, shape (b, 12).
        T_world: Poses of the last good cycle, updated, shape (b, 12).
        body_moved: Scratch, 1 where a body's pose changed, shape (b,).
        candidates: Scratch for ids, shape (p,).
        seen: Scratch of the index, shape (p,).
        kept: Near pairs of the last good cycle, updated, shape (k, NEAR_WIDTH).
        memory: See `memory`, updated, shape (MEMORY,).
        out: Answer, overwritten; see `layout`, shape (HEADER + k · NEAR_WIDTH,).

    Returns:
        How many places of `out` were used.
    """
    out[:HEADER] = 0.0
    out[JOINT] = -1.0
    out[NEAREST] = -1.0
    if not positions_are_finite(q, lower, out):
        return HEADER

    forward_kinematics(
        q, parent, joint_kind, q_index, gain, T_parent_joint, axis, T_next
    )
    force = memory[FORCE] != 0
    out[BODIES_MOVED] = mark_moved_bodies(T_next, T_world, body_moved, force)
    links = 0
    last_body = -1
    for i in range(moving_count):
        body = bodies[i]
        if body_moved[body]:
            place_row(world.kinds[i], local_rows[i], T_world[body], world.rows[i])
            row_bounds(world.kinds[i], world.rows[i], 0.0, world.boxes[i])
            if body != last_body:
                links += 1
                last_body = body
    out[LINKS_CHECKED] = links

    update_index(index_kind, moving_count, bodies, body_moved, world, octree, out)
    judge_pairs(
        index_kind,
        moving_count,
        world,
        groups,
        checked,
        buffers,
        margin,
        bodies,
        body_moved,
        octree,
        candidates,
        seen,
        kept,
        memory,
        out,
    )
    report_limits(q, lower, upper, out)
    return HEADER + int(out[NEAR_COUNT]) * kept.shape[1]


@kernel
def positions_are_finite(q: Floats, lower: Floats, out: Floats) -> bool:
    """Whether q has its length and only finite numbers; else the answer says so."""
    if q.shape[0] != lower.shape[0]:
        out[REASON] = WRONG_INPUT
        return False
    for k in range(q.shape[0]):
        if not isfinite(q[k]):
            out[REASON] = NOT_FINITE
            out[JOINT] = k
            out[VALUE] = q[k]
            return False
    return True


@kernel
def report_limits(q: Floats, lower: Floats, upper: Floats, out: Floats) -> None:
    """Name the first joint outside its limits; it outranks every distance."""
    for k in range(q.shape[0]):
        if not (lower[k] <= q[k] <= upper[k]):
            out[REASON] = OUT_OF_LIMITS
            out[JOINT] = k
            out[VALUE] = q[k]
            return


@kernel
def mark_moved_bodies(
    T_next: Floats, T_world: Floats, body_moved: Bytes, force: bool
) -> int:
    """Mark the bodies whose pose differs in any bit, take the new poses over."""
    count = 0
    for b in range(T_next.shape[0]):
        moved = force
        for k in range(12):
            if T_next[b, k] != T_world[b, k]:
                moved = True
            T_world[b, k] = T_next[b, k]
        body_moved[b] = moved
        count += moved
    return count
