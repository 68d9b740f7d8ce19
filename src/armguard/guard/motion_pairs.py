"""The pairs of a cycle with predicted stops: search, measurement and proof."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.change import NO_ROW, begin_notes, note_pair
from armguard.guard.demands import judge_motion
from armguard.guard.layout import NearRow, normal_of
from armguard.guard.near_pairs import (
    decide,
    grow_box,
    is_idle,
    keep_owned,
    may_meet,
    measures_row,
    open_row,
)
from armguard.guard.needs import LOOK_AHEAD, static_need
from armguard.guard.refine import refine_pair
from armguard.guard.search_distance import (
    hidden_by_error,
    pair_look,
    way_of_object,
    way_until_look,
    widest_look,
    write_looks,
)
from armguard.guard.sorting import sort_ids
from armguard.guard.watch import FEW, HYSTERESIS
from armguard.guard.workspace import IndexKind, Workspace
from armguard.index.octree_query import (
    octree_candidates,
    present_primitives,
    primitives_in_box,
)
from armguard.index.octree_state import ABSENT
from armguard.kernel import kernel
from armguard.lanes import load, lowest, ones
from armguard.motion.pair_proof import shared_joints
from armguard.motion.twist_bound import (
    SPEED,
    TRAVEL,
    bound_along,
)

Floats = NDArray[np.float64]


@kernel
def asks_index(w: Workspace) -> int:
    """1 if the pairs of this scene are searched in its index, else 0."""
    searched = w.settings.index_kind != IndexKind.BRUTE_FORCE
    return int(w.groups.shape[0] > FEW and searched)


@kernel(separate=True)
def judge_motions(w: Workspace) -> None:
    """Measure and prove every pair that may matter to a stop, and write near pairs.

    The order of pairs is that of `judge_pairs`. No row is kept from cycle to cycle: the
    required separation may change although a pair does not move.
    """
    v = w.watch
    w.memory.cycle += 1
    w.memory.kept_count = 0
    begin_notes(v, w.motion)
    if v.pair_blocks.shape[0] > 0:
        count = go_through_pairs(w)
    else:
        count = look_for_pairs(w)
    w.header.near_count = count
    decide(count, w)


@kernel(separate=True)
def go_through_pairs(w: Workspace) -> int:
    """Judge every pair of a small scene, without the index.

    Returns:
        Count of rows of the answer.
    """
    v, m = w.watch, w.motion
    moving_count, blocks = w.settings.moving_count, v.pair_blocks
    write_looks(w, v, m)
    for j in range(moving_count, v.look.shape[0]):
        v.look[j] = way_of_object(j, v, m)
        grow_box(j, v.look[j] + 0.5 * w.settings.margin, w.world.boxes, v)
    count = filtered = 0
    for b in range(blocks.shape[0]):
        i, first, left = int(blocks[b, 0]), int(blocks[b, 1]), int(blocks[b, 2])
        near = may_meet(b, load(v.block_need[b], 0), v)
        if w.settings.contracts == 0:
            filtered += ones(left & ~near)
            left = near
        while left != 0:
            lane = lowest(left)
            left &= left - 1
            j, need = first + lane, v.block_need[b, lane]
            if j >= moving_count:
                need += v.look[j]
            need, look, known = pair_look(i, j, need, w)
            if look < 0.0:
                filtered += 1
            elif (
                w.octree.residency[j].status != ABSENT
                and w.octree.residency[i].status != ABSENT
            ):
                count = judge_pair(i, j, need, look, known, count, w)
    w.header.pairs_filtered += filtered
    return count


@kernel(separate=True)
def look_for_pairs(w: Workspace) -> int:
    """Judge the pairs that the index finds, or all pairs without an octree.

    Returns:
        Count of rows of the answer.
    """
    v, m = w.watch, w.motion
    candidates = w.candidates
    write_looks(w, v, m)
    widest = widest_look(w, v, m)
    count = 0
    for i in range(w.settings.moving_count):
        if is_idle(i, v.robot_of, w):
            continue
        w.memory.token += 1
        found = candidates_within(i, widest + v.look[i], w)
        wanted = keep_owned(
            i, found, v.robot_of, w.moved, w.groups, w.checked, candidates
        )
        sort_ids(candidates, wanted)
        for c in range(wanted):
            j = candidates[c]
            need = static_need(i, j, w, v, m)
            if j >= w.settings.moving_count:
                need += way_until_look(j, v, m)
            need, look, known = pair_look(i, j, need, w)
            if look < 0.0:
                w.header.pairs_filtered += 1.0
            else:
                count = judge_pair(i, j, need, look, known, count, w)
    return count


@kernel(separate=True)
def judge_pair(
    i: int, j: int, need: float, look: float, known: float, count: int, w: Workspace
) -> int:
    """Measure a pair and prove it, if it may matter; write its row, if it is near.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair, inf if it has to be proven in full [m].
        look: Distance beyond which the pair does not matter [m].
        known: Lower bound of its distance during the stops [m].
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    if not measures_row(i, j, look, count, w):
        return count
    v, near = w.watch, w.near[count]
    distance = near.distance
    if distance > w.settings.margin and is_far_along(i, j, need, known, near, w):
        return count
    open_row(i, j, near, w)
    if not distance - w.buffers[w.groups[i], w.groups[j]] >= 0.0:
        # Links may be farther apart than the primitives that enclose them.
        refine_pair(i, j, near, w)
    judge_motion(i, j, near, w)
    if (
        distance > w.settings.margin
        and near.headroom >= hidden_by_error(i, j, w, v)
        and near.time_left >= HYSTERESIS * v.timing.slow_time
    ):
        note_pair(i, j, NO_ROW, near, w, v)
        return count
    note_pair(i, j, count, near, w, v)
    return count + 1


@kernel
def is_far_along(
    i: int, j: int, need: float, known: float, near: NearRow, w: Workspace
) -> bool:
    """Whether a measured pair cannot matter by its motion along the normal.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair, inf if it has to be proven in full [m].
        known: Lower bound of its distance during the stops [m].
        near: The pair's row; its witness is written already.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    kept = need + v.ahead[i]
    body_i, body_j = w.bodies[i], -1
    if j < m.rate.shape[0]:
        body_j = w.bodies[j]
        kept += v.ahead[j]
    if not near.distance > kept or v.tight[i] == 0 or (body_j >= 0 and v.tight[j] == 0):
        return False
    n = normal_of(near)
    shared = shared_joints(body_i, body_j, m)
    speed = bound_along(SPEED, n, i, j, body_i, body_j, shared, m)
    kept += max(LOOK_AHEAD * v.timing.slow_time * speed, hidden_by_error(i, j, w, v))
    if known >= kept:
        return True
    travel = bound_along(TRAVEL, n, i, j, body_i, body_j, shared, m)
    return bool(near.distance - travel >= kept)


@kernel
def candidates_within(i: int, look: float, w: Workspace) -> int:
    """Ids that may be within a distance of primitive i, each once.

    In the index, moving primitives are grown by the margin. A greater distance is
    searched with a box query.
    """
    residency = w.octree.residency
    if w.settings.index_kind == IndexKind.BRUTE_FORCE:
        return int(present_primitives(i, residency, w.candidates))
    token = w.memory.token
    if look <= w.settings.margin:
        return int(octree_candidates(i, w.octree, w.seen, token, w.candidates))
    for k in range(3):
        w.look_box[k] = w.world.boxes[i, k] - look
        w.look_box[k + 3] = w.world.boxes[i, k + 3] + look
    return int(primitives_in_box(i, w.look_box, w.octree, w.seen, token, w.candidates))
