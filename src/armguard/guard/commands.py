"""Commands that go through the guard: what they let a joint do, and what is sent.

A joint that is told its velocity by the guard is not driven to whatever its operator
could think of. Until an order takes effect its velocity stays between what it was when
it was measured and the commands that are under way, with the declared error of
tracking. Commands under way are those sent within the delay `command` before the
measurement or later, and the one before them.
"""

from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Reason
from armguard.guard.observe import blame_joint, now_of
from armguard.guard.stops import GRAIN, effect_time, unknown_age
from armguard.guard.watch import (
    COMMANDED,
    DELAY_SHARE,
    DELAY_STEPS,
    LATE,
    ORDERED_AT,
    PERIOD,
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
    """Write between which velocities joints were told to be and may not be yet.

    A robot that rests is held, as it is before the first command: that does not count
    as driving it.
    """
    room, count = v.sent_at.shape[0], v.sent_count[0]
    next_slot = count % room
    for j in range(m.q.shape[0]):
        r = int(m.robot_of_joint[j])
        measured = v.stamps[r] - unknown_age(r, v, m)
        since = measured - m.robot_figures[r].command
        k = next_slot
        # Before the first command it was told to stand still.
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
            # Cycles come so often that older ones are forgotten, and may be under way.
            high = m.joint_figures[j].velocity
            low = -high
            least, most = low, high
        v.under_way[j, 0], v.under_way[j, 1] = low, high
        v.driven_to[j, 0], v.driven_to[j, 1] = least, most


@kernel
def set_drives(v: Watch, m: Motion) -> None:
    """Write to which velocities the joints may be driven until a stop takes effect.

    Told to stop now, they are driven to what is under way; told a cycle later, to what
    is wanted in this cycle as well. Where nobody filters commands, to their top speeds.
    What is held neither moves nor misses anything.
    """
    n = m.q.shape[0]
    for j in range(n):
        top, error = m.joint_figures[j].velocity, m.joint_figures[j].tracking_error
        if v.given[COMMANDED] == 0.0:
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
    """Take the velocities of a robot that rests for 0, which they may be as measured.

    It is held until it is told to move: what is measured besides is error.
    """
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        m.v_low[j] = m.v_high[j] = 0.0


@kernel
def is_new(v: Watch) -> bool:
    """Whether what is wanted lets any joint do more than what is under way."""
    for j in range(v.wanted.shape[0]):
        if not v.under_way[j, 0] <= v.wanted[j] <= v.under_way[j, 1]:
            return True
    return False


@kernel
def keep_under_way(r: int, share: float, v: Watch, m: Motion) -> None:
    """Take what a robot is to be told back towards what is under way.

    Args:
        r: The robot.
        share: How much of what is new is left [-].
        v: Watch; `wanted` is changed.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        known = min(max(v.wanted[j], v.under_way[j, 0]), v.under_way[j, 1])
        v.wanted[j] = known + share * (v.wanted[j] - known)


@kernel
def is_as_commanded(v: Watch, m: Motion, out: Floats) -> bool:
    """Whether joints move as they did or were told; narrows what they may do to that.

    Args:
        v: Watch.
        m: Motion; the bounds of measured velocities come nearer each other.
        out: Answer; a joint that is faster is named in it.
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
    """Note which delay a drive has at least, by how its joint follows commands.

    A joint that is beyond all commands of a time, and got farther beyond them, follows
    older ones. How soon it follows is not declared, so only this is sure.

    Args:
        j: The joint.
        r: Its robot.
        error: What it may be off its commands [rad/s].
        v: Watch; the robot's delay is raised.
        m: Motion; the bounds of the measured velocities are read.

    Returns:
        The shortest delay looked for that explains what it does, DELAY_STEPS if none.
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
    """Write between which velocities a joint is next time, by the delay of its drive.

    Until then its velocity stays between what it is now and what it may be driven to: a
    drive that has no greater delay is led by no command that is older than that, but
    for the one before.

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
        # Before the first command it was told to stand still.
        low, high = min(low, 0.0), max(high, 0.0)
    else:
        low, high = -inf, inf
    for older in range(k, DELAY_STEPS):
        expect_within(j, older, low, high, v, m)


@kernel
def expect_within(j: int, k: int, low: float, high: float, v: Watch, m: Motion) -> None:
    """Write the bounds for one delay: the commands, and what the joint is now."""
    r = int(m.robot_of_joint[j])
    if v.phase[r] != RUNNING and v.phase[r] != RECOVERING:
        low, high = -inf, inf
    # A joint that was within the bounds before is, wherever it was measured.
    error = m.joint_figures[j].tracking_error
    now_low = max(m.v_low[j], v.followed[j, 2 * k] - error)
    now_high = min(m.v_high[j], v.followed[j, 2 * k + 1] + error)
    v.followed[j, 2 * k] = min(low, now_low)
    v.followed[j, 2 * k + 1] = max(high, now_high)


@kernel
def time_passed(v: Watch) -> float:
    """Time since commands were sent last, no longer than a cycle may take [s]."""
    longest = v.pace[PERIOD] + v.pace[LATE]
    if v.sent_count[0] == 0:
        return float(v.pace[PERIOD])
    return float(min(moment(v) - v.commanded_at[0], longest))


@kernel
def moment(v: Watch) -> float:
    """Time of this cycle [s].

    Where nobody can tell, or it is not after the last commands, it is thought to be a
    cycle after them: an arm that is led to rest has to get there.
    """
    now, last = now_of(v), v.commanded_at[0]
    if isfinite(v.last[ORDERED_AT]) and isfinite(now) and now > last:
        return float(now)
    return last + v.pace[PERIOD] if isfinite(last) else 0.0


@kernel
def lead_to_rest(r: int, time: float, v: Watch, m: Motion) -> None:
    """Tell a robot to stand still: at once if it rests, else as its stop is declared.

    The stop begins with what a joint may have got to by then: one that has not come
    up to what it was told yet is not sped up to it.

    Args:
        r: The robot.
        time: Since its last command [s].
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
    """Settle what every joint is told in this cycle, and remember it."""
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
