"""Escape directions of an arm, enumerated in a fixed order.

Normal to the velocity of the obstacle, to all sides; along it; each joint alone; and
directions that fill the joint space, alone or mixed with those or with the chosen
motion. The set and its order are fixed, so that a choice can be replayed.
"""

from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, any_perpendicular, cross, dot, norm, scaled
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.state import Motion
from armguard.respond.escape_path import speed_of
from armguard.respond.escape_state import SPREADS, Escape

Floats = NDArray[np.float64]

# Directions normal to the velocity of the obstacle, and forms of each: joints in
# proportion to their effect, and all useful joints at full speed.
SIDES = 8
FORMS = 2

# Share of the greatest effect from which a joint moves at full speed [-].
FULL_FROM = 0.4

# Weight of a space-filling direction that is added to another one [-].
MIXED = 0.7

# Times for which an arm goes on in a direction before it brakes [s].
GOES = (0.2, 0.45, 0.8, 1.3)

# Length below which a vector has no direction [m], and speed below which a joint does
# not move the arm along it [m/s].
NO_LENGTH = 1e-6


@kernel
def way_count(r: int, m: Motion) -> int:
    """Number of escape motions of a robot."""
    joints = m.robot_figures[r].joint_count
    directions = FORMS * (SIDES + 1) + 2 * joints + 3 * SPREADS
    return directions * len(GOES)


@kernel
def look_across(r: int, e: Escape, w: Workspace, m: Motion) -> None:
    """Write directions normal to the nearest obstacle's velocity, and a Jacobian.

    The Jacobian is that of the robot's witness point.
    """
    i, obstacle = e.plan.robot_primitive, e.approaching[e.plan.obstacle]
    speed = speed_of(obstacle)
    ahead = (
        obstacle.velocity[0] / speed,
        obstacle.velocity[1] / speed,
        obstacle.velocity[2] / speed,
    )
    # From the obstacle to the arm, without the part along the obstacle's velocity.
    n = (-e.closest[7], -e.closest[8], -e.closest[9])
    t = dot(n, ahead)
    off = (n[0] - t * ahead[0], n[1] - t * ahead[1], n[2] - t * ahead[2])
    length = norm(off)
    aside = any_perpendicular(ahead)
    if length > NO_LENGTH:
        aside = scaled(1.0 / length, off)
    other = cross(ahead, aside)
    for k in range(3):
        e.across[0, k], e.across[1, k], e.across[2, k] = aside[k], other[k], ahead[k]
    point = (e.closest[1], e.closest[2], e.closest[3])
    for q in range(e.columns.shape[0]):
        e.columns[q, 0] = e.columns[q, 1] = e.columns[q, 2] = 0.0
    body = w.bodies[i]
    for c in range(m.length[body]):
        b = m.joints[body, c]
        q = m.q_index[b]
        moved = joint_way(point, b, m.axes[b], m)
        for k in range(3):
            e.columns[q, k] += m.gain[b, 0] * moved[k]


@kernel
def write_way(k: int, r: int, share: float, e: Escape, m: Motion) -> float:
    """Write the joint velocities of a robot's escape motion number k into `trial`.

    Args:
        k: Number of the motion.
        r: The robot.
        share: Share of its top speeds that it may use [-].
        e: Escape.
        m: Motion.

    Returns:
        Time for which the motion goes on before the joints brake [s].
    """
    joints = m.robot_figures[r].joint_count
    first = m.robot_figures[r].first_joint
    d, length = k // len(GOES), k % len(GOES)
    fans = FORMS * (SIDES + 1)
    if d < fans:
        lead_to_side(d // FORMS, r, d % FORMS == 1, e, m)
    elif d < fans + 2 * joints:
        for j in range(first, first + joints):
            e.trial[j] = 0.0
        place = d - fans
        e.trial[first + place // 2] = 1.0 if place % 2 == 0 else -1.0
    else:
        place = d - fans - 2 * joints
        spread, base = place // 3, place % 3
        if base == 0:
            lead_to_side(spread % SIDES, r, False, e, m)
        for j in range(first, first + joints):
            if base == 1:
                e.trial[j] = e.way[j] / (share * m.joint_figures[j].velocity)
            elif base == 2:
                e.trial[j] = 0.0
            part = 1.0 if base == 2 else MIXED
            e.trial[j] += part * e.spreads[spread, j]
    fill_speed(r, share, e, m)
    return GOES[length]


@kernel
def lead_to_side(side: int, r: int, full: bool, e: Escape, m: Motion) -> None:
    """Write shares of top speeds that move the arm to a side of the obstacle.

    Args:
        side: Number of the side; SIDES is along the obstacle's velocity.
        r: The robot.
        full: Whether all joints that lead there move at full speed.
        e: Escape; `trial` is written.
        m: Motion.
    """
    to = side_of(side, e)
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    most = NO_LENGTH
    for j in range(first, end):
        c = e.columns[j]
        e.trial[j] = (c[0] * to[0] + c[1] * to[1] + c[2] * to[2]) * m.joint_figures[
            j
        ].velocity
        if e.useful[j] == 0:
            e.trial[j] = 0.0
        most = max(most, abs(e.trial[j]))
    for j in range(first, end):
        e.trial[j] /= most
        if full:
            e.trial[j] = min(max(e.trial[j] / FULL_FROM, -1.0), 1.0)


@kernel
def side_of(side: int, e: Escape) -> Vec3:
    """Unit vector to a side of the obstacle, or along its velocity."""
    if side == SIDES:
        return (e.across[2, 0], e.across[2, 1], e.across[2, 2])
    x, y = cos(2.0 * pi * side / SIDES), sin(2.0 * pi * side / SIDES)
    return (
        x * e.across[0, 0] + y * e.across[1, 0],
        x * e.across[0, 1] + y * e.across[1, 1],
        x * e.across[0, 2] + y * e.across[1, 2],
    )


@kernel
def fill_speed(r: int, share: float, e: Escape, m: Motion) -> None:
    """Turn shares of top speeds in `trial` into the greatest allowed velocities."""
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    most = NO_LENGTH
    for j in range(first, end):
        if e.useful[j] == 0:
            e.trial[j] = 0.0
        most = max(most, abs(e.trial[j]))
    for j in range(first, end):
        e.trial[j] *= share * m.joint_figures[j].velocity / most
