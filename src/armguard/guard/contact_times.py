"""Time to contact: lower bounds of the time until pairs can touch.

The bounds hold for any operator input. A bound from levers is cheap and computed for
every near pair. A tighter bound with directions is computed in ascending order of the
lever bound, until the earliest contact of each robot is known.
"""

from math import inf, sqrt

from armguard.guard.layout import NearRow, normal_of
from armguard.guard.needs import closing_speed, object_speed, robot_of, static_need
from armguard.guard.proofs import coarse, describe_pair
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.free_way import bound_free_way, grid_time, time_after
from armguard.motion.pair_proof import path_gap
from armguard.motion.pair_state import ALLOWED, new_pair
from armguard.motion.state import FREE, GRID, Motion

# No near pair may touch before the earliest known contact.
NONE = -1


@kernel(separate=True)
def write_contact_times(w: Workspace) -> None:
    """Write the time to contact of each near pair and of each robot.

    Args:
        w: The workspace, after its pairs were judged.
    """
    v, m = w.watch, w.motion
    out = w.header
    for k in range(int(out.near_count)):
        near = w.near[k]
        near.time_to_contact = lever_time(near, w, v, m)
    for r in range(v.phase.shape[0]):
        w.robots[r].time = inf
    for r in range(v.phase.shape[0]):
        while True:
            k = next_row(r, w, v)
            if k == NONE:
                break
            look_closer(w.near[k], w, v, m)


@kernel
def next_row(r: int, w: Workspace, v: Watch) -> int:
    """Near pair of a robot that may touch before its earliest known contact."""
    out = w.header
    first, soonest = NONE, w.robots[r].time
    for k in range(int(out.near_count)):
        near = w.near[k]
        if not near.time_to_contact < soonest or near.proof == ALLOWED:
            # An intended contact needs no tighter bound than that of the levers.
            continue
        i, j = int(near.first), int(near.second)
        if robot_of(i, v) == r or robot_of(j, v) == r:
            first, soonest = k, near.time_to_contact
    return first


@kernel
def look_closer(near: NearRow, w: Workspace, v: Watch, m: Motion) -> None:
    """Write the direction-based time to contact of a near pair and of its robots."""
    time = contact_time(near, w, v, m)
    near.time_to_contact = time
    for side in range(2):
        r = robot_of(int(near.first if side == 0 else near.second), v)
        if r >= 0:
            w.robots[r].time = min(w.robots[r].time, time)


@kernel
def contact_time(near: NearRow, w: Workspace, v: Watch, m: Motion) -> float:
    """Lower bound of the time from now until a pair can touch, by directions [s].

    The longer of the lever bound and of the last time of a grid up to which the bound
    of the path proves a gap. The errors of model and measurement count, and the time
    since the older of two measurements.

    Args:
        near: The pair's row; the lever bound is written already.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    i, j = int(near.first), int(near.second)
    unknown = unknown_way(i, j, w, v, m)
    by_levers = near.time_to_contact
    if coarse(i, v, m) or coarse(j, v, m) or not near.distance > unknown:
        return float(by_levers)
    age = oldest_age(i, j, v, m)
    speed = object_speed(j, v) if j >= m.rate.shape[0] else 0.0
    n = normal_of(near)
    p = new_pair()
    p.need = p.drift = 0.0
    describe_pair(i, j, FREE, FREE, w, m, p)
    later = time_after(by_levers + age)
    # It is seldom more than twice the lever bound: test the second time first.
    for k in range(min(later + 1, GRID - 1), later - 1, -1):
        bound_free_way(k, w.motion)
        p.plan[0] = p.plan[1] = FREE + k
        gap = path_gap(n, p, m)
        if gap - unknown - speed * grid_time(k) > 0.0:
            return float(max(grid_time(k) - age, by_levers))
    return float(by_levers)


@kernel
def lever_time(near: NearRow, w: Workspace, v: Watch, m: Motion) -> float:
    """Lower bound of the time to contact by levers alone, without directions [s]."""
    i, j = int(near.first), int(near.second)
    distance = near.distance - unknown_way(i, j, w, v, m) - m.blur[i]
    push = m.push[i]
    if robot_of(j, v) >= 0:
        distance, push = distance - m.blur[j], push + m.push[j]
    time = time_to_contact(distance, closing_speed(i, j, w, v, m), push)
    return float(max(time - oldest_age(i, j, v, m), 0.0))


@kernel
def unknown_way(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Error of a pair's distance from model, base and object motion, not joints [m]."""
    need = static_need(i, j, w, v, m)
    return float(need - w.buffers[w.groups[i], w.groups[j]])


@kernel
def oldest_age(i: int, j: int, v: Watch, m: Motion) -> float:
    """Age of the older measurement of a pair's robots [s]."""
    age, other = m.clock[robot_of(i, v)].age, robot_of(j, v)
    return float(max(age, m.clock[other].age) if other >= 0 else age)


@kernel
def time_to_contact(distance: float, speed: float, push: float) -> float:
    """Least time until a pair can touch, for any operator input [s].

    From bounds of its closing speed [m/s] and of its closing acceleration `push`
    [m/s²] (Culley and Kempf): distance = speed · t + ½ · push · t².
    """
    if not distance > 0.0:
        return 0.0
    root = sqrt(speed * speed + 2.0 * push * distance)
    return float(2.0 * distance / (speed + root)) if root > 0.0 else inf
