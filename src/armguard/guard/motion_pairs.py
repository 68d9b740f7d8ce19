"""The pairs of a cycle with predicted stops: search, measurement and proof."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.guard.change import NO_ROW, begin_notes, note_pair
from armguard.guard.demands import judge_motion
from armguard.guard.layout import NearRow, normal_of
from armguard.guard.near_pairs import (
    boxes_apart,
    decide,
    is_idle,
    keep_owned,
    measures_row,
    open_row,
)
from armguard.guard.needs import (
    LOOK_AHEAD,
    look_distance,
    object_speed,
    robot_of,
    static_need,
    time_since,
)
from armguard.guard.proofs import coarse
from armguard.guard.refine import refine_pair
from armguard.guard.sorting import sort_ids
from armguard.guard.watch import FEW, HYSTERESIS, RECOVERING, Watch
from armguard.guard.workspace import IndexKind, Workspace
from armguard.index.octree_query import (
    octree_candidates,
    present_primitives,
    primitives_in_box,
)
from armguard.index.octree_state import ABSENT
from armguard.kernel import kernel
from armguard.motion.pair_proof import shared_joints
from armguard.motion.state import NEXT, Motion
from armguard.motion.twist_bound import (
    SPEED,
    TRAVEL,
    bound_along,
    bound_twists,
    middle_gap,
    own_bound,
    place_at_middle,
    relative_bound,
)

Floats = NDArray[np.float64]

# Search distance beyond the travel of the pending commands, for desired ones [m].
LOOK_MORE = 5e-3

# Time for which a primitive's present motion is searched beyond that: the faster it
# moves, the more a new command changes its stop [s].
AHEAD_TIME = 1.5e-2


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
    if v.pairs.shape[0] > 0:
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
    boxes, margin = w.world.boxes, w.settings.margin
    moving_count = w.settings.moving_count
    write_looks(w, v, m)
    for j in range(moving_count, v.look.shape[0]):
        v.look[j] = way_of_object(j, v, m)
    count = filtered = 0
    contracts = w.settings.contracts != 0
    for k in range(v.pairs.shape[0]):
        i, j = int(v.pairs[k, 0]), int(v.pairs[k, 1])
        need, look = v.pair_need[k], v.look[i] + v.look[j]
        if j >= moving_count:
            need, look = need + v.look[j], v.look[i]
        look += need
        if contracts and w.grips.may[w.groups[i], w.groups[j]] != 0:
            look = need + lever_look(i, v, m)
            look += lever_look(j, v, m) if j < moving_count else 0.0
            need = inf
        elif boxes_apart(boxes, i, j, max(margin, look)):
            filtered += 1
            continue
        else:
            look = closer_look(i, j, need, look, w)
        look = max(margin, look)
        if farther(boxes, i, j, look):
            filtered += 1
        elif (
            w.octree.residency[j].status != ABSENT
            and w.octree.residency[i].status != ABSENT
        ):
            count = judge_pair(i, j, need, look, count, w)
    w.header.pairs_filtered += filtered
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
            need, look = pair_look(i, j, w, v, m)
            look = max(w.settings.margin, look)
            if farther(boxes, i, j, look):
                w.header.pairs_filtered += 1.0
            else:
                count = judge_pair(i, j, need, look, count, w)
    return count


@kernel(separate=True)
def judge_pair(
    i: int, j: int, need: float, look: float, count: int, w: Workspace
) -> int:
    """Measure a pair and prove it, if it may matter; write its row, if it is near.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair, inf if it has to be proven in full [m].
        look: Distance beyond which the pair does not matter [m].
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    if not measures_row(i, j, look, count, w):
        return count
    v, near = w.watch, w.near[count]
    distance = near.distance
    if distance > w.settings.margin and is_far_along(i, j, need, near, w):
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
def is_far_along(i: int, j: int, need: float, near: NearRow, w: Workspace) -> bool:
    """Whether a measured pair cannot matter by its motion along the normal.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair, inf if it has to be proven in full [m].
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
    travel = bound_along(TRAVEL, n, i, j, body_i, body_j, shared, m)
    if near.distance - travel >= kept:
        return True
    if m.effort.at_middle == 0:
        place_at_middle(w.bodies, w.T_world, m)
    boxes = w.world.boxes
    return bool(middle_gap(i, j, body_i, body_j, shared, boxes, m) >= kept)


@kernel
def hidden_by_error(i: int, j: int, w: Workspace, v: Watch) -> float:
    """Greatest measured headroom, due to position errors, of a pair without any [m].

    Where commands go through the guard, such a pair is reported in every cycle, not
    only in those that measure it nearer: the response needs it to choose a command.
    """
    m = w.motion
    found = hidden(i, v, m)
    if j < w.settings.moving_count:
        found += hidden(j, v, m)
    return float(found)


@kernel
def hidden(i: int, v: Watch, m: Motion) -> float:
    """A primitive's part of that headroom [m]."""
    return 2.0 * m.blur[i] if v.given.commanded != 0 else 0.0


@kernel
def write_looks(w: Workspace, v: Watch, m: Motion) -> None:
    """Write the search distance of each moving primitive.

    Where commands go through the guard, it covers new commands of this cycle as well.
    """
    if m.span.segment == 0:
        bound_twists(w.world.boxes, w.bodies, m)
    time = LOOK_AHEAD * v.timing.slow_time
    for i in range(w.settings.moving_count):
        v.tight[i] = follows_twists(i, v, m)
        if v.tight[i] == 0:
            v.ahead[i] = new_commands(v) + time * m.rate[i]
            v.look[i] = lever_look(i, v, m)
            continue
        v.ahead[i] = new_commands(v) * (1.0 + AHEAD_TIME / LOOK_MORE * m.rate[i])
        body = w.bodies[i]
        travel = min(m.reach[NEXT, i], own_bound(TRAVEL, i, body, m))
        speed = min(m.rate[i], own_bound(SPEED, i, body, m))
        v.look[i] = travel + max(time * speed, hidden(i, v, m)) + v.ahead[i]


@kernel
def follows_twists(i: int, v: Watch, m: Motion) -> int:
    """1 if a primitive's search distance follows from twists, 0 if from levers.

    The proofs of a robot in mode "speed" or with a brake rest on levers. A recovering
    robot is relieved of pairs that levers do not prove.
    """
    if m.span.segment != 0 or coarse(i, v, m):
        return 0
    r = robot_of(i, v)
    if r < 0:
        return 1 if object_speed(i, v) == 0.0 else 0
    return 0 if v.phase[r] == RECOVERING else 1


@kernel
def new_commands(v: Watch) -> float:
    """Search distance that covers new commands of this cycle [m]."""
    return LOOK_MORE if v.given.commanded != 0 else 0.0


@kernel
def lever_look(i: int, v: Watch, m: Motion) -> float:
    """Search distance of a moving primitive by levers [m]."""
    return float(look_distance(i, v, m) + new_commands(v))


@kernel
def closer_look(i: int, j: int, need: float, look: float, w: Workspace) -> float:
    """Search distance of a pair by the relative motion of its sides [m].

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair [m].
        look: The sum of that and the search distances of both sides [m].
        w: The workspace.
    """
    v, m = w.watch, w.motion
    if j >= m.rate.shape[0] or v.tight[i] == 0 or v.tight[j] == 0:
        return look
    body_i, body_j = w.bodies[i], w.bodies[j]
    shared = shared_joints(body_i, body_j, m)
    travel = relative_bound(TRAVEL, i, j, body_i, body_j, shared, m)
    speed = relative_bound(SPEED, i, j, body_i, body_j, shared, m)
    more = max(
        LOOK_AHEAD * v.timing.slow_time * speed, hidden(i, v, m) + hidden(j, v, m)
    )
    return float(min(look, need + travel + more + v.ahead[i] + v.ahead[j]))


@kernel
def farther(boxes: Floats, i: int, j: int, distance: float) -> bool:
    """Whether two bounding boxes are farther apart than a distance.

    A NaN compares false, so that the pair is measured and the NaN is seen.
    """
    square = 0.0
    for k in range(3):
        gap = max(boxes[i, k] - boxes[j, k + 3], boxes[j, k] - boxes[i, k + 3])
        square += gap * gap if gap > 0.0 else 0.0
    return bool(square > distance * distance)


@kernel
def pair_look(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> tuple[float, float]:
    """Static need of a pair, and the distance beyond which it cannot matter [m].

    The need is inf where the pair has to be proven in full.
    """
    need = static_need(i, j, w, v, m)
    moving = w.settings.moving_count
    if j >= moving and m.span.segment == 0:
        need += object_speed(j, v) * time_ahead(v, m)
    if w.settings.contracts != 0 and w.grips.may[w.groups[i], w.groups[j]] != 0:
        look = need + lever_look(i, v, m)
        return (inf, look + lever_look(j, v, m) if j < moving else look)
    look = need + v.look[i]
    if j >= moving:
        return (need, look)
    return (need, closer_look(i, j, need, look + v.look[j], w))


@kernel
def way_of_object(j: int, v: Watch, m: Motion) -> float:
    """Greatest displacement of an object, from its sighting to the look-ahead [m]."""
    speed = object_speed(j, v)
    if speed == 0.0 or m.span.segment != 0:
        return 0.0
    return float(speed * (time_since(v.seen_at[j], v, m) + time_ahead(v, m)))


@kernel
def time_ahead(v: Watch, m: Motion) -> float:
    """Look-ahead: time from now after which a contact is not reported [s]."""
    return float(m.span.settled + LOOK_AHEAD * v.timing.slow_time)


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


@kernel
def widest_look(w: Workspace, v: Watch, m: Motion) -> float:
    """Greatest search distance that the other side of a pair can require [m]."""
    farthest = 0.0
    for i in range(w.settings.moving_count):
        farthest = max(farthest, v.look[i])
    fastest = 0.0
    seen = inf
    for k in range(v.movers.shape[0]):
        j = v.movers[k]
        fastest = max(fastest, v.top_speed[j])
        seen = min(seen, v.seen_at[j])
    drift = 0.0
    if fastest > 0.0 and m.span.segment == 0:
        drift = fastest * (time_ahead(v, m) + time_since(seen, v, m))
    return float(farthest + drift + w.settings.static_need)
