"""Artificial potential field: a goal attracts a robot, near pairs repel it.

The goal, joint positions or a pose of the tool, attracts at a bounded speed, so a far
goal attracts no more than a near one. A near pair reduces the closing part of this
velocity, the more the smaller its headroom (velocity scaling). It also repels its
robot: the force of Khatib's artificial potential acts as a velocity along the pair's
distance gradient. Potential and force are one function, `field_at`: the force is minus
the gradient of the potential over the headroom. Both fade near the goal, or a goal
beside a wall could not be reached.

The sum may vanish where there is no goal. That is a local minimum: a robot that gets no
nearer to its goal for its `patience`, whether it rests or oscillates, stops there and
reports it.

References:
    Khatib, Real-time obstacle avoidance for manipulators and mobile robots, 1986.
    Boissiere and Harrigan, Telerobotic operation of conventional robot manipulators,
    1988.
    Ge and Cui, New potential functions for mobile robot path planning, 2000 (goals
    beside obstacles).
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, norm
from armguard.guard.commands import time_passed
from armguard.guard.needs import robot_of, static_need
from armguard.guard.pair_row import pair_row
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.lead_state import Goal, Lead, Source
from armguard.respond.state import Response
from armguard.respond.tool_motion import lead_tools, tool_columns, turn_between

Floats = NDArray[np.float64]

# Share of its joints' accelerations with which a guided robot speeds up [-].
GENTLE = 0.3

# Speeds of a tool that count as its top speeds [m/s], [rad/s].
TOOL_SPEED = 1.0
TOOL_TURN = 2.5

# Distances at which a goal is reached: of a joint [rad or m], of a tool [m], [rad].
JOINT_THERE = 0.01
TOOL_THERE = 0.005
TURN_THERE = 0.02

# Time to the goal at top speed below which repulsion fades with the square of it: the
# attraction fades too, and must still reach the goal [s].
GOAL_NEAR = 0.1

# Share of the influence below which the force grows linearly: a steeper force would
# oscillate with the delay of the robots [-].
STEEPEST = 0.5

# Lever of joints below which the repulsion is reduced [m/rad].
SHORT_LEVER = 0.1

# Repulsion below this counts as none [m/s].
NO_PUSH = 1e-12

# Share by which the way to the goal must shorten to count as progress [-].
PROGRESS = 0.01

# Share of its top speeds below which a guided robot counts as at rest [-]; it then
# waits for half of the patience.
STILL_SHARE = 0.005


@kernel
def attract(r: int, a: Response, s: Lead, w: Workspace, v: Watch, m: Motion) -> None:
    """Write the attractive joint velocities of a robot towards its goal."""
    memory, settings = s.memory[r], a.settings[r]
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    if s.notes[r].goal == Goal.JOINTS:
        left = 0.0
        for j in range(first, end):
            s.pull[j] = s.aim[j] - m.q[j]
            left = max(left, abs(s.pull[j]) / m.joint_figures[j].velocity)
        memory.time_left = left
        speed = led_speed(r, settings.field_speed, settings.attraction, s, v, m)
        for j in range(first, end):
            s.pull[j] *= speed / left if left > 0.0 else 0.0
        return
    shift, turn = tool_way(r, s, w)
    memory.time_left = max(norm(shift) / TOOL_SPEED, norm(turn) / TOOL_TURN)
    speed = led_speed(r, settings.field_speed, settings.attraction, s, v, m)
    rate = speed / memory.time_left if memory.time_left > 0.0 else 0.0
    body = s.notes[r].tool_body
    p = s.tool_aim[r].origin
    tool_columns(body, (p[0], p[1], p[2]), first, end, 0, a.tool_columns, w, m)
    for k in range(3):
        a.tool_speeds[k], a.tool_speeds[k + 3] = rate * shift[k], rate * turn[k]
    lead_tools(r, 6, s.pull, a, w, m)
    limit_share(first, end, settings.field_speed, s.pull, m)


@kernel
def led_speed(
    r: int, most: float, attraction: float, s: Lead, v: Watch, m: Motion
) -> float:
    """Share of its top speeds for a guided robot: smooth start, brake at the goal.

    Args:
        r: The robot; its `memory` holds the time to the goal.
        most: Greatest share [-].
        attraction: Ratio of speed to remaining way near the goal [1/s].
        s: Lead.
        v: Watch.
        m: Motion.
    """
    memory = s.memory[r]
    first = m.robot_figures[r].first_joint
    rate = np.inf
    for j in range(first, first + m.robot_figures[r].joint_count):
        figures = m.joint_figures[j]
        rate = min(rate, GENTLE * figures.acceleration / figures.velocity)
    memory.speed = min(most, memory.speed + rate * time_passed(v))
    left = memory.time_left
    return float(min(memory.speed, sqrt(rate * left), attraction * left))


@kernel
def tool_way(r: int, s: Lead, w: Workspace) -> tuple[Vec3, Vec3]:
    """Displacement [m] and rotation vector [rad] from a tool to its goal, in world."""
    aim, p = s.tool_aim[r].pose, s.tool_aim[r].origin
    T = w.T_world[s.notes[r].tool_body]
    x, y, z = p[0], p[1], p[2]
    shift = (
        aim[3] - (T[0] * x + T[1] * y + T[2] * z + T[3]),
        aim[7] - (T[4] * x + T[5] * y + T[6] * z + T[7]),
        aim[11] - (T[8] * x + T[9] * y + T[10] * z + T[11]),
    )
    return shift, turn_between(T, aim)


@kernel
def repel(a: Response, s: Lead, w: Workspace, v: Watch, m: Motion) -> None:
    """Reduce the robots' attraction at near pairs; write the repulsion of the pairs."""
    for j in range(s.push.shape[0]):
        s.push[j] = 0.0
    for r in range(s.weight.shape[0]):
        s.weight[r] = 0.0
    for k in range(int(w.header.near_count)):
        near = w.near[k]
        i, j = int(near.first), int(near.second)
        robot_i, robot_j = robot_of(i, v), robot_of(j, v)
        led = s.notes[robot_i].source == Source.FIELD
        led |= robot_j >= 0 and s.notes[robot_j].source == Source.FIELD
        if not led:
            continue
        need = static_need(i, j, w, v, m) + m.blur[i]
        if robot_j >= 0:
            need += m.blur[j]
        spare = near.distance - need
        pair_row(i, j, near, a.raw, w, m)
        for side in range(2):
            r = robot_i if side == 0 else robot_j
            if r < 0 or (side == 1 and r == robot_i):
                continue
            if s.notes[r].source != Source.FIELD:
                continue
            # Pairs beyond the margin are not measured, so they do not repel.
            reach = min(a.settings[r].influence, w.settings.margin - need)
            if spare < reach:
                repel_by(r, max(spare / reach, 0.0), a, s, m)
    for r in range(s.weight.shape[0]):
        add_push(r, a, s, m)


@kernel
def repel_by(r: int, part: float, a: Response, s: Lead, m: Motion) -> None:
    """Add the effect of a near pair on a robot: less attraction, more repulsion.

    Args:
        r: The robot.
        part: Headroom of the pair as a share of the range of its influence [-].
        a: Responses; `raw` holds the distance gradient of the pair.
        s: Lead.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    square, closing = SHORT_LEVER * SHORT_LEVER, 0.0
    for j in range(first, end):
        square += a.raw[j] * a.raw[j]
        closing += a.raw[j] * s.pull[j]
    taken = (1.0 - part) * max(closing, 0.0) / square
    near = min(s.memory[r].time_left / GOAL_NEAR, 1.0)
    push = a.settings[r].repulsion * field_at(part, near)[1]
    for j in range(first, end):
        s.pull[j] -= taken * a.raw[j]
        s.push[j] -= push * push * a.raw[j] / square
    s.weight[r] += push


@kernel
def field_at(part: float, near: float) -> tuple[float, float]:
    """Repulsive potential of a pair, and its force: minus the derivative.

    A quarter of Khatib's potential ½ (1/x - 1)², x being the headroom as a share of
    the range of influence; so the force is 1 at x = ½. Both are 0 from x = 1 on. Below
    `STEEPEST` the force goes on along its tangent, and the potential is a parabola.
    Near the goal both fade with the square of the way to it.

    Args:
        part: Headroom of the pair as a share of the range of its influence [-].
        near: Way to the goal as a share of where the field is full, in [0, 1] [-].

    Returns:
        Potential, and force towards a greater share, -d potential / d part [-].
    """
    fade = near * near
    if part >= 1.0:
        return (0.0, 0.0)
    x = max(part, STEEPEST)
    wall = 1.0 / x - 1.0
    force = 0.25 * wall / (x * x)
    slope = 0.25 * (3.0 / x - 2.0) / (x * x * x)
    deeper = x - part
    potential = 0.125 * wall * wall + deeper * (force + 0.5 * slope * deeper)
    return (fade * potential, fade * (force + slope * deeper))


@kernel
def add_push(r: int, a: Response, s: Lead, m: Motion) -> None:
    """Request the sum of attraction and repulsion of a robot.

    The repulsion of all pairs is their weighted mean, so that many pairs of one wall
    repel no more than one of them.
    """
    if s.notes[r].source != Source.FIELD or s.notes[r].in_minimum != 0:
        return
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    share = 0.0
    if s.weight[r] > NO_PUSH:
        share = 1.0 / s.weight[r]
    for j in range(first, end):
        a.requested[j] = s.pull[j] + share * s.push[j]
    limit_share(first, end, a.settings[r].field_speed, a.requested, m)


@kernel
def limit_share(first: int, end: int, share: float, speeds: Floats, m: Motion) -> None:
    """Scale velocities of joints to a share of their top speeds."""
    most = 0.0
    for j in range(first, end):
        most = max(most, abs(speeds[j]) / m.joint_figures[j].velocity)
    if most > share:
        for j in range(first, end):
            speeds[j] *= share / most


@kernel
def is_there(r: int, s: Lead, w: Workspace, m: Motion) -> bool:
    """Whether a robot has reached the goal of its field."""
    if s.notes[r].goal == Goal.JOINTS:
        first = m.robot_figures[r].first_joint
        for j in range(first, first + m.robot_figures[r].joint_count):
            if not abs(s.aim[j] - m.q[j]) <= JOINT_THERE:
                return False
        return True
    shift, turn = tool_way(r, s, w)
    return bool(norm(shift) <= TOOL_THERE and norm(turn) <= TURN_THERE)


@kernel
def forget_progress(r: int, s: Lead) -> None:
    """Reset the progress of a robot towards its goal."""
    s.notes[r].in_minimum = 0
    s.memory[r].speed = s.memory[r].stalled = s.memory[r].at_rest = 0.0
    s.memory[r].least_time_left = np.inf


@kernel
def look_for_minimum(
    r: int, a: Response, s: Lead, w: Workspace, v: Watch, m: Motion
) -> None:
    """Note whether a robot under its field makes progress or is in a local minimum."""
    memory, dt = s.memory[r], time_passed(v)
    if s.notes[r].in_minimum != 0:
        return
    if is_there(r, s, w, m):
        memory.least_time_left = memory.time_left
        memory.stalled = memory.at_rest = 0.0
        return
    if memory.time_left < (1.0 - PROGRESS) * memory.least_time_left:
        memory.least_time_left, memory.stalled = memory.time_left, 0.0
    else:
        memory.stalled += dt
    first = m.robot_figures[r].first_joint
    fastest = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        fastest = max(fastest, abs(v.commanded[j]) / m.joint_figures[j].velocity)
    memory.at_rest = memory.at_rest + dt if fastest < STILL_SHARE else 0.0
    patience = a.settings[r].patience
    if memory.stalled > patience or memory.at_rest > 0.5 * patience:
        s.notes[r].in_minimum = 1
