"""How a tool follows the joints of its robot, in the loop: columns, turns, the inverse.

The same as `tool`, for what may not allocate.
"""

from math import atan2, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, norm, scaled
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.state import Motion
from armguard.respond.tool import DAMPING
from armguard.robot.kinematics import FIXED, PRISMATIC

Floats = NDArray[np.float64]

# Sine of an angle below which its axis is not to be had from differences [-].
NO_AXIS = 1e-9


@kernel
def tool_columns(
    body: int,
    p_body: Vec3,
    first: int,
    end: int,
    columns: Floats,
    w: Workspace,
    m: Motion,
) -> None:
    """Write how each joint moves a tool: its origin, then its turn.

    Args:
        body: Body of the tool.
        p_body: Its origin there [m].
        first: First joint of the robot.
        end: One behind its last.
        columns: Overwritten for these joints, shape (n, 6) [m/rad], [-].
        w: Workspace.
        m: Motion.
    """
    for j in range(first, end):
        for k in range(6):
            columns[j, k] = 0.0
    T = w.T_world[body]
    x, y, z = p_body
    point = (
        T[0] * x + T[1] * y + T[2] * z + T[3],
        T[4] * x + T[5] * y + T[6] * z + T[7],
        T[8] * x + T[9] * y + T[10] * z + T[11],
    )
    while body >= 0:
        if m.joint_kind[body] != FIXED:
            own, gain = columns[m.q_index[body]], m.gain[body, 0]
            way = joint_way(point, body, m.axes[body], m)
            for k in range(3):
                own[k] += gain * way[k]
                if m.joint_kind[body] != PRISMATIC:
                    own[k + 3] += gain * m.axes[body, k]
        body = int(m.parent[body])


@kernel
def turn_between(T: Floats, aim: Floats) -> Vec3:
    """Turn that leads from one rotation to another, in the world [rad].

    Args:
        T: Row of [R | p], shape (12,).
        aim: The same.
    """
    r = turned_by(T, aim)
    s = (0.5 * (r[7] - r[5]), 0.5 * (r[2] - r[6]), 0.5 * (r[3] - r[1]))
    sine, cosine = norm(s), 0.5 * (r[0] + r[4] + r[8] - 1.0)
    if sine > NO_AXIS:
        return scaled(atan2(sine, cosine) / sine, s)
    if cosine > 0.0:
        return s
    # Half a turn: the axis is the longest column of (R + 1) / 2.
    if r[0] >= r[4] and r[0] >= r[8]:
        axis = (1.0 + r[0], r[3], r[6])
    elif r[4] >= r[8]:
        axis = (r[1], 1.0 + r[4], r[7])
    else:
        axis = (r[2], r[5], 1.0 + r[8])
    return scaled(pi / norm(axis), axis)


@kernel
def turned_by(
    T: Floats, aim: Floats
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """The rotation from one frame to another, R_aim R_Tᵀ, by rows."""
    return (
        aim[0] * T[0] + aim[1] * T[1] + aim[2] * T[2],
        aim[0] * T[4] + aim[1] * T[5] + aim[2] * T[6],
        aim[0] * T[8] + aim[1] * T[9] + aim[2] * T[10],
        aim[4] * T[0] + aim[5] * T[1] + aim[6] * T[2],
        aim[4] * T[4] + aim[5] * T[5] + aim[6] * T[6],
        aim[4] * T[8] + aim[5] * T[9] + aim[6] * T[10],
        aim[8] * T[0] + aim[9] * T[1] + aim[10] * T[2],
        aim[8] * T[4] + aim[9] * T[5] + aim[10] * T[6],
        aim[8] * T[8] + aim[9] * T[9] + aim[10] * T[10],
    )


@kernel
def joint_velocities(
    linear: Vec3,
    angular: Vec3,
    first: int,
    end: int,
    columns: Floats,
    square: Floats,
    speeds: Floats,
) -> None:
    """Write joint velocities for a twist of a tool, by damped least squares.

    Args:
        linear: Velocity of its origin [m/s].
        angular: Its angular velocity [rad/s].
        first: First joint of the robot.
        end: One behind its last.
        columns: From `tool_columns`.
        square: Scratch, shape (6, 7).
        speeds: Overwritten for these joints, shape (n,).

    References:
        Wampler, Manipulator inverse kinematic solutions based on vector formulations
        and damped least-squares methods, 1986.
    """
    for i in range(6):
        for k in range(6):
            total = DAMPING * DAMPING if i == k else 0.0
            for j in range(first, end):
                total += columns[j, i] * columns[j, k]
            square[i, k] = total
    for k in range(3):
        square[k, 6], square[k + 3, 6] = linear[k], angular[k]
    solve_positive(square)
    for j in range(first, end):
        speeds[j] = 0.0
        for k in range(6):
            speeds[j] += columns[j, k] * square[k, 6]


@kernel
def solve_positive(square: Floats) -> None:
    """Solve a positive definite system in place, by Cholesky.

    Args:
        square: Matrix, and beside it the right side, which becomes the solution, shape
            (k, k + 1).
    """
    k = square.shape[0]
    for i in range(k):
        for j in range(i + 1):
            total = square[i, j]
            for c in range(j):
                total -= square[i, c] * square[j, c]
            square[i, j] = sqrt(total) if i == j else total / square[j, j]
    for i in range(k):
        for c in range(i):
            square[i, k] -= square[i, c] * square[c, k]
        square[i, k] /= square[i, i]
    for back in range(k):
        i = k - 1 - back
        for c in range(i + 1, k):
            square[i, k] -= square[c, i] * square[c, k]
        square[i, k] /= square[i, i]
