"""Velocity bounds of a robot's joints for a cycle, and the velocity it aims at."""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.guard.commands import time_passed
from armguard.guard.watch import RESTING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.command import Changed
from armguard.respond.constraints import time_to_effect
from armguard.respond.lead_state import Source
from armguard.respond.state import Response

Floats = NDArray[np.float64]

BY_SPEED = int(Changed.SPEED)
BY_ACCELERATION = int(Changed.ACCELERATION)
BY_LIMITS = int(Changed.LIMITS)
BY_BLOCKED = int(Changed.BLOCKED)


# Distance from its limit at which a joint stops, beyond position errors [rad].
LIMIT_SPARE = 1e-3


@kernel
def bound_joint(
    j: int,
    r: int,
    less: float,
    begins: bool,
    a: Response,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> None:
    """Write the velocity bounds of a joint for this cycle, and its braked velocity.

    Args:
        j: The joint.
        r: Its robot.
        less: By how much it slows down where it has to brake [rad/s or m/s].
        begins: Whether a recovery begins, at any acceleration.
        a: Responses; `low`, `high` and `brake` of the joint are written.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    low, high, brake = a.low, a.high, a.brake
    figures, dt = m.joint_figures[j], time_passed(v)
    last = v.commanded[j]
    gain = inf if begins else figures.acceleration * dt
    brake[j] = max(last - less, 0.0) if last > 0.0 else min(last + less, 0.0)
    top = max(a.speed[r] * figures.velocity, abs(brake[j]))
    # The position error counts twice: now, and when the joint is at the limit.
    away = 2.0 * figures.position_error + LIMIT_SPARE
    up = speed_within(w.upper[j] - m.q[j] - away, j, r, m)
    down = speed_within(m.q[j] - w.lower[j] - away, j, r, m)
    # Before its limit a joint brakes at full deceleration, independent of others.
    own = figures.deceleration * dt
    hardest = max(last - own, 0.0) if last > 0.0 else min(last + own, 0.0)
    high[j] = max(min(last + gain, top, up), hardest)
    low[j] = min(max(last - gain, -min(top, down)), hardest)
    brake[j] = min(max(brake[j], low[j]), high[j])


@kernel
def frame_limits(
    r: int, follows: bool, a: Response, w: Workspace, v: Watch, m: Motion
) -> None:
    """Write the velocity bounds of a robot's joints for this cycle, and its target.

    The target keeps the direction of the request while the robot accelerates to it.

    Args:
        r: The robot.
        follows: Whether the robot follows the request.
        a: Responses; `target`, `low`, `high` and `brake` are written, and the reasons
            for which the target differs from the request.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    requested, target, low, high = a.requested, a.target, a.low, a.high
    robot, dt = m.robot_figures[r], time_passed(v)
    first = robot.first_joint
    end = first + robot.joint_count
    share = a.speed[r]
    # A recovery begins at a speed that surely opens the pairs.
    begins = a.notes[r].recovers != 0 and v.phase[r] == RESTING and v.evades[r] == 0
    slower = 1.0
    for j in range(first, end):
        top = share * m.joint_figures[j].velocity
        if follows and abs(requested[j]) > top:
            slower = min(slower, top / abs(requested[j]))
    part, changed = 1.0, int(slower < 1.0) * BY_SPEED + int(not follows) * BY_BLOCKED
    for j in range(first, end):
        last, gain = v.commanded[j], m.joint_figures[j].acceleration * dt
        target[j] = slower * requested[j] if follows else 0.0
        change = abs(target[j] - last)
        if change > gain and not begins:
            part = min(part, gain / change)
    changed |= int(part < 1.0) * BY_ACCELERATION
    lost = 1.0
    for j in range(first, end):
        last = abs(v.commanded[j])
        if last > 0.0:
            lost = min(lost, m.joint_figures[j].deceleration * dt / last)
    straight = a.settings[r].scales != 0 or retreats(r, a)
    for j in range(first, end):
        last = v.commanded[j]
        if part < 1.0:
            target[j] = last + part * (target[j] - last)
        # A robot that keeps its path slows down all joints in proportion.
        own = m.joint_figures[j].deceleration * dt
        less = lost * abs(last) if straight else own
        bound_joint(j, r, less, begins, a, w, v, m)
        lead_within_limits(j, a, w, m)
        within = min(max(target[j], low[j]), high[j])
        if within != target[j]:
            changed |= BY_LIMITS
            target[j] = within
    a.notes[r].changed = changed


@kernel
def lead_within_limits(j: int, a: Response, w: Workspace, m: Motion) -> None:
    """Move a joint back that surely crept beyond a limit, if no body is there.

    The bound is its tracking error. The velocity of the declared stop is clipped to the
    new bounds.

    Args:
        j: The joint.
        a: Responses; `low`, `high` and `brake` are narrowed.
        w: Workspace.
        m: Motion.
    """
    low, high, brake = a.low, a.high, a.brake
    error, missed = m.joint_figures[j].position_error, m.joint_figures[j].tracking_error
    if m.q[j] - w.upper[j] > error:
        high[j] = min(high[j], max(-missed, low[j]))
    elif w.lower[j] - m.q[j] > error:
        low[j] = max(low[j], min(missed, high[j]))
    brake[j] = min(max(brake[j], low[j]), high[j])


@kernel
def retreats(r: int, a: Response) -> bool:
    """Whether a robot retreats, so that it keeps to its path."""
    return bool(a.lead.notes[r].source == Source.RETREAT)


@kernel
def speed_within(way: float, j: int, r: int, m: Motion) -> float:
    """Greatest commanded speed from which a joint stops within a distance [rad/s].

    Tracking error, ramp of the stop and swing are included.
    """
    if not way > 0.0:
        return 0.0
    figures, time = m.joint_figures[j], time_before_stop(j, r, m)
    d = figures.deceleration
    speed = d * (sqrt(time * time + 2.0 * way / d) - time)
    return float(max(speed - figures.tracking_error, 0.0))


@kernel
def time_before_stop(j: int, r: int, m: Motion) -> float:
    """Time for which a joint's speed counts besides braking [s].

    The sum of reaction, half the ramp and swing.
    """
    figures = m.joint_figures[j]
    time = time_to_effect(r, m) + 0.5 * m.robot_figures[r].ramp
    return float(time + figures.settle / figures.velocity)
