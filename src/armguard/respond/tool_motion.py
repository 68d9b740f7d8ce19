"""Differential kinematics of tools: Jacobian, rotation vector, damped least squares."""

from math import atan2, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, norm, scaled
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.state import Motion
from armguard.respond.joint_bounds import LIMIT_SPARE
from armguard.respond.state import Response
from armguard.robot.kinematics import FIXED, PRISMATIC

Floats = NDArray[np.float64]

# Sine of an angle below which differences do not give its axis [-].
NO_AXIS = 1e-9

# Damping of the inverse near singular configurations [m], [rad].
DAMPING = 0.02

# Distance from its limit at which the other joints begin to replace a joint [rad].
LIMIT_NEAR = 0.1


@kernel
def tool_columns(
    body: int,
    p_body: Vec3,
    first: int,
    end: int,
    at: int,
    columns: Floats,
    w: Workspace,
    m: Motion,
) -> None:
    """Write the Jacobian of a tool: linear part of its origin, then angular part.

    Args:
        body: Body of the tool.
        p_body: Origin of the tool in the frame of the body [m].
        first: First joint of the robot.
        end: One behind its last joint.
        at: First of the 6 columns that are overwritten for these joints.
        columns: Transposed Jacobians of several tools, shape (n, 6k) [m/rad], [-].
        w: Workspace.
        m: Motion.
    """
    for j in range(first, end):
        for k in range(at, at + 6):
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
                own[at + k] += gain * way[k]
                if m.joint_kind[body] != PRISMATIC:
                    own[at + k + 3] += gain * m.axes[body, k]
        body = int(m.parent[body])


@kernel
def turn_between(T: Floats, aim: Floats) -> Vec3:
    """Rotation vector from one rotation to another, in the world [rad].

    Args:
        T: Present pose, row of [R | p], shape (12,).
        aim: Pose of the goal, row of [R | p], shape (12,) or longer.
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
    """Rotation from one frame to another, R_aim R_Tᵀ, by rows [-]."""
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
    size: int, first: int, end: int, speeds: Floats, a: Response
) -> None:
    """Write joint velocities for twists of a robot's tools, by damped least squares.

    Args:
        size: Count of numbers of the twists, 6k.
        first: First joint of the robot.
        end: One behind its last joint.
        speeds: Joint velocities, overwritten for these joints, shape (n,).
        a: Responses; `tool_speeds` holds the twists, `tool_columns` the Jacobians.

    References:
        Wampler, Manipulator inverse kinematic solutions based on vector formulations
        and damped least-squares methods, 1986.
    """
    columns, square = a.tool_columns, a.tool_square
    for i in range(size):
        for k in range(size):
            total = DAMPING * DAMPING if i == k else 0.0
            for j in range(first, end):
                total += columns[j, i] * columns[j, k]
            square[i, k] = total
        square[i, size] = a.tool_speeds[i]
    solve_positive(size, square)
    for j in range(first, end):
        speeds[j] = 0.0
        for k in range(size):
            speeds[j] += columns[j, k] * square[k, size]


@kernel
def lead_tools(
    r: int, size: int, speeds: Floats, a: Response, w: Workspace, m: Motion
) -> None:
    """Write joint velocities for twists, without joints that are near their limits.

    Args:
        r: The robot.
        size: Count of numbers of the twists, 6k.
        speeds: Joint velocities, overwritten for its joints, shape (n,).
        a: Responses; `tool_speeds` holds the twists. Their Jacobians in `tool_columns`
            are weighted, and `raw` is overwritten.
        w: Workspace.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    joint_velocities(size, first, end, speeds, a)
    if not weigh_room(size, first, end, speeds, a, w, m):
        return
    joint_velocities(size, first, end, speeds, a)
    for j in range(first, end):
        speeds[j] *= a.raw[j]


@kernel
def weigh_room(
    size: int,
    first: int,
    end: int,
    speeds: Floats,
    a: Response,
    w: Workspace,
    m: Motion,
) -> bool:
    """Weight a robot's Jacobian by the distances of its joints from their limits.

    The limit is the one that a joint moves towards. Other joints take over the part of
    a joint near its limit.

    Args:
        size: Count of numbers of the twists.
        first: First joint of the robot.
        end: One behind its last joint.
        speeds: Joint velocities from `joint_velocities`.
        a: Responses; `tool_columns` is weighted, `raw` is overwritten with the roots of
            the weights.
        w: Workspace.
        m: Motion.

    Returns:
        Whether any joint is near its limit.

    References:
        Chan and Dubey, A weighted least-norm solution based scheme for avoiding joint
        limits for redundant joint manipulators, 1995.
    """
    little = False
    for j in range(first, end):
        room = w.upper[j] - m.q[j] if speeds[j] > 0.0 else m.q[j] - w.lower[j]
        room -= 2.0 * m.joint_figures[j].position_error + LIMIT_SPARE
        part = min(max(room / LIMIT_NEAR, 0.0), 1.0)
        little |= part < 1.0
        a.raw[j] = sqrt(part)
        for k in range(size):
            a.tool_columns[j, k] *= a.raw[j]
    return little


@kernel
def solve_positive(size: int, square: Floats) -> None:
    """Solve a positive definite system in place, by Cholesky.

    Args:
        size: Number of equations.
        square: Matrix, and right-hand side in the next column, which becomes the
            solution; shape at least (size, size + 1).
    """
    for i in range(size):
        for j in range(i + 1):
            total = square[i, j]
            for c in range(j):
                total -= square[i, c] * square[j, c]
            square[i, j] = sqrt(total) if i == j else total / square[j, j]
    for i in range(size):
        for c in range(i):
            square[i, size] -= square[i, c] * square[c, size]
        square[i, size] /= square[i, i]
    for back in range(size):
        i = size - 1 - back
        for c in range(i + 1, size):
            square[i, size] -= square[c, i] * square[c, size]
        square[i, size] /= square[i, i]
