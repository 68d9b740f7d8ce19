"""Other bodies beside an escape motion: own links, objects, other robots, and cells."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pairs import measure
from armguard.guard.motion_pairs import asks_index
from armguard.guard.needs import robot_of, static_need
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.index.octree_query import primitives_in_box
from armguard.index.octree_state import ABSENT
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.escape_cells import meets_cells
from armguard.respond.escape_state import Escape

Floats = NDArray[np.float64]

# An arm that is so near to another body counts as stopped there [m], unless it is
# nearer already and its distance falls by no more than this [m].
ROOM, GRAZES = 0.012, 2e-3

# Distance from a configuration at which the index is queried for primitives [m]. Number
# of found primitives, and number of placed primitives per query, by cost.
FOUND_WITHIN = 0.03
FOUND_AT_ONCE = 4
QUERY_COST = 4


@kernel
def meets_others(r: int, e: Escape, w: Workspace, v: Watch, m: Motion) -> bool:
    """Whether the placed robot is too near to itself, to cells, or to another body.

    Approaching obstacles are no other bodies here.
    """
    own, other_count = e.plan.own_count, e.plan.other_count
    rows, boxes = w.world.rows, w.world.boxes
    by_index = asks_index(w) != 0
    for k in range(own):
        i = int(e.own[k])
        for c in range(k + 1, own):
            j = int(e.own[c])
            if meets(i, j, e.rows[j], e.boxes[j], e, w, v, m):
                return True
        for c in range(other_count):
            j = int(e.others[c])
            if meets(i, j, rows[j], boxes[j], e, w, v, m):
                return True
        for c in range(found_near(i, e, w) if by_index else 0):
            j = int(w.candidates[c])
            if may_be_met(r, j, e, w, v) and meets(i, j, rows[j], boxes[j], e, w, v, m):
                return True
        if w.settings.sensed != 0 and meets_cells(i, ROOM, GRAZES, e, w):
            return True
    return False


@kernel
def found_near(i: int, e: Escape, w: Workspace) -> int:
    """Number of primitives that the index finds near a placed one, in `candidates`."""
    for k in range(3):
        w.look_box[k] = e.boxes[i, k] - FOUND_WITHIN
        w.look_box[k + 3] = e.boxes[i, k + 3] + FOUND_WITHIN
    w.memory.token += 1
    token = w.memory.token
    found = primitives_in_box(i, w.look_box, w.octree, w.seen, token, w.candidates)
    e.plan.placed += QUERY_COST + found // FOUND_AT_ONCE
    return int(found)


@kernel
def may_be_met(r: int, j: int, e: Escape, w: Workspace, v: Watch) -> bool:
    """Whether a primitive is present, not the robot's own and not approaching it."""
    if robot_of(j, v) == r or w.octree.residency[j].status == ABSENT:
        return False
    for c in range(e.plan.approaching_count):
        if e.approaching[c].primitive == j:
            return False
    return True


@kernel
def meets(
    i: int,
    j: int,
    row: Floats,
    box: Floats,
    e: Escape,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> bool:
    """Whether a primitive of the placed robot is too near to another one.

    Args:
        i: Primitive of the robot.
        j: Other primitive.
        row: Row of the other primitive in the world, shape (16,).
        box: Its box, shape (6,) [m].
        e: Escape.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    if w.checked[w.groups[i], w.groups[j]] == 0:
        return False
    need = ROOM + static_need(min(i, j), max(i, j), w, v, m)
    for k in range(3):
        if e.boxes[i, k] - box[k + 3] > need or box[k] - e.boxes[i, k + 3] > need:
            return False
    kinds, rows = w.world.kinds, w.world.rows
    measure(kinds[i], e.rows[i], kinds[j], row, e.witness)
    gap = e.witness[0]
    if not gap < need:
        return False
    measure(kinds[i], rows[i], kinds[j], rows[j], e.witness)
    return bool(gap < e.witness[0] - GRAZES)
