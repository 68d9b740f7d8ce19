"""Static need of a pair, its closing speed, and the distance to search."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import dot
from armguard.guard.layout import NearRow, normal_of, point_of
from armguard.guard.observe import now_of
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.pair_proof import (
    shared_joints,
)
from armguard.motion.state import (
    NEXT,
    Motion,
)

Floats = NDArray[np.float64]

# Time left is reported up to this multiple of the time at which an arm is slowed [-].
LOOK_AHEAD = 2.0


@kernel
def robot_of(i: int, v: Watch) -> int:
    """Robot that moves a primitive, -1 for none."""
    return int(v.robot_of[i]) if i < v.robot_of.shape[0] else -1


@kernel
def own_sum(i: int, body: int, first: int, sizes: Floats, m: Motion) -> float:
    """Sum of sizes times levers over a primitive's joints, from the `first` one on."""
    total = 0.0
    for k in range(first, m.length[body]):
        total += sizes[m.joints[body, k]] * m.levers[i, k]
    return total


@kernel
def closing_speed(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Bound of the closing speed of two primitives in their present motion [m/s]."""
    if j >= m.rate.shape[0]:
        return float(m.rate[i] + object_speed(j, v))
    first = shared_joints(w.bodies[i], w.bodies[j], m)
    if first == 0:
        return float(m.rate[i] + m.rate[j])
    return float(
        own_sum(i, w.bodies[i], first, m.speed, m)
        + own_sum(j, w.bodies[j], first, m.speed, m)
    )


@kernel
def rate_along_normal(
    i: int, j: int, near: NearRow, w: Workspace, v: Watch, m: Motion
) -> float:
    """Greatest present closing speed of a pair, by its witness points and normal [m/s].

    Unlike levers this considers directions: motion past the other side does not count.
    """
    n = normal_of(near)
    moving = m.rate.shape[0]
    body_j = w.bodies[j] if j < moving else -1
    first = shared_joints(w.bodies[i], body_j, m)
    total = 0.0
    for side in range(2):
        k, body = (i, w.bodies[i]) if side == 0 else (j, body_j)
        if k >= moving:
            total += object_speed(k, v)
            continue
        point = point_of(near, side)
        for c in range(first, m.length[body]):
            b = m.joints[body, c]
            q = m.q_index[b]
            if m.clock[m.robot_of_joint[q]].still != 0:
                continue
            g = m.gain[b, 0] * dot(n, joint_way(point, b, m.axes[b], m))
            if side == 1:
                g = -g
            total += max(g * m.v_low[q], g * m.v_high[q])
    return total


@kernel
def object_speed(j: int, v: Watch) -> float:
    """Greatest speed of a primitive that no robot moves, 0 for others [m/s]."""
    return float(v.top_speed[j]) if j < v.top_speed.shape[0] else 0.0


@kernel
def static_need(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Distance that a pair must keep even if its robots do not move [m].

    Its buffer, the static errors of both sides, and an object's travel since it was
    seen.
    """
    need = w.buffers[w.groups[i], w.groups[j]] + v.link_error[i]
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    if robot_j >= 0:
        need += v.link_error[j]
        if robot_i != robot_j:
            need += v.robot_error[i] + v.robot_error[j]
        return float(need)
    need += v.robot_error[i]
    speed = object_speed(j, v)
    if speed > 0.0 and m.span.segment == 0:
        need += speed * time_since(v.seen_at[j], v, m)
    return float(need)


@kernel
def time_since(seen: float, v: Watch, m: Motion) -> float:
    """Longest possible time since an object was seen [s].

    If the time of the cycle is not given, it is later than the newest stamp by at most
    the declared age of a measurement.
    """
    age = now_of(v) - seen
    if v.given.now != v.given.now:
        oldest = 0.0
        for r in range(m.robot_figures.shape[0]):
            oldest = max(oldest, m.robot_figures[r].sensing)
        age += oldest
    return float(max(age, 0.0))


@kernel
def look_distance(i: int, v: Watch, m: Motion) -> float:
    """Distance beyond which a primitive's own motion needs no report [m]."""
    return float(m.reach[NEXT, i] + m.rate[i] * LOOK_AHEAD * v.timing.slow_time)
