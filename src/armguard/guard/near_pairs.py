"""Third step of a cycle: measure each candidate pair once, and judge it."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pairs import measure
from armguard.guard.layout import (
    BUFFER,
    CLEARANCE,
    FIRST,
    HEADER,
    NEAR_COUNT,
    NEAR_WIDTH,
    NEAREST,
    PAIRS_FILTERED,
    PAIRS_KEPT,
    PAIRS_TESTED,
    REASON,
    SECOND,
    WITNESS,
)
from armguard.guard.levels import Reason
from armguard.guard.memory import FORCE, KEPT_COUNT, TOKEN
from armguard.guard.sorting import sort_ids
from armguard.guard.reindex import BRUTE_FORCE
from armguard.index.octree_query import octree_candidates, present_primitives
from armguard.index.octree_state import OctreeState
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]

OK = int(Reason.OK)
NEAR = int(Reason.NEAR)
TOO_CLOSE = int(Reason.TOO_CLOSE)
CAPACITY = int(Reason.CAPACITY)
NO_DISTANCE = int(Reason.NO_DISTANCE)


@kernel
def judge_pairs(
    index_kind: int,
    moving_count: int,
    world: World,
    groups: Ints,
    checked: Bytes,
    buffers: Floats,
    margin: float,
    bodies: Ints,
    body_moved: Bytes,
    octree: OctreeState,
    candidates: Ints,
    seen: Longs,
    kept: Floats,
    memory: Longs,
    out: Floats,
) -> None:
    """Write every checked pair within the margin, in ascending order, and the reason.

    A pair (i, j) belongs to its lower id, which always moves: the moving primitives
    come first. So each pair is met once, and the order of the answer does not depend
    on how the index happens to store its lists.
    """
    kept_count = memory[KEPT_COUNT]
    capacity = kept.shape[0]
    next_kept = 0
    count = 0
    for i in range(moving_count):
        moved = body_moved[bodies[i]] != 0
        while next_kept < kept_count and kept[next_kept, FIRST] < i:
            next_kept += 1
        memory[TOKEN] += 1
        found = index_candidates(
            index_kind, i, octree, seen, memory[TOKEN], candidates
        )
        wanted = keep_owned(
            i, moved, found, moving_count, groups, checked, bodies, body_moved,
            candidates,
        )  # fmt: skip
        sort_ids(candidates, wanted)
        for c in range(wanted):
            j = candidates[c]
            count, next_kept = take_kept(
                i, j, moved, moving_count, bodies, body_moved, kept, next_kept,
                kept_count, count, capacity, out,
            )  # fmt: skip
            if boxes_apart(world.boxes, i, j, margin):
                out[PAIRS_FILTERED] += 1.0
                continue
            out[PAIRS_TESTED] += 1.0
            if count == capacity:
                out[REASON] = CAPACITY
                continue
            place = HEADER + count * NEAR_WIDTH
            measure(
                world.kinds[i], world.rows[i], world.kinds[j], world.rows[j],
                out[place + WITNESS : place + NEAR_WIDTH],
            )  # fmt: skip
            if out[place + WITNESS] > margin:
                continue
            required = buffers[groups[i], groups[j]]
            out[place + FIRST] = i
            out[place + SECOND] = j
            out[place + BUFFER] = required
            out[place + CLEARANCE] = out[place + WITNESS] - required
            count += 1
        count, next_kept = take_kept(
            i, groups.shape[0], moved, moving_count, bodies, body_moved, kept,
            next_kept, kept_count, count, capacity, out,
        )  # fmt: skip
    out[NEAR_COUNT] = count
    decide(count, out)
    remember(count, kept, memory, out)


@kernel
def index_candidates(
    index_kind: int,
    i: int,
    octree: OctreeState,
    seen: Longs,
    token: int,
    candidates: Ints,
) -> int:
    """Ids that may be near primitive i, each once: by the octree or simply all."""
    if index_kind == BRUTE_FORCE:
        return int(present_primitives(i, octree.residency, candidates))
    return int(octree_candidates(i, octree, seen, token, candidates))


@kernel
def keep_owned(
    i: int,
    moved: bool,
    found: int,
    moving_count: int,
    groups: Ints,
    checked: Bytes,
    bodies: Ints,
    body_moved: Bytes,
    candidates: Ints,
) -> int:
    """Drop candidates that are not checked, belong to another id, or did not move."""
    group = groups[i]
    wanted = 0
    for c in range(found):
        j = candidates[c]
        if j <= i and j < moving_count:
            continue
        if not checked[group, groups[j]]:
            continue
        if not moved and not (j < moving_count and body_moved[bodies[j]]):
            continue
        candidates[wanted] = j
        wanted += 1
    return wanted


@kernel
def take_kept(
    i: int,
    before: int,
    moved: bool,
    moving_count: int,
    bodies: Ints,
    body_moved: Bytes,
    kept: Floats,
    next_kept: int,
    kept_count: int,
    count: int,
    capacity: int,
    out: Floats,
) -> tuple[int, int]:
    """Take over the rows of (i, j < before) whose two sides both stood still.

    Returns:
        The number of rows written so far, and the next kept row to look at.
    """
    while next_kept < kept_count and kept[next_kept, FIRST] == i:
        j = int(kept[next_kept, SECOND])
        if j >= before:
            break
        still = not moved and not (j < moving_count and body_moved[bodies[j]])
        if still and count < capacity:
            place = HEADER + count * NEAR_WIDTH
            out[place : place + NEAR_WIDTH] = kept[next_kept]
            out[PAIRS_KEPT] += 1.0
            count += 1
        elif still:
            out[REASON] = CAPACITY
        next_kept += 1
    return count, next_kept


@kernel
def boxes_apart(boxes: Floats, i: int, j: int, margin: float) -> bool:
    """Whether two bounding boxes are farther apart than the margin on some axis.

    A NaN compares false, so that the pair is measured and the NaN is seen.
    """
    for k in range(3):
        if boxes[i, k] - boxes[j, k + 3] > margin:
            return True
        if boxes[j, k] - boxes[i, k + 3] > margin:
            return True
    return False


@kernel
def decide(count: int, out: Floats) -> None:
    """Find the pair with the least clearance and the reason it leads to."""
    nearest = -1
    least = np.inf
    reason = NEAR if count > 0 else OK
    for k in range(count):
        clearance = out[HEADER + k * NEAR_WIDTH + CLEARANCE]
        if clearance != clearance:
            reason = NO_DISTANCE
            nearest = k
            break
        if clearance < least:
            least = clearance
            nearest = k
        if not clearance >= 0.0:
            reason = TOO_CLOSE
    out[NEAREST] = nearest
    if out[REASON] == OK:
        out[REASON] = reason


@kernel
def remember(count: int, kept: Floats, memory: Longs, out: Floats) -> None:
    """Keep this cycle's rows for the next, unless some are missing."""
    if out[REASON] == CAPACITY or out[REASON] == NO_DISTANCE:
        memory[KEPT_COUNT] = 0
        memory[FORCE] = 1
        return
    for k in range(count):
        place = HEADER + k * NEAR_WIDTH
        kept[k] = out[place : place + NEAR_WIDTH]
    memory[KEPT_COUNT] = count
    memory[FORCE] = 0
