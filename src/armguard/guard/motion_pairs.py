"""The pairs of a guarded cycle: as far as a stop can matter, measured and proven."""

from math import inf

from armguard.geometry.pairs import measure
from armguard.guard.layout import (
    CLEARANCE,
    NEAR_COUNT,
    NEAR_WIDTH,
    PAIRS_APART,
    PAIRS_FILTERED,
    PAIRS_TESTED,
    REASON,
    TIME_LEFT,
    WITNESS,
)
from armguard.guard.memory import CYCLE, KEPT_COUNT, TOKEN
from armguard.guard.near_pairs import (
    CAPACITY,
    boxes_apart,
    decide,
    keep_owned,
    open_row,
    row_place,
)
from armguard.guard.observe import now_of
from armguard.guard.planes import is_apart, remember_plane
from armguard.guard.proofs import (
    LOOK_AHEAD,
    judge_motion,
    look_distance,
    object_speed,
    standing_need,
)
from armguard.guard.refine import refine_pair
from armguard.guard.sorting import sort_ids
from armguard.guard.watch import HYSTERESIS, SLOW_TIME, Watch, open_watch
from armguard.guard.workspace import (
    BRUTE_FORCE,
    INDEX_KIND,
    MOTION,
    MOVING_COUNT,
    WATCH,
    Workspace,
    open_workspace,
)
from armguard.index.octree_query import (
    octree_candidates,
    present_primitives,
    primitives_in_box,
)
from armguard.kernel import kernel
from armguard.ledger import ledger_at
from armguard.motion.state import SEGMENT, SETTLED, Motion, open_motion

# In a scene of so few primitives it takes less time to ask all than to look for them.
FEW = 128


@kernel(inline=False)
def judge_motions(lines: int) -> None:
    """Measure every pair that may matter to a stop, prove it, and write what is near.

    The pairs are met in the same order as where buffers are fixed. Nothing is kept
    from cycle to cycle: a pair that stands still may still be in need of another
    distance.
    """
    w = open_workspace(ledger_at(lines))
    v, m = open_watch(w.parts[WATCH]), open_motion(w.parts[MOTION])
    out, memory, candidates = w.out, w.memory, w.candidates
    kinds, rows, boxes = w.world.kinds, w.world.rows, w.world.boxes
    margin = w.margin[0]
    moving_count = w.settings[MOVING_COUNT]
    memory[CYCLE] += 1
    memory[KEPT_COUNT] = 0
    widest = widest_look(w, v, m)
    count = 0
    for i in range(moving_count):
        memory[TOKEN] += 1
        found = candidates_within(i, widest + look_distance(i, v, m), w)
        wanted = keep_owned(
            i, found, moving_count, w.moved, w.groups, w.checked, candidates
        )
        sort_ids(candidates, wanted)
        for c in range(wanted):
            j = candidates[c]
            look = max(margin, pair_look(i, j, w, v, m))
            if boxes_apart(boxes, i, j, look):
                out[PAIRS_FILTERED] += 1.0
                continue
            if is_apart(i, j, look, w):
                out[PAIRS_APART] += 1.0
                continue
            out[PAIRS_TESTED] += 1.0
            if count == w.kept.shape[0]:
                out[REASON] = CAPACITY
                continue
            place = row_place(count, w)
            witness = out[place + WITNESS : place + NEAR_WIDTH]
            measure(kinds[i], rows[i], kinds[j], rows[j], witness)
            if witness[0] > look:
                remember_plane(i, j, w, witness)
                continue
            open_row(i, j, place, w)
            judge_motion(i, j, place, lines)
            if (
                witness[0] > margin
                and out[place + CLEARANCE] >= 0.0
                and out[place + TIME_LEFT] >= HYSTERESIS * v.pace[SLOW_TIME]
            ):
                continue
            if not witness[0] - w.buffers[w.groups[i], w.groups[j]] >= 0.0:
                refine_pair(i, j, place, w)
            count += 1
    out[NEAR_COUNT] = count
    decide(count, w)


@kernel
def pair_look(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Beyond this distance a pair cannot matter to this cycle's proof [m]."""
    look = standing_need(i, j, w, v, m) + look_distance(i, v, m)
    if j < w.settings[MOVING_COUNT]:
        return float(look + look_distance(j, v, m))
    if m.span[SEGMENT] != 0.0:
        return float(look)
    ahead = m.span[SETTLED] + LOOK_AHEAD * v.pace[SLOW_TIME]
    return float(look + object_speed(j, v) * ahead)


@kernel
def candidates_within(i: int, look: float, w: Workspace) -> int:
    """Ids that may be within a distance of primitive i, each once.

    The index holds what moves with the margin. What may matter farther away than that
    is looked for in a box, or in a small scene among all.
    """
    residency = w.octree.residency
    if w.settings[INDEX_KIND] == BRUTE_FORCE:
        return int(present_primitives(i, residency, w.candidates))
    token = w.memory[TOKEN]
    if look <= w.margin[0]:
        return int(octree_candidates(i, w.octree, w.seen, token, w.candidates))
    if w.groups.shape[0] <= FEW:
        return int(present_primitives(i, residency, w.candidates))
    for k in range(3):
        w.look_box[k] = w.world.boxes[i, k] - look
        w.look_box[k + 3] = w.world.boxes[i, k + 3] + look
    return int(primitives_in_box(i, w.look_box, w.octree, w.seen, token, w.candidates))


@kernel
def widest_look(w: Workspace, v: Watch, m: Motion) -> float:
    """How far any primitive must look for the sake of what it may meet [m]."""
    farthest = 0.0
    for i in range(w.settings[MOVING_COUNT]):
        farthest = max(farthest, look_distance(i, v, m))
    fastest = 0.0
    seen = inf
    for k in range(v.movers.shape[0]):
        j = v.movers[k]
        fastest = max(fastest, v.top_speed[j])
        seen = min(seen, v.seen_at[j])
    drift = 0.0
    if fastest > 0.0 and m.span[SEGMENT] == 0.0:
        ahead = m.span[SETTLED] + LOOK_AHEAD * v.pace[SLOW_TIME]
        drift = fastest * (ahead + max(now_of(v) - seen, 0.0))
    return float(farthest + drift + w.look[0])
