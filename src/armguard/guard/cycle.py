"""One cycle: joint angles -> poses -> index -> near pairs -> clearances -> verdict."""

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import place_row
from armguard.guard.explain import explain_nearest
from armguard.guard.grade import grade_robots
from armguard.guard.layout import (
    BODIES_MOVED,
    JOINT,
    LINKS_CHECKED,
    NEAR_COUNT,
    NEAR_WIDTH,
    NEAREST,
    REASON,
    ROBOT,
    SPANS_TESTED,
    VALUE,
)
from armguard.guard.levels import Reason
from armguard.guard.memory import FORCE
from armguard.guard.near_pairs import judge_pairs, look_around
from armguard.guard.observe import observe
from armguard.guard.reindex import update_index
from armguard.guard.stops import (
    order_stops,
    set_clocks,
    stop_everything,
    supervise_stops,
)
from armguard.guard.watch import FORCED
from armguard.guard.workspace import (
    FIRST_ROW,
    GUARDED,
    MOVING_COUNT,
    Workspace,
    open_workspace,
)
from armguard.kernel import kernel
from armguard.motion.state import NEXT, TESTS
from armguard.motion.state import NOW as AT_ONCE
from armguard.motion.stop_path import (
    bound_reaches,
    measured_speeds,
    plan_stops,
    write_axes,
)
from armguard.robot.kinematics import forward_kinematics

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]

NOT_FINITE = int(Reason.NOT_FINITE)
OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)
WRONG_INPUT = int(Reason.WRONG_INPUT)
CAPACITY = int(Reason.CAPACITY)
NO_DISTANCE = int(Reason.NO_DISTANCE)


@kernel(inline=False, entry=True)
def run_cycle(q: Floats, lines: Longs) -> int:
    """Judge one joint configuration.

    The world is rebuilt from `q` alone. A pair whose two sides stand exactly where
    they stood keeps its row of the last cycle, which is what measuring it again
    would give, bit for bit.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        lines: Ledger of a workspace; its state, memory and `out` are updated.

    Returns:
        How many places of the workspace's `out` were used.
    """
    w = open_workspace(lines)
    out = w.out
    rows = w.settings[FIRST_ROW]
    for k in range(rows):
        out[k] = 0.0
    out[JOINT] = out[NEAREST] = out[ROBOT] = -1.0
    guarded = w.settings[GUARDED] != 0
    if not positions_are_finite(q, w.lower, out):
        if guarded:
            refuse(w)
        return int(rows)
    if guarded and not predict(q, w):
        refuse(w)
        return int(rows)
    forward_kinematics(
        q, w.parent, w.joint_kind, w.q_index, w.gain, w.T_parent_joint, w.axis, w.T_next
    )
    place_moved(w)
    update_index(w)
    if guarded:
        bound_motion(w)
    judge_pairs(w)
    if guarded:
        conclude(w)
    report_limits(q, w.lower, w.upper, w)
    return int(rows) + int(out[NEAR_COUNT]) * NEAR_WIDTH


@kernel
def predict(q: Floats, w: Workspace) -> bool:
    """Take the input over, follow the stops under way, plan those that may come.

    Returns:
        Whether the input can be judged.
    """
    v, m = w.watch, w.motion
    if not observe(q, v, m, w.out):
        return False
    supervise_stops(v, m)
    set_clocks(v, m)
    for r in range(v.must.shape[0]):
        v.must[r] = 0
        v.time_left[r] = np.inf
    m.effort[TESTS] = 0
    plan_stops(NEXT, m)
    plan_stops(AT_ONCE, m)
    measured_speeds(m)
    return True


@kernel
def bound_motion(w: Workspace) -> None:
    """Bound how far every primitive may get, from the poses as they are now."""
    m = w.motion
    write_axes(w.T_world, m)
    bound_reaches(NEXT, w.bodies, m)
    bound_reaches(AT_ONCE, w.bodies, m)
    look_around(w)


@kernel
def conclude(w: Workspace) -> None:
    """Order what must be ordered, grade the robots, explain the nearest pair."""
    if w.out[REASON] == CAPACITY or w.out[REASON] == NO_DISTANCE:
        w.watch.last[FORCED] = w.out[REASON]
    order_stops(w.watch, w.motion)
    w.out[SPANS_TESTED] = w.motion.effort[TESTS]
    grade_robots(w)
    explain_nearest(w)


@kernel
def refuse(w: Workspace) -> None:
    """Stop everything for an input that cannot be believed."""
    reason = w.out[REASON]
    stop_everything(int(reason), w.watch, w.motion)
    grade_robots(w)
    w.out[REASON] = reason


@kernel
def place_moved(w: Workspace) -> None:
    """Place the primitives of every body whose pose changed in any bit."""
    force = w.memory[FORCE] != 0
    w.out[BODIES_MOVED] = mark_moved_bodies(w.T_next, w.T_world, w.body_moved, force)
    kinds, rows, boxes = w.world.kinds, w.world.rows, w.world.boxes
    links = 0
    last_body = -1
    for i in range(w.settings[MOVING_COUNT]):
        body = w.bodies[i]
        w.moved[i] = w.body_moved[body]
        if w.body_moved[body]:
            place_row(kinds[i], w.local_rows[i], w.T_world[body], rows[i])
            row_bounds(kinds[i], rows[i], 0.0, boxes[i])
            if body != last_body:
                links += 1
                last_body = body
    w.out[LINKS_CHECKED] = links


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
def report_limits(q: Floats, lower: Floats, upper: Floats, w: Workspace) -> None:
    """Name the first joint outside its limits; it outranks every distance."""
    out = w.out
    for k in range(q.shape[0]):
        if not (lower[k] <= q[k] <= upper[k]):
            out[REASON] = OUT_OF_LIMITS
            out[JOINT] = k
            out[VALUE] = q[k]
            if w.settings[GUARDED] != 0:
                refuse(w)
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
