"""One cycle: joint angles -> poses -> index -> near pairs -> headroom -> verdict."""

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import place_row
from armguard.guard.layout import NEAR_WIDTH, Header
from armguard.guard.levels import Reason
from armguard.guard.limits import report_limits
from armguard.guard.near_pairs import judge_pairs
from armguard.guard.reindex import update_index
from armguard.guard.workspace import IndexKind, Workspace, open_workspace
from armguard.kernel import kernel
from armguard.robot.kinematics import forward_kinematics
from armguard.table import Vector

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]

NOT_FINITE = int(Reason.NOT_FINITE)
WRONG_INPUT = int(Reason.WRONG_INPUT)


@kernel(inline=False, entry=True)
def run_cycle(q: Floats, lines: Longs) -> int:
    """Judge one joint configuration.

    The world is rebuilt from `q` alone. A pair whose two sides have not moved at all
    keeps its row of the last cycle, which another measurement would repeat bit for
    bit.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        lines: Ledger of a workspace; its state, memory and `out` are updated.

    Returns:
        Count of numbers of the workspace's `out` that were used.
    """
    w = open_workspace(lines)
    out = w.header
    rows = clear_header(w)
    if not positions_are_finite(q, w.lower, out):
        return rows
    rebuild_world(q, w.settings.index_kind != IndexKind.LISTED, w)
    judge_pairs(w)
    report_limits(q, w.lower, w.upper, out)
    return rows + int(out.near_count) * NEAR_WIDTH


@kernel
def clear_header(w: Workspace) -> int:
    """Clear the header of the answer, and its rows of robots.

    Returns:
        Index at which the rows of near pairs start.
    """
    rows = w.settings.first_row
    for k in range(rows):
        w.out[k] = 0.0
    w.header.joint = w.header.nearest = w.header.robot = -1.0
    return int(rows)


@kernel(separate=True)
def rebuild_world(q: Vector, indexed: int, w: Workspace) -> None:
    """Update poses, primitives in the world and index, from joint angles alone.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        indexed: 0 where the index will not be queried.
        w: The workspace.
    """
    forward_kinematics(
        q, w.parent, w.joint_kind, w.q_index, w.gain, w.T_parent_joint, w.axis, w.T_next
    )
    place_moved(w)
    if indexed != 0:
        update_index(q, w)


@kernel
def place_moved(w: Workspace) -> None:
    """Place the primitives of every body whose pose changed in any bit."""
    force = w.memory.measure_all != 0
    w.header.bodies_moved = mark_moved_bodies(w.T_next, w.T_world, w.body_moved, force)
    kinds, rows, boxes = w.world.kinds, w.world.rows, w.world.boxes
    links = 0
    last_body = -1
    for i in range(w.settings.moving_count):
        body = w.bodies[i]
        w.moved[i] = w.body_moved[body]
        if w.body_moved[body]:
            place_row(kinds[i], w.local_rows[i], w.T_world[body], rows[i])
            row_bounds(kinds[i], rows[i], 0.0, boxes[i])
            if body != last_body:
                links += 1
                last_body = body
    w.header.links_checked = links


@kernel
def positions_are_finite(q: Floats, lower: Floats, out: Header) -> bool:
    """Whether q has the right length and is finite; else the reason is written."""
    if q.shape[0] != lower.shape[0]:
        out.reason = WRONG_INPUT
        return False
    for k in range(q.shape[0]):
        if not isfinite(q[k]):
            out.reason = NOT_FINITE
            out.joint = k
            out.value = q[k]
            return False
    return True


@kernel
def mark_moved_bodies(
    T_next: Floats, T_world: Floats, body_moved: Bytes, force: bool
) -> int:
    """Mark the bodies whose pose differs in any bit, and copy the new poses.

    Returns:
        Count of these bodies.
    """
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
