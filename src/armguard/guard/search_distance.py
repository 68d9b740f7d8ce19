"""Search distances: how near the other side of a pair must be to matter."""

from math import inf

import numpy as np

from armguard.geometry.vec3 import Vec3
from armguard.guard.near_pairs import grow_box
from armguard.guard.needs import (
    LOOK_AHEAD,
    look_distance,
    object_speed,
    robot_of,
    time_since,
)
from armguard.guard.proofs import coarse, evaded_clusters
from armguard.guard.watch import RECOVERING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.pair_proof import shared_joints
from armguard.motion.state import NEXT, Motion
from armguard.motion.twist_bound import (
    SPEED,
    TRAVEL,
    bound_twists,
    middle_gap,
    own_bound,
    place_at_middle,
    relative_bound,
)
from armguard.table import Matrix

# Search distance beyond the travel of the pending commands, for desired ones [m].
LOOK_MORE = 5e-3

# Time for which a primitive's present motion is searched beyond that: the faster it
# moves, the more a new command changes its stop [s].
AHEAD_TIME = 1.5e-2


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
    """Write the search distance and the swept box of each moving primitive.

    Where commands go through the guard, they cover new commands of this cycle as well.
    """
    boxes, half = w.world.boxes, 0.5 * w.settings.margin
    if m.span.segment == 0:
        bound_twists(boxes, w.bodies, m)
    time = LOOK_AHEAD * v.timing.slow_time
    for i in range(w.settings.moving_count):
        v.tight[i] = follows_twists(i, v, m)
        if v.tight[i] == 0:
            v.ahead[i] = new_commands(v) + time * m.rate[i]
            v.look[i] = lever_look(i, v, m)
            grow_box(i, max(v.look[i], half), boxes, v)
            continue
        v.ahead[i] = new_commands(v) * (1.0 + AHEAD_TIME / LOOK_MORE * m.rate[i])
        body = w.bodies[i]
        travel, way, more = own_bound(TRAVEL, i, body, m)
        speed, rate, faster = own_bound(SPEED, i, body, m)
        travel, speed = min(m.reach[NEXT, i], travel), min(m.rate[i], speed)
        error = hidden(i, v, m)
        v.reserve[i] = max(time * speed, error) + v.ahead[i]
        v.look[i] = travel + v.reserve[i]
        for k in range(3):
            back = more[k] - way[k] + max(time * (faster[k] - rate[k]), error)
            back = min(max(back, 0.0) + v.ahead[i], v.look[i])
            v.swept[k, i] = boxes[i, k] - max(back, half)
            forth = more[k] + way[k] + max(time * (faster[k] + rate[k]), error)
            forth = min(max(forth, 0.0) + v.ahead[i], v.look[i])
            v.swept[k + 3, i] = boxes[i, k + 3] + max(forth, half)


@kernel
def swept_apart(i: int, j: int, need: float, w: Workspace) -> bool:
    """Whether the swept boxes of a pair are farther apart than its need.

    A NaN compares false, so that the pair is measured and the NaN is seen.
    """
    swept, boxes = w.watch.swept, w.world.boxes
    for k in range(3):
        if j < w.settings.moving_count:
            low, high, way = swept[k, j], swept[k + 3, j], need
        else:
            low, high = boxes[j, k], boxes[j, k + 3]
            way = need + 0.5 * w.settings.margin
        if swept[k, i] - high > way or low - swept[k + 3, i] > way:
            return True
    return False


@kernel
def follows_twists(i: int, v: Watch, m: Motion) -> int:
    """1 if a primitive's search distance follows from twists, 0 if from levers.

    The proofs of a robot in mode "speed" or with a brake rest on levers. A recovering
    robot is relieved of pairs that levers do not prove, unless it evades a cluster:
    then it is relieved of cells wherever they are.
    """
    if m.span.segment != 0 or coarse(i, v, m):
        return 0
    r = robot_of(i, v)
    if r < 0:
        return 1 if object_speed(i, v) == 0.0 else 0
    return 0 if v.phase[r] == RECOVERING and evaded_clusters(r, v) == 0 else 1


@kernel
def new_commands(v: Watch) -> float:
    """Search distance that covers new commands of this cycle [m]."""
    return LOOK_MORE if v.given.commanded != 0 else 0.0


@kernel
def lever_look(i: int, v: Watch, m: Motion) -> float:
    """Search distance of a moving primitive by levers [m]."""
    return float(look_distance(i, v, m) + new_commands(v))


@kernel
def pair_look(i: int, j: int, need: float, w: Workspace) -> Vec3:
    """Need of a pair, and what is known of its distance before it is measured [m].

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair and the travel of an object [m].
        w: The workspace.

    Returns:
        The need, inf where the pair has to be proven in full; the distance beyond which
        the pair cannot matter, negative if it is known already not to matter; and a
        lower bound of the distance during the stops, minus infinity if there is none.
    """
    v, m, margin, boxes = w.watch, w.motion, w.settings.margin, w.world.boxes
    moves = j < w.settings.moving_count
    if w.settings.contracts != 0 and w.grips.may[w.groups[i], w.groups[j]] != 0:
        look = need + lever_look(i, v, m)
        look = max(margin, look + lever_look(j, v, m) if moves else look)
        return (inf, -1.0 if farther(boxes, i, j, look) else look, -inf)
    if swept_apart(i, j, need, w):
        return (need, -1.0, -inf)
    known = v.tight[i] != 0 and not (moves and v.tight[j] == 0)
    body_i, body_j, shared = w.bodies[i], -1, 0
    look, reserve = need + v.look[i], need + v.reserve[i]
    if moves:
        body_j = w.bodies[j]
        shared = shared_joints(body_i, body_j, m)
        look += v.look[j]
    if moves and known:
        travel = relative_bound(TRAVEL, i, j, body_i, body_j, shared, m)
        speed = relative_bound(SPEED, i, j, body_i, body_j, shared, m)
        more = max(
            LOOK_AHEAD * v.timing.slow_time * speed, hidden(i, v, m) + hidden(j, v, m)
        )
        look = min(look, need + travel + more + v.ahead[i] + v.ahead[j])
        reserve = need + more + v.ahead[i] + v.ahead[j]
    look = max(margin, look)
    if farther(boxes, i, j, look):
        return (need, -1.0, -inf)
    if not known:
        return (need, look, -inf)
    if m.effort.at_middle == 0:
        place_at_middle(w.bodies, w.T_world, m)
    gap = middle_gap(i, j, body_i, body_j, shared, boxes, m)
    if gap > margin and gap >= reserve:
        return (need, -1.0, gap)
    return (need, look, gap)


@kernel
def farther(boxes: Matrix, i: int, j: int, distance: float) -> bool:
    """Whether two bounding boxes are farther apart than a distance.

    A NaN compares false, so that the pair is measured and the NaN is seen.
    """
    square = 0.0
    for k in range(3):
        gap = max(boxes[i, k] - boxes[j, k + 3], boxes[j, k] - boxes[i, k + 3])
        square += gap * gap if gap > 0.0 else 0.0
    return bool(square > distance * distance)


@kernel
def way_until_look(j: int, v: Watch, m: Motion) -> float:
    """Greatest displacement of an object until the look-ahead [m]."""
    return 0.0 if m.span.segment != 0 else float(object_speed(j, v) * time_ahead(v, m))


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
def widest_look(w: Workspace, v: Watch, m: Motion) -> float:
    """Greatest search distance that the other side of a pair can require [m]."""
    farthest = 0.0
    for i in range(w.settings.moving_count):
        farthest = max(farthest, v.look[i])
    fastest = 0.0
    seen = np.inf
    for k in range(v.movers.shape[0]):
        j = v.movers[k]
        fastest = max(fastest, v.top_speed[j])
        seen = min(seen, v.seen_at[j])
    drift = 0.0
    if fastest > 0.0 and m.span.segment == 0:
        drift = fastest * (time_ahead(v, m) + time_since(seen, v, m))
    return float(farthest + drift + w.settings.static_need)
