"""When pairs can touch at the soonest, whatever the operators do.

From levers for every near pair, which takes next to no time; and with directions for as
many as it takes to know each robot's first: in the order of what levers say, until that
is no sooner than what is known already.
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

# No row is sooner than what is known.
NONE = -1


@kernel(separate=True)
def write_contact_times(w: Workspace) -> None:
    """Write when each near pair, and each robot, can touch anything at the soonest.

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
    """The near pair of a robot that may touch first, if sooner than what is known."""
    out = w.out
    first, soonest = NONE, out[HEADER + r * ROBOT_WIDTH + ROBOT_TIME]
    for k in range(int(out[NEAR_COUNT])):
        place = row_place(k, w)
        if not out[place + TIME_TO_CONTACT] < soonest or out[place + PROOF] == ALLOWED:
            # A contact that is meant is no matter of time; levers tell enough of it.
            continue
        i, j = int(out[place + FIRST]), int(out[place + SECOND])
        if robot_of(i, v) == r or robot_of(j, v) == r:
            first, soonest = k, out[place + TIME_TO_CONTACT]
    return first


@kernel
def look_closer(place: int, w: Workspace, v: Watch, m: Motion) -> None:
    """Write when a near pair can touch, directions considered, for its robots too."""
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
    """Least time from now until a pair can touch, whatever its operators do [s].

    The longer of what levers say, and of the last time of a grid until which the bound
    of its path by directions holds. The errors of model and measurement count, and the
    time that has passed since the older of two measurements.

    Args:
        place: Where the pair's row starts; what levers say is written already.
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
    describe_pair(i, j, FREE, FREE, 0.0, 0.0, w, m, p)
    later = time_after(by_levers + age)
    # Seldom is it more than twice what levers say: the second time first.
    for k in range(min(later + 1, GRID - 1), later - 1, -1):
        bound_free_way(k, w.motion)
        p.plan[0] = p.plan[1] = FREE + k
        gap = path_gap(n, p, m)
        if gap - unknown - speed * grid_time(k) > 0.0:
            return float(max(grid_time(k) - age, by_levers))
    return float(by_levers)


@kernel
def lever_time(place: int, w: Workspace, v: Watch, m: Motion) -> float:
    """The same by levers alone, which know no directions."""
    i, j = int(w.out[place + FIRST]), int(w.out[place + SECOND])
    distance = w.out[place + WITNESS] - unknown_way(i, j, w, v, m) - m.blur[i]
    push = m.push[i]
    if robot_of(j, v) >= 0:
        distance, push = distance - m.blur[j], push + m.push[j]
    time = time_to_contact(distance, closing_speed(i, j, w, v, m), push)
    return float(max(time - oldest_age(i, j, v, m), 0.0))


@kernel
def unknown_way(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """How much nearer a pair may be than it was measured, joints aside [m]."""
    need = static_need(i, j, w, v, m)
    return float(need - w.buffers[w.groups[i], w.groups[j]])


@kernel
def oldest_age(i: int, j: int, v: Watch, m: Motion) -> float:
    """Time since the older measurement of a pair's robots [s]."""
    age, other = m.clock[robot_of(i, v), AGE], robot_of(j, v)
    return float(max(age, m.clock[other, AGE]) if other >= 0 else age)


@kernel
def time_to_contact(distance: float, speed: float, push: float) -> float:
    """Least time until a pair can touch, whatever its operators do [s].

    From a bound of its closing speed and of what accelerations can add to that
    (Culley and Kempf): distance = speed · t + ½ · push · t².
    """
    if not distance > 0.0:
        return 0.0
    root = sqrt(speed * speed + 2.0 * push * distance)
    return float(2.0 * distance / (speed + root)) if root > 0.0 else inf
