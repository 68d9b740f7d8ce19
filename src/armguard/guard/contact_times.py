"""Time to contact: lower bounds of the time until pairs can touch.

The bounds hold for any operator input. A bound from levers is cheap and computed for
every near pair. A tighter bound with directions is computed in ascending order of the
lever bound, until the earliest contact of each robot is known.
"""

from math import inf, sqrt

from armguard.guard.layout import (
    FIRST,
    HEADER,
    NEAR_COUNT,
    PROOF,
    ROBOT_TIME,
    ROBOT_WIDTH,
    SECOND,
    TIME_TO_CONTACT,
    WITNESS,
)
from armguard.guard.near_pairs import row_place
from armguard.guard.needs import closing_speed, object_speed, robot_of, static_need
from armguard.guard.proofs import coarse, describe_pair
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.free_way import bound_free_way, grid_time, time_after
from armguard.motion.pair_proof import path_gap
from armguard.motion.pair_state import ALLOWED, new_pair
from armguard.motion.state import AGE, FREE, GRID, Motion

# No near pair may touch before the earliest known contact.
NONE = -1


@kernel(separate=True)
def write_contact_times(w: Workspace) -> None:
    """Write the time to contact of each near pair and of each robot.

    Args:
        w: The workspace, after its pairs were judged.
    """
    v, m = w.watch, w.motion
    out = w.out
    for k in range(int(out[NEAR_COUNT])):
        place = row_place(k, w)
        out[place + TIME_TO_CONTACT] = lever_time(place, w, v, m)
    for r in range(v.phase.shape[0]):
        out[HEADER + r * ROBOT_WIDTH + ROBOT_TIME] = inf
    for r in range(v.phase.shape[0]):
        while True:
            k = next_row(r, w, v)
            if k == NONE:
                break
            look_closer(row_place(k, w), w, v, m)


@kernel
def next_row(r: int, w: Workspace, v: Watch) -> int:
    """Near pair of a robot that may touch before its earliest known contact."""
    out = w.out
    first, soonest = NONE, out[HEADER + r * ROBOT_WIDTH + ROBOT_TIME]
    for k in range(int(out[NEAR_COUNT])):
        place = row_place(k, w)
        if not out[place + TIME_TO_CONTACT] < soonest or out[place + PROOF] == ALLOWED:
            # An intended contact needs no tighter bound than that of the levers.
            continue
        i, j = int(out[place + FIRST]), int(out[place + SECOND])
        if robot_of(i, v) == r or robot_of(j, v) == r:
            first, soonest = k, out[place + TIME_TO_CONTACT]
    return first


@kernel
def look_closer(place: int, w: Workspace, v: Watch, m: Motion) -> None:
    """Write the direction-based time to contact of a near pair and of its robots."""
    out = w.out
    time = contact_time(place, w, v, m)
    out[place + TIME_TO_CONTACT] = time
    for side in range(2):
        r = robot_of(int(out[place + (FIRST if side == 0 else SECOND)]), v)
        if r >= 0:
            own = HEADER + r * ROBOT_WIDTH + ROBOT_TIME
            out[own] = min(out[own], time)


@kernel
def contact_time(place: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Lower bound of the time from now until a pair can touch, by directions [s].

    The longer of the lever bound and of the last time of a grid up to which the bound
    of the path proves a gap. The errors of model and measurement count, and the time
    since the older of two measurements.

    Args:
        place: Where the pair's row starts; the lever bound is written already.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    out = w.out
    i, j = int(out[place + FIRST]), int(out[place + SECOND])
    unknown = unknown_way(i, j, w, v, m)
    by_levers = out[place + TIME_TO_CONTACT]
    if coarse(i, v, m) or coarse(j, v, m) or not out[place + WITNESS] > unknown:
        return float(by_levers)
    age = oldest_age(i, j, v, m)
    speed = object_speed(j, v) if j >= m.rate.shape[0] else 0.0
    at = place + WITNESS
    n = (out[at + 7], out[at + 8], out[at + 9])
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
def lever_time(place: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Lower bound of the time to contact by levers alone, without directions [s]."""
    i, j = int(w.out[place + FIRST]), int(w.out[place + SECOND])
    distance = w.out[place + WITNESS] - unknown_way(i, j, w, v, m) - m.blur[i]
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
    age, other = m.clock[robot_of(i, v), AGE], robot_of(j, v)
    return float(max(age, m.clock[other, AGE]) if other >= 0 else age)


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
