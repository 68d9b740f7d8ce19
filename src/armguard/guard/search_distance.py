"""Search distances: how near the other side of a pair must be to matter."""

from math import inf

from armguard.guard.needs import (
    LOOK_AHEAD,
    look_distance,
    object_speed,
    robot_of,
    static_need,
    time_since,
)
from armguard.guard.proofs import coarse
from armguard.guard.watch import RECOVERING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.pair_proof import shared_joints
from armguard.motion.state import NEXT, Motion
from armguard.motion.twist_bound import (
    SPEED,
    TRAVEL,
    bound_twists,
    own_bound,
    relative_bound,
)

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
