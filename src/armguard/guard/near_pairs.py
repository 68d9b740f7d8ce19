"""Third step of a cycle: measure each candidate pair once, and judge it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.layout import NearRow, put_witness
from armguard.guard.levels import Reason
from armguard.guard.planes import is_apart, remember_plane
from armguard.guard.refine import refine_pair
from armguard.guard.sorting import sort_ids
from armguard.guard.watch import Watch
from armguard.guard.workspace import IndexKind, Workspace
from armguard.index.joint_cells import table_candidates
from armguard.index.octree_query import (
    octree_candidates,
    present_primitives,
)
from armguard.index.octree_state import ABSENT
from armguard.kernel import kernel
from armguard.lanes import bits, load, lowest, ones, splat
from armguard.motion.pair_state import (
    EXCEEDED,
    NEEDED,
    PROVEN,
    SPENT,
    UNPROVEN,
    UNSURE,
)
from armguard.record import Records, copy
from armguard.table import Matrix

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]

OK = int(Reason.OK)
NEAR = int(Reason.NEAR)
TOO_CLOSE = int(Reason.TOO_CLOSE)
CAPACITY = int(Reason.CAPACITY)
NO_DISTANCE = int(Reason.NO_DISTANCE)
NOTHING_PROVEN = int(Reason.UNPROVEN)
NO_PROOF = int(Reason.NO_PROOF)
BUDGET_SPENT = int(Reason.BUDGET_SPENT)
CONTRACT_EXCEEDED = int(Reason.CONTRACT_EXCEEDED)


@kernel
def judge_pairs(w: Workspace) -> None:
    """Write every checked pair within the margin, in ascending order, and the reason.

    A pair (i, j) belongs to the lower id of its sides that a robot moves: the moving
    primitives have the lowest ids. So each pair is judged once, and the order of the
    answer does not depend on the order of lists in the index.
    """
    w.memory.cycle += 1
    count = (
        judge_listed(w) if w.settings.index_kind == IndexKind.LISTED else judge_found(w)
    )
    w.header.near_count = count
    decide(count, w)
    remember(count, w.kept, w)


@kernel
def judge_listed(w: Workspace) -> int:
    """Judge every pair of a small scene, without the index.

    Returns:
        Count of rows of the answer.
    """
    kept, moved, v = w.kept, w.moved, w.watch
    residency, everything = w.octree.residency, w.groups.shape[0]
    for i in range(everything):
        grow_box(i, 0.5 * w.settings.margin, w.world.boxes, v)
    kept_count = w.memory.kept_count
    next_kept = count = 0
    last = -1
    for b in range(v.pair_blocks.shape[0]):
        block = v.pair_blocks[b]
        i, first, left = int(block[0]), int(block[1]), int(block[2])
        near = may_meet(b, splat(0.0), v)
        if i != last:
            count, next_kept = take_kept(
                last, everything, next_kept, kept_count, count, moved, kept, w
            )
            last = i
        if moved[i]:
            w.header.pairs_filtered += ones(left & ~near)
            left = near
        while left != 0:
            lane = lowest(left)
            j = first + lane
            left &= left - 1
            if not (moved[i] or moved[j]):
                continue
            if residency[i].status == ABSENT or residency[j].status == ABSENT:
                continue
            if near >> lane & 1 == 0:
                w.header.pairs_filtered += 1.0
                continue
            count, next_kept = take_kept(
                i, j, next_kept, kept_count, count, moved, kept, w
            )
            count = judge_candidate(i, j, count, w)
    count, _ = take_kept(last, everything, next_kept, kept_count, count, moved, kept, w)
    return int(count)


@kernel
def grow_box(i: int, way: float, boxes: Matrix, v: Watch) -> None:
    """Write a bounding box, grown on all sides, as the swept box of a primitive."""
    for k in range(3):
        v.swept[k, i] = boxes[i, k] - way
        v.swept[k + 3, i] = boxes[i, k + 3] + way


@kernel
def may_meet(block: int, need: Any, v: Watch) -> int:
    """Bits of the pairs of a block whose swept boxes are no farther apart than a need.

    A NaN compares false, so that the pair is measured and the NaN is seen.

    Args:
        block: The block, see `Watch.pair_blocks`.
        need: The need of each pair, as lanes [m].
        v: Watch; the swept boxes are written already.
    """
    row, swept = v.pair_blocks[block], v.swept
    i, first = int(row[0]), int(row[1])
    apart = swept[0, i] - load(swept[3], first) > need
    apart = apart | (load(swept[0], first) - swept[3, i] > need)
    for k in range(1, 3):
        apart = apart | (swept[k, i] - load(swept[k + 3], first) > need)
        apart = apart | (load(swept[k], first) - swept[k + 3, i] > need)
    return int(row[2]) & ~bits(apart)


@kernel
def judge_found(w: Workspace) -> int:
    """Judge the pairs that the index finds.

    Returns:
        Count of rows of the answer.
    """
    kept, memory, candidates = w.kept, w.memory, w.candidates
    moved, everything = w.moved, w.groups.shape[0]
    robots = w.watch.robot_of
    kept_count = memory.kept_count
    next_kept = count = 0
    for i in range(w.settings.moving_count):
        if is_idle(i, robots, w):
            continue
        memory.token += 1
        found = index_candidates(i, memory.token, w)
        wanted = keep_owned(i, found, robots, moved, w.groups, w.checked, candidates)
        sort_ids(candidates, wanted)
        for c in range(wanted):
            j = candidates[c]
            count, next_kept = take_kept(
                i, j, next_kept, kept_count, count, moved, kept, w
            )
            if boxes_apart(w.world.boxes, i, j, w.settings.margin):
                w.header.pairs_filtered += 1.0
            else:
                count = judge_candidate(i, j, count, w)
        count, next_kept = take_kept(
            i, everything, next_kept, kept_count, count, moved, kept, w
        )
    return count


@kernel
def judge_candidate(i: int, j: int, count: int, w: Workspace) -> int:
    """Measure a pair, and write its row if it is within the margin.

    Returns:
        New count of rows.
    """
    if not measures_row(i, j, w.settings.margin, count, w):
        return count
    near = w.near[count]
    open_row(i, j, near, w)
    required = near.buffer
    if not near.distance - required >= 0.0:
        refine_pair(i, j, near, w)
    near.headroom = near.distance - required
    if not near.headroom >= 0.0:
        near.proof = NEEDED
    return count + 1


@kernel
def measures_row(i: int, j: int, look: float, count: int, w: Workspace) -> bool:
    """Measure a pair into the next row of the answer.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        look: Distance beyond which the pair does not matter [m].
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        False if the pair does not matter, or there is no room.
    """
    out, kinds, rows = w.header, w.world.kinds, w.world.rows
    if is_apart(i, j, look, w):
        out.pairs_apart += 1.0
        return False
    out.pairs_tested += 1.0
    if count == w.kept.shape[0]:
        out.reason = CAPACITY
        return False
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    measure(kinds[i], rows[i], kinds[j], rows[j], witness)
    if witness[0] > look:
        remember_plane(i, j, w, witness)
        return False
    put_witness(witness, w.near[count])
    return True


@kernel
def open_row(i: int, j: int, near: NearRow, w: Workspace) -> None:
    """Initialise the row of a near pair whose witness was measured."""
    near.first, near.second = i, j
    near.buffer = w.buffers[w.groups[i], w.groups[j]]
    near.outer = near.distance
    near.exact = np.inf
    near.time_left = near.time_to_contact = np.inf
    near.proof = PROVEN
    near.envelope = 0.0


@kernel
def index_candidates(i: int, token: int, w: Workspace) -> int:
    """Ids that may be near primitive i, each once: by the index, or all of them."""
    residency, kind = w.octree.residency, w.settings.index_kind
    if kind == IndexKind.BRUTE_FORCE:
        return int(present_primitives(i, residency, w.candidates))
    if kind == IndexKind.JOINT_TABLE:
        return int(table_candidates(i, w.joint_cells, residency, w.candidates))
    return int(octree_candidates(i, w.octree, w.seen, token, w.candidates))


@kernel
def is_idle(i: int, robots: Ints, w: Workspace) -> bool:
    """Whether a moving primitive owns no pair: no robot moves it, or it is absent."""
    return bool(robots[i] < 0 or w.octree.residency[i].status == ABSENT)


@kernel
def keep_owned(
    i: int,
    found: int,
    robots: Ints,
    moved: Bytes,
    groups: Ints,
    checked: Bytes,
    candidates: Ints,
) -> int:
    """Drop candidates that are not checked, belong to another id, or did not move.

    Args:
        i: The lower id of the pairs.
        found: Candidates.
        robots: Robot of each moving primitive, -1 for a free object, shape (m,).
        moved: 1 where a primitive moved in this cycle, shape (p,).
        groups: Rule group of each primitive, shape (p,).
        checked: 1 where two groups are checked, shape (g, g).
        candidates: Ids; the remaining ones are moved to the front.

    Returns:
        Count of remaining candidates.
    """
    wanted = 0
    for c in range(found):
        j = candidates[c]
        if j <= i and j < robots.shape[0] and robots[j] >= 0:
            continue
        if checked[groups[i], groups[j]] and (moved[i] or moved[j]):
            candidates[wanted] = j
            wanted += 1
    return wanted


@kernel
def take_kept(
    i: int,
    before: int,
    next_kept: int,
    kept_count: int,
    count: int,
    moved: Bytes,
    kept: Records[NearRow],
    w: Workspace,
) -> tuple[int, int]:
    """Copy the kept rows of pairs (i, j < before) whose two sides did not move.

    Args:
        i: Lower id of the pairs.
        before: Upper bound of their higher ids, excluded.
        next_kept: Index of the next kept row.
        kept_count: Count of kept rows.
        count: Count of rows written so far.
        moved: 1 where a primitive moved in this cycle, shape (p,).
        kept: Rows of the last valid cycle.
        w: Workspace; the rows go to its answer.

    Returns:
        New count of rows, and the index of the next kept row.
    """
    while next_kept < kept_count:
        row = kept[next_kept]
        first, second = int(row.first), int(row.second)
        if first > i or (first == i and second >= before):
            break
        if first == i and not (moved[first] or moved[second]):
            if count == kept.shape[0]:
                w.header.reason = CAPACITY
                break
            copy(row, w.near[count])
            w.header.pairs_kept += 1.0
            count += 1
        next_kept += 1
    return count, next_kept


@kernel
def boxes_apart(boxes: Floats, i: int, j: int, margin: float) -> bool:
    """Whether two bounding boxes are farther apart than the margin on some axis.

    A NaN compares false, so that the pair is measured and the NaN is seen.
    """
    for k in range(3):
        if (
            boxes[i, k] - boxes[j, k + 3] > margin
            or boxes[j, k] - boxes[i, k + 3] > margin
        ):
            return True
    return False


@kernel
def decide(count: int, w: Workspace) -> None:
    """Find the pair with the least headroom, and write the reason that follows."""
    out = w.header
    nearest = -1
    least = np.inf
    reason = NEAR if count > 0 else OK
    for k in range(count):
        headroom = w.near[k].headroom
        if headroom != headroom:
            reason = NO_DISTANCE
            nearest = k
            break
        if headroom < least:
            least = headroom
            nearest = k
            if not headroom >= 0.0:
                reason = reason_of(int(w.near[k].proof))
    out.nearest = nearest
    if out.reason == OK:
        out.reason = reason


@kernel
def reason_of(proof: int) -> int:
    """Reason of a pair by the result of its proof."""
    if proof == UNSURE:
        return NO_PROOF
    if proof == EXCEEDED:
        return CONTRACT_EXCEEDED
    if proof == UNPROVEN:
        return NOTHING_PROVEN
    return BUDGET_SPENT if proof == SPENT else TOO_CLOSE


@kernel
def remember(count: int, kept: Records[NearRow], w: Workspace) -> None:
    """Keep this cycle's rows for the next one, unless some are missing."""
    out, memory = w.header, w.memory
    if out.reason == CAPACITY or out.reason == NO_DISTANCE:
        memory.kept_count = 0
        memory.measure_all = 1
        return
    for k in range(count):
        copy(w.near[k], kept[k])
    memory.kept_count = count
    memory.measure_all = 0
