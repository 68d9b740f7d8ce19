"""The pairs of a cycle with predicted stops: search, measurement and proof."""

from math import inf

from armguard.geometry.pairs import measure
from armguard.guard.change import NO_ROW, begin_notes, note_pair
from armguard.guard.demands import judge_motion
from armguard.guard.layout import (
    HEADROOM,
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
    is_idle,
    keep_owned,
    open_row,
    row_place,
)
from armguard.guard.needs import (
    LOOK_AHEAD,
    look_distance,
    object_speed,
    static_need,
    time_since,
)
from armguard.guard.planes import is_apart, remember_plane
from armguard.guard.refine import refine_pair
from armguard.guard.sorting import sort_ids
from armguard.guard.watch import (
    COMMANDED,
    FEW,
    HYSTERESIS,
    SLOW_TIME,
    Watch,
)
from armguard.guard.workspace import (
    BRUTE_FORCE,
    INDEX_KIND,
    MOVING_COUNT,
    Workspace,
)
from armguard.index.octree_query import (
    octree_candidates,
    present_primitives,
    primitives_in_box,
)
from armguard.index.octree_state import ABSENT, STATUS
from armguard.kernel import kernel
from armguard.motion.state import SEGMENT, SETTLED, Motion

# Search distance beyond the travel of the pending commands, for desired ones [m].
LOOK_MORE = 5e-3


@kernel
def asks_index(w: Workspace) -> int:
    """1 if the pairs of this scene are searched in its index, else 0."""
    return int(w.groups.shape[0] > FEW and w.settings[INDEX_KIND] != BRUTE_FORCE)


@kernel(separate=True)
def judge_motions(w: Workspace) -> None:
    """Measure and prove every pair that may matter to a stop, and write near pairs.

    The order of pairs is that of `judge_pairs`. No row is kept from cycle to cycle: the
    required separation may change although a pair does not move.
    """
    v = w.watch
    w.memory[CYCLE] += 1
    w.memory[KEPT_COUNT] = 0
    begin_notes(v, w.motion)
    if v.pairs.shape[0] > 0:
        count = go_through_pairs(w)
    else:
        count = look_for_pairs(w)
    w.out[NEAR_COUNT] = count
    decide(count, w)


@kernel(separate=True)
def go_through_pairs(w: Workspace) -> int:
    """Judge every pair of a small scene, without the index.

    Returns:
        Count of rows of the answer.
    """
    v, m = w.watch, w.motion
    boxes, margin = w.world.boxes, w.margin[0]
    moving_count = w.settings[MOVING_COUNT]
    write_looks(w, v, m)
    for j in range(moving_count, v.look.shape[0]):
        v.look[j] = way_of_object(j, v, m)
    count = filtered = 0
    for k in range(v.pairs.shape[0]):
        i, j = int(v.pairs[k, 0]), int(v.pairs[k, 1])
        look = max(margin, v.pair_need[k] + v.look[i] + v.look[j])
        if boxes_apart(boxes, i, j, look):
            filtered += 1
        elif (
            w.octree.residency[j, STATUS] != ABSENT
            and w.octree.residency[i, STATUS] != ABSENT
        ):
            count = judge_pair(i, j, look, count, w)
    w.out[PAIRS_FILTERED] += filtered
    return count


@kernel(separate=True)
def look_for_pairs(w: Workspace) -> int:
    """Judge the pairs that the index finds, or all pairs without an octree.

    Returns:
        Count of rows of the answer.
    """
    v, m = w.watch, w.motion
    candidates, boxes = w.candidates, w.world.boxes
    write_looks(w, v, m)
    widest = widest_look(w, v, m)
    count = 0
    for i in range(w.settings[MOVING_COUNT]):
        if is_idle(i, v.robot_of, w):
            continue
        w.memory[TOKEN] += 1
        found = candidates_within(i, widest + v.look[i], w)
        wanted = keep_owned(
            i, found, v.robot_of, w.moved, w.groups, w.checked, candidates
        )
        sort_ids(candidates, wanted)
        for c in range(wanted):
            j = candidates[c]
            look = max(w.margin[0], pair_look(i, j, w, v, m))
            if boxes_apart(boxes, i, j, look):
                w.out[PAIRS_FILTERED] += 1.0
            else:
                count = judge_pair(i, j, look, count, w)
    return count


@kernel(separate=True)
def judge_pair(i: int, j: int, look: float, count: int, w: Workspace) -> int:
    """Measure a pair and prove it, if it may matter; write its row, if it is near.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        look: Distance beyond which the pair does not matter [m].
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    v, out, kinds, rows = w.watch, w.out, w.world.kinds, w.world.rows
    if is_apart(i, j, look, w):
        out[PAIRS_APART] += 1.0
        return count
    out[PAIRS_TESTED] += 1.0
    if count == w.kept.shape[0]:
        out[REASON] = CAPACITY
        return count
    place = row_place(count, w)
    witness = out[place + WITNESS : place + NEAR_WIDTH]
    measure(kinds[i], rows[i], kinds[j], rows[j], witness)
    if witness[0] > look:
        remember_plane(i, j, w, witness)
        return count
    open_row(i, j, place, w)
    distance = witness[0]
    if not distance - w.buffers[w.groups[i], w.groups[j]] >= 0.0:
        # Links may be farther apart than the primitives that enclose them.
        refine_pair(i, j, place, w)
    judge_motion(i, j, place, w)
    if (
        distance > w.margin[0]
        and out[place + HEADROOM] >= hidden_by_error(i, j, w, v)
        and out[place + TIME_LEFT] >= HYSTERESIS * v.pace[SLOW_TIME]
    ):
        note_pair(i, j, NO_ROW, place, w, v)
        return count
    note_pair(i, j, count, place, w, v)
    return count + 1


@kernel
def hidden_by_error(i: int, j: int, w: Workspace, v: Watch) -> float:
    """Greatest measured headroom, due to position errors, of a pair without any [m].

    Where commands go through the guard, such a pair is reported in every cycle, not
    only in those that measure it nearer: the response needs it to choose a command.
    """
    if v.given[COMMANDED] == 0.0:
        return 0.0
    m = w.motion
    blur = m.blur[i]
    if j < w.settings[MOVING_COUNT]:
        blur += m.blur[j]
    return float(2.0 * blur)


@kernel
def write_looks(w: Workspace, v: Watch, m: Motion) -> None:
    """Write the search distance of each moving primitive.

    Where commands go through the guard, it covers new commands of this cycle as well.
    """
    more = LOOK_MORE if v.given[COMMANDED] != 0.0 else 0.0
    for i in range(w.settings[MOVING_COUNT]):
        v.look[i] = look_distance(i, v, m) + more


@kernel
def pair_look(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Distance beyond which a pair cannot matter to this cycle's proof [m]."""
    look = static_need(i, j, w, v, m) + v.look[i]
    if j < w.settings[MOVING_COUNT]:
        return float(look + v.look[j])
    if m.span[SEGMENT] != 0.0:
        return float(look)
    return float(look + object_speed(j, v) * time_ahead(v, m))


@kernel
def way_of_object(j: int, v: Watch, m: Motion) -> float:
    """Greatest displacement of an object, from its sighting to the look-ahead [m]."""
    speed = object_speed(j, v)
    if speed == 0.0 or m.span[SEGMENT] != 0.0:
        return 0.0
    return float(speed * (time_since(v.seen_at[j], v, m) + time_ahead(v, m)))


@kernel
def time_ahead(v: Watch, m: Motion) -> float:
    """Look-ahead: time from now after which a contact is not reported [s]."""
    return float(m.span[SETTLED] + LOOK_AHEAD * v.pace[SLOW_TIME])


@kernel
def candidates_within(i: int, look: float, w: Workspace) -> int:
    """Ids that may be within a distance of primitive i, each once.

    In the index, moving primitives are grown by the margin. A greater distance is
    searched with a box query.
    """
    residency = w.octree.residency
    if w.settings[INDEX_KIND] == BRUTE_FORCE:
        return int(present_primitives(i, residency, w.candidates))
    token = w.memory[TOKEN]
    if look <= w.margin[0]:
        return int(octree_candidates(i, w.octree, w.seen, token, w.candidates))
    for k in range(3):
        w.look_box[k] = w.world.boxes[i, k] - look
        w.look_box[k + 3] = w.world.boxes[i, k + 3] + look
    return int(primitives_in_box(i, w.look_box, w.octree, w.seen, token, w.candidates))


@kernel
def widest_look(w: Workspace, v: Watch, m: Motion) -> float:
    """Greatest search distance that the other side of a pair can require [m]."""
    farthest = 0.0
    for i in range(w.settings[MOVING_COUNT]):
        farthest = max(farthest, v.look[i])
    fastest = 0.0
    seen = inf
    for k in range(v.movers.shape[0]):
        j = v.movers[k]
        fastest = max(fastest, v.top_speed[j])
        seen = min(seen, v.seen_at[j])
    drift = 0.0
    if fastest > 0.0 and m.span[SEGMENT] == 0.0:
        drift = fastest * (time_ahead(v, m) + time_since(seen, v, m))
    return float(farthest + drift + w.look[0])
