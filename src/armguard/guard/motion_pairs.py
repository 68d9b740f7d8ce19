"""The pairs of a cycle with predicted stops: search, measurement and proof."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.change import begin_notes
from armguard.guard.judged_pair import judge_pair
from armguard.guard.near_pairs import (
    decide,
    grow_box,
    index_candidates,
    is_idle,
    keep_owned,
    may_meet,
)
from armguard.guard.needs import static_need
from armguard.guard.reindex import has_tree
from armguard.guard.search_distance import (
    pair_look,
    way_of_object,
    way_until_look,
    widest_look,
    write_looks,
)
from armguard.guard.sensed_pairs import judge_sensed
from armguard.guard.sorting import sort_ids
from armguard.guard.watch import FEW
from armguard.guard.workspace import IndexKind, Workspace
from armguard.index.octree_query import present_primitives, primitives_in_box
from armguard.index.octree_state import ABSENT
from armguard.kernel import kernel
from armguard.lanes import load, lowest, ones

Floats = NDArray[np.float64]


@kernel
def asks_index(w: Workspace) -> int:
    """1 if the pairs of this scene are searched in its index, else 0."""
    searched = w.settings.index_kind != IndexKind.BRUTE_FORCE
    return int(w.settings.modelled > FEW and searched)


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
    if w.settings.sensed != 0:
        count = judge_sensed(count, w)
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
    for j in range(moving_count, w.settings.modelled):
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


@kernel
def candidates_within(i: int, look: float, w: Workspace) -> int:
    """Ids that may be within a distance of primitive i, each once.

    An index finds what is within the margin. A greater distance is searched in the
    octree with a box query; other indices do not know what is within it.
    """
    token = w.memory.token
    if look <= w.settings.margin:
        return int(index_candidates(i, token, w))
    if not has_tree(w):
        return int(present_primitives(i, w.octree.residency, w.candidates))
    for k in range(3):
        w.look_box[k] = w.world.boxes[i, k] - look
        w.look_box[k + 3] = w.world.boxes[i, k + 3] + look
    return int(primitives_in_box(i, w.look_box, w.octree, w.seen, token, w.candidates))
