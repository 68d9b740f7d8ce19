"""Commands that go through the guard: velocity bounds of joints, and what is sent.

A joint whose velocity the guard commands is not driven to arbitrary velocities by its
operator. Until an order takes effect its velocity stays between the measured one and
the pending commands, within the declared tracking error. Pending commands are those
sent within the delay `command` before the measurement or later, and the one before
them.
"""

from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import Header
from armguard.guard.levels import Reason
from armguard.guard.observe import blame_joint, now_of
from armguard.guard.stops import GRAIN, effect_time, unknown_age
from armguard.guard.watch import (
    DELAY_SHARE,
    DELAY_STEPS,
    RECOVERING,
    RESTING,
    RUNNING,
    STOPPING,
    Watch,
)
from armguard.kernel import kernel
from armguard.motion.figures import (
    FIXED,
)
from armguard.motion.state import NEXT, NOW, Motion

Floats = NDArray[np.float64]

NOT_FOLLOWED = int(Reason.NOT_FOLLOWED)
DRIVE_LAGS = int(Reason.DRIVE_LAGS)


@kernel
def look_under_way(v: Watch, m: Motion) -> None:
    """Write the least and the greatest pending command of each joint.

    A robot at rest is held, as it is before the first command: that does not count as
    driving it.
    """
    room, count = v.sent_at.shape[0], v.sent_count[0]
    next_slot = count % room
    for j in range(m.q.shape[0]):
        r = int(m.robot_of_joint[j])
        measured = v.stamps[r] - unknown_age(r, v, m)
        since = measured - m.robot_figures[r].command
        k = next_slot
        # Before the first command its commanded velocity was 0.
        low, high = (0.0, 0.0) if count <= room else (inf, -inf)
        known = count <= room
        least, most = inf, -inf
        for back in range(min(room, count)):
            k = (k if k > 0 else room) - 1
            if back == 0:
                low = high = v.sent[k, j]
            low, high = min(low, v.sent[k, j]), max(high, v.sent[k, j])
            if v.held[k, r] == 0:
                least, most = min(least, v.sent[k, j]), max(most, v.sent[k, j])
            if v.sent_at[k] <= since:
                known = True
                break
            if back == count - 1:
                low, high = min(low, 0.0), max(high, 0.0)
        if not known:
            # Cycles are so frequent that commands no longer stored may be pending.
            high = m.joint_figures[j].velocity
            low = -high
            least, most = low, high
        v.under_way[j, 0], v.under_way[j, 1] = low, high
        v.driven_to[j, 0], v.driven_to[j, 1] = least, most


@kernel
def set_drives(v: Watch, m: Motion) -> None:
    """Write the velocities that joints may be driven to until a stop takes effect.

    For a stop ordered now these are the pending commands; for one ordered a cycle
    later, the desired velocity of this cycle as well. Without a command filter they are
    the top speeds. A robot that is held does not move and has no tracking error.
    """
    n = m.q.shape[0]
    for j in range(n):
        top, error = m.joint_figures[j].velocity, m.joint_figures[j].tracking_error
        if v.given.commanded == 0:
            m.driven[NOW * n + j, 0] = m.driven[NOW * n + j, 1] = top
            m.driven[NEXT * n + j, 0] = m.driven[NEXT * n + j, 1] = top
            continue
        low, high = v.driven_to[j, 0], v.driven_to[j, 1]
        m.driven[NOW * n + j, 0] = max(min(high + error, top), 0.0)
        m.driven[NOW * n + j, 1] = max(min(error - low, top), 0.0)
        low, high = min(low, v.wanted[j]), max(high, v.wanted[j])
        m.driven[NEXT * n + j, 0] = max(min(high + error, top), 0.0)
        m.driven[NEXT * n + j, 1] = max(min(error - low, top), 0.0)


@kernel
def hold_still(r: int, v: Watch, m: Motion) -> None:
    """Set the velocity bounds of a robot at rest to 0, which its measurement permits.

    It is held until it is commanded to move: any other measured velocity is error.
    """
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        m.v_low[j] = m.v_high[j] = 0.0


@kernel
def is_new(v: Watch) -> bool:
    """Whether a desired velocity lies outside the bounds of the pending commands."""
    for j in range(v.wanted.shape[0]):
        if not v.under_way[j, 0] <= v.wanted[j] <= v.under_way[j, 1]:
            return True
    return False


@kernel
def keep_under_way(r: int, share: float, v: Watch, m: Motion) -> None:
    """Scale the desired velocities of a robot back towards its pending commands.

    Args:
        r: The robot.
        share: Share of the part beyond the pending commands that is left [-].
        v: Watch; `wanted` is changed.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        known = min(max(v.wanted[j], v.under_way[j, 0]), v.under_way[j, 1])
        v.wanted[j] = known + share * (v.wanted[j] - known)


@kernel
def is_as_commanded(v: Watch, m: Motion, out: Header) -> bool:
    """Whether joints follow their commands; narrows their velocity bounds if they do.

    Args:
        v: Watch.
        m: Motion; the bounds of measured velocities are narrowed.
        out: Answer; names a joint that does not follow.
    """
    if v.sent_count[0] == 0:
        return True
    for j in range(m.q.shape[0]):
        r = int(m.robot_of_joint[j])
        driven = v.phase[r] == RUNNING or v.phase[r] == RECOVERING
        if not driven or m.robot_figures[r].mode == FIXED:
            continue
        error = m.joint_figures[j].tracking_error
        low, high = v.band[j, 0] - error, v.band[j, 1] + error
        explained = note_delay(j, r, error, v, m)
        if m.v_low[j] > high + GRAIN or m.v_high[j] < low - GRAIN:
            if explained < DELAY_STEPS:
                return bool(blame_joint(DRIVE_LAGS, j, v.delays[r], out))
            speed = 0.5 * (m.v_low[j] + m.v_high[j])
            return bool(blame_joint(NOT_FOLLOWED, j, speed, out))
        m.v_low[j], m.v_high[j] = max(m.v_low[j], low), min(m.v_high[j], high)
    return True


@kernel
def note_delay(j: int, r: int, error: float, v: Watch, m: Motion) -> int:
    """Update the lower bound of a drive's delay, by how its joint follows commands.

    A joint whose velocity lies outside all commands of a period, and moves farther
    outside, follows older ones. No response time is declared, so only this is certain.

    Args:
        j: The joint.
        r: Its robot.
        error: Tracking error of the joint [rad/s or m/s].
        v: Watch; the robot's delay is raised.
        m: Motion; the bounds of the measured velocities are read.

    Returns:
        The shortest tested delay that explains its velocity, DELAY_STEPS if none.
    """
    explained, step = 0, DELAY_SHARE * m.robot_figures[r].command
    for k in range(DELAY_STEPS):
        low, high = v.followed[j, 2 * k] - error, v.followed[j, 2 * k + 1] + error
        if m.v_low[j] > high + GRAIN or m.v_high[j] < low - GRAIN:
            explained = k + 1
            v.delays[r] = max(v.delays[r], (k + 1) * step)
    return explained


@kernel
def expect_followed(j: int, next_slot: int, v: Watch, m: Motion) -> None:
    """Write the velocity bounds of a joint at the next sample, for each tested delay.

    Until then its velocity stays between the present one and its commands: a drive of
    at most that delay follows no older command, except the one before.

    Args:
        j: The joint.
        next_slot: Slot of the ring of sent commands that is written next.
        v: Watch; `followed` is written.
        m: Motion.
    """
    r = int(m.robot_of_joint[j])
    room, count = v.sent_at.shape[0], v.sent_count[0]
    measured = v.stamps[r] - unknown_age(r, v, m)
    step = DELAY_SHARE * m.robot_figures[r].command
    low, high, k, at = inf, -inf, 0, next_slot
    for _ in range(min(room, count)):
        at = (at if at > 0 else room) - 1
        low, high = min(low, v.sent[at, j]), max(high, v.sent[at, j])
        while k < DELAY_STEPS and v.sent_at[at] <= measured - (k + 1) * step:
            expect_within(j, k, low, high, v, m)
            k += 1
        if k == DELAY_STEPS:
            return
    if count <= room:
        # Before the first command its commanded velocity was 0.
        low, high = min(low, 0.0), max(high, 0.0)
    else:
        low, high = -inf, inf
    for older in range(k, DELAY_STEPS):
        expect_within(j, older, low, high, v, m)


@kernel
def expect_within(j: int, k: int, low: float, high: float, v: Watch, m: Motion) -> None:
    """Write the velocity bounds for one delay: commands and present velocity."""
    r = int(m.robot_of_joint[j])
    if v.phase[r] != RUNNING and v.phase[r] != RECOVERING:
        low, high = -inf, inf
    # A joint that was within the bounds before still is, despite measurement errors.
    error = m.joint_figures[j].tracking_error
    now_low = max(m.v_low[j], v.followed[j, 2 * k] - error)
    now_high = min(m.v_high[j], v.followed[j, 2 * k + 1] + error)
    v.followed[j, 2 * k] = min(low, now_low)
    v.followed[j, 2 * k + 1] = max(high, now_high)


@kernel
def time_passed(v: Watch) -> float:
    """Time since the last commands, at most the longest permitted cycle [s]."""
    longest = v.timing.period + v.timing.late
    if v.sent_count[0] == 0:
        return float(v.timing.period)
    return float(min(moment(v) - v.commanded_at[0], longest))


@kernel
def moment(v: Watch) -> float:
    """Time of this cycle [s].

    If it is unknown, or not after the last commands, one period after these is assumed:
    an arm that decelerates to rest has to get there.
    """
    now, last = now_of(v), v.commanded_at[0]
    if isfinite(v.last.ordered_at) and isfinite(now) and now > last:
        return float(now)
    return last + v.timing.period if isfinite(last) else 0.0


@kernel
def lead_to_rest(r: int, time: float, v: Watch, m: Motion) -> None:
    """Command a robot to rest: velocity 0 if it rests, else its declared deceleration.

    The ramp begins at the velocity that a joint may have reached: a joint below its
    last command is not accelerated to it.

    Args:
        r: The robot.
        time: Time since its last command [s].
        v: Watch; `wanted` is written.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        v.wanted[j] = 0.0
        if v.phase[r] == STOPPING:
            figures = m.joint_figures[j]
            rises = max(effect_time(r, v, m) - v.fastest_at[r], 0.0)
            most = v.fastest[j] + figures.acceleration * rises
            last = v.commanded[j]
            if abs(last) > most:
                last = most if last > 0.0 else -most
            lost = figures.deceleration * time
            v.wanted[j] = max(last - lost, 0.0) if last > 0.0 else min(last + lost, 0.0)


@kernel
def send(v: Watch, m: Motion) -> None:
    """Fix the commanded velocities of this cycle and store them in the ring."""
    count, time = v.sent_count[0], time_passed(v)
    k = count % v.sent_at.shape[0]
    for r in range(v.phase.shape[0]):
        v.held[k, r] = int(v.phase[r] == RESTING)
        if v.phase[r] != RUNNING and v.phase[r] != RECOVERING:
            lead_to_rest(r, time, v, m)
    v.sent_at[k] = v.commanded_at[0] = moment(v)
    for j in range(v.wanted.shape[0]):
        v.sent[k, j] = v.commanded[j] = v.wanted[j]
    v.sent_count[0] = count + 1
    look_under_way(v, m)
    next_slot = v.sent_count[0] % v.sent_at.shape[0]
    for j in range(v.wanted.shape[0]):
        v.band[j, 0] = min(v.under_way[j, 0], m.v_low[j])
        v.band[j, 1] = max(v.under_way[j, 1], m.v_high[j])
        expect_followed(j, next_slot, v, m)
