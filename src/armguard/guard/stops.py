"""Ordered stops: supervision against the declared figures, standstill, and release.

A stop is done when standstill is measured. Until then each joint's speed is compared
with the greatest that the declared figures permit. If it is greater, the figures are
disproved: the brake is ordered, and if that lags as well, a stop from outside.
"""

from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Reason
from armguard.guard.observe import now_of, unannounced_time
from armguard.guard.settling import swing_speed
from armguard.guard.watch import (
    BRAKING,
    LOST,
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
from armguard.motion.joint_stop import curve_at, speed_lost, whole_way
from armguard.motion.state import (
    NEXT,
    NOW,
    Motion,
)
from armguard.record import clear

Floats = NDArray[np.float64]

STOP_LAGS = int(Reason.STOP_LAGS)
BRAKE_LAGS = int(Reason.BRAKE_LAGS)
MOVED = int(Reason.MOVED_AT_REST)
OK = int(Reason.OK)
CYCLE_LATE = int(Reason.CYCLE_LATE)

# Consecutive samples with too great a velocity that prove a lagging stop: one sample
# may exceed its declared error and still agree with its neighbours [-].
LAGGING_SAMPLES = 2

# Consecutive cycles of a robot at rest before its stop counts as done [-].
REST_CYCLES = 5

# Round-off of a speed [rad/s] or a position [rad].
GRAIN = 1e-7

# Long enough for every ramp to have passed [s].
LONG_AGO = 1e6


@kernel
def supervise_stops(v: Watch, m: Motion) -> None:
    """Compare every ordered stop with the declared figures; detect standstill."""
    now = now_of(v)
    for r in range(v.phase.shape[0]):
        phase = v.phase[r]
        driven = phase == RUNNING or phase == RECOVERING
        if driven or m.robot_figures[r].mode == FIXED:
            continue
        if phase == RESTING:
            if not is_at_rest(r, v, m):
                order(r, STOPPING, MOVED, now, v, m)
            continue
        fresh = v.stamps[r] > v.fastest_at[r]
        lagging = follow_stop(r, v, m)
        if lagging >= 0:
            v.lagged[r] += int(fresh)
            if v.lagged[r] < LAGGING_SAMPLES:
                continue
            v.disproved[lagging] = 1
            if phase == STOPPING:
                order(r, BRAKING, STOP_LAGS, now, v, m)
            elif phase == BRAKING:
                order(r, LOST, BRAKE_LAGS, now, v, m)
            continue
        v.lagged[r] = 0
        v.rested[r] = v.rested[r] + 1 if is_at_rest(r, v, m) else 0
        if v.rested[r] <= 1:
            v.rest_began[r] = now
        done = now - v.ordered[r] > m.robot_figures[r].command
        done &= v.rested[r] >= REST_CYCLES
        # Measured rest may be the moment before a swing.
        done &= now - v.rest_began[r] >= m.robot_figures[r].settle_time
        if done and phase == STOPPING:
            v.phase[r] = RESTING


@kernel
def is_at_rest(r: int, v: Watch, m: Motion) -> bool:
    """Whether every joint of a robot may be at rest within measurement errors."""
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        if not (m.v_low[j] <= 0.0 <= m.v_high[j]):
            return False
    return True


@kernel
def follow_stop(r: int, v: Watch, m: Motion) -> int:
    """Update the speed bounds of a stop, and compare them with the measurement.

    Returns:
        A joint that is faster or farther than permitted, or -1.
    """
    robot = m.robot_figures[r]
    effect = effect_time(r, v, m)
    before, now = v.fastest_at[r], v.stamps[r]
    v.fastest_at[r] = now
    unannounced = v.given.now != v.given.now
    if unannounced and v.last.forced == CYCLE_LATE:
        # Stamps alone do not distinguish a pause from a clock that jumped ahead.
        return -1
    first = robot.first_joint
    lagging = -1
    for j in range(first, first + robot.joint_count):
        figures = m.joint_figures[j]
        bound = v.fastest[j]
        # Acceleration by the operator before the stop took effect.
        driven = min(now, effect) - min(before, effect)
        bound = min(
            bound + figures.acceleration * max(driven, 0.0),
            max(bound, figures.velocity),
        )
        bound = slowed(j, bound, before - effect, now - effect, v.phase[r], m)
        # Below the speed of settling, only the position shows whether a joint stopped.
        least = max(m.v_low[j], -m.v_high[j])
        if not least <= max(bound, swing_speed(robot, figures)) + GRAIN:
            lagging = j
        if not v.rest_low[j] <= m.q[j] <= v.rest_high[j]:
            lagging = j
            v.lagged[r] = LAGGING_SAMPLES
        if figures.curve == 0.0:
            # A table gives the time to rest from the initial speed of a stop, which
            # may have begun at any time since it was ordered.
            # A single sample may be too slow, but not its neighbours too.
            measured = max(abs(m.v_low[j]), abs(m.v_high[j]))
            earlier = slowed(
                j, speed_before(j, v, m), before - effect, now - effect, v.phase[r], m
            )
            bound = min(bound, max(measured, earlier))
        v.fastest[j] = bound
    return lagging


@kernel
def effect_time(r: int, v: Watch, m: Motion) -> float:
    """Latest time at which a robot's order takes effect, on the clock of stamps [s]."""
    robot = m.robot_figures[r]
    delay = robot.command if v.phase[r] == STOPPING else robot.brake_delay
    return float(v.ordered[r] + delay)


@kernel
def speed_before(j: int, v: Watch, m: Motion) -> float:
    """Greatest speed by the sample before the last accepted one; 0 if there is none."""
    speed = abs(v.agreement[j].earlier)
    return float(speed + m.joint_figures[j].velocity_error) if speed == speed else 0.0


@kernel
def unknown_age(r: int, v: Watch, m: Motion) -> float:
    """Additional age of a measurement if the time of the cycle is not given [s]."""
    commanded = v.given.now == v.given.now
    return 0.0 if commanded else float(m.robot_figures[r].sensing)


@kernel
def slowed(
    j: int, bound: float, start: float, end: float, phase: int, m: Motion
) -> float:
    """Greatest speed of a joint after a part of a stop [rad/s or m/s].

    Args:
        j: The joint.
        bound: Greatest speed before that part [rad/s or m/s].
        start: Start of that part, from the effect of the order on [s].
        end: End of that part, from the effect of the order on [s].
        phase: STOPPING, or a brake.
        m: Figures.
    """
    figures = m.joint_figures[j]
    if end <= 0.0:
        return bound
    if phase != STOPPING:
        return float(
            max(bound - figures.brake_deceleration * (end - max(start, 0.0)), 0.0)
        )
    if figures.curve != 0.0:
        # A table gives the time of rest, not the speed before.
        time, _ = curve_at(m.curves[j], bound / figures.velocity)
        return 0.0 if end >= time else bound
    ramp, d = m.robot_figures[m.robot_of_joint[j]].ramp, figures.deceleration
    lost = speed_lost(end, ramp, d) - speed_lost(start, ramp, d)
    return float(max(bound - lost, 0.0))


@kernel
def order(r: int, phase: int, cause: int, now: float, v: Watch, m: Motion) -> None:
    """Order a stop or brake of a robot, and start to supervise its speeds."""
    v.phase[r] = phase
    # The latest possible time of the order: if the time of the cycle is not given, it
    # is later than the newest stamp.
    v.ordered[r] = now + unknown_age(r, v, m)
    v.cause[r] = cause
    v.rested[r] = v.lagged[r] = 0
    v.fastest_at[r] = v.last_stamp[r]
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        v.fastest[j] = max(abs(m.v_low[j]), abs(m.v_high[j]), speed_before(j, v, m))
        # Range of positions during the stop, if the order takes effect as declared.
        clock = m.clock[NOW * v.phase.shape[0] + r]
        up, down = m.up[NOW * m.q.shape[0] + j], m.down[NOW * m.q.shape[0] + j]
        error = 2.0 * m.joint_figures[j].position_error + GRAIN
        v.rest_high[j], v.rest_low[j] = inf, -inf
        forget_swing(j, m)
        if phase == STOPPING and clock.reaction > 0.0:
            # As planned for a stop that is ordered now.
            stop = m.swings[j]
            stop.swing = max(up.swing, down.swing)
            stop.lowest = m.q[j] - whole_way(down)
            stop.highest = m.q[j] + whole_way(up)
            v.rest_high[j] = stop.highest + error
            v.rest_low[j] = stop.lowest - error
        elif phase <= BRAKING:
            error += m.joint_figures[j].settle
            v.rest_high[j] = m.q[j] + error + way_to_rest(r, j, m.v_high[j], v, m)
            v.rest_low[j] = m.q[j] - error - way_to_rest(r, j, -m.v_low[j], v, m)


@kernel
def forget_swing(j: int, m: Motion) -> None:
    """Permit the swing of a stop from top speed: this stop was not planned."""
    m.swings[j].swing = m.joint_figures[j].settle
    m.swings[j].lowest, m.swings[j].highest = -inf, inf


@kernel
def way_to_rest(r: int, j: int, velocity: float, v: Watch, m: Motion) -> float:
    """Greatest travel of a joint in a direction if it stops as declared [rad].

    For stops that were not planned: a brake, or the stop of a robot at rest that moves.
    """
    figures, robot = m.joint_figures[j], m.robot_figures[r]
    delay = effect_time(r, v, m) - v.last_stamp[r]
    speed = max(velocity, 0.0)
    after = min(speed + figures.acceleration * delay, max(speed, figures.velocity))
    deceleration = figures.brake_deceleration
    if v.phase[r] == STOPPING:
        if figures.curve != 0.0:
            return inf
        deceleration = figures.deceleration
        delay += robot.ramp
    return float(after * delay + 0.5 * after * after / deceleration)


@kernel
def set_clocks(v: Watch, m: Motion) -> None:
    """Write the delays of each robot's stop, if ordered now or in the next cycle."""
    now = now_of(v)
    robots = v.phase.shape[0]
    cycle = v.timing.period + v.timing.late + unannounced_time(v, m)
    for plan in range(2):
        for r in range(robots):
            clock = m.clock[plan * robots + r]
            clear(clock)
            robot = m.robot_figures[r]
            if robot.mode == FIXED:
                clock.still = 1
                continue
            clock.age = now - v.stamps[r] + unknown_age(r, v, m)
            phase = v.phase[r]
            driven = phase == RUNNING or phase == RECOVERING
            if driven or (phase == RESTING and plan == NEXT):
                clock.reaction = clock.age + robot.command
                if plan == NEXT:
                    # A robot at rest is released if it could move one cycle longer.
                    clock.reaction += cycle if driven else 2.0 * cycle
            elif phase == RESTING:
                clock.passed = LONG_AGO
            else:
                effect = effect_time(r, v, m)
                clock.reaction = max(effect - v.stamps[r], 0.0)
                clock.passed = max(v.stamps[r] - effect, 0.0)
                clock.braking = 0 if phase == STOPPING else 1
                clock.swings = 1


@kernel
def order_stops(v: Watch, m: Motion) -> None:
    """Order the stops that this cycle demands, and release robots that may move."""
    now = now_of(v)
    forced = v.last.forced
    for r in range(v.phase.shape[0]):
        if m.robot_figures[r].mode == FIXED:
            continue
        must = v.must[r] != 0 or forced != OK
        driven = v.phase[r] == RUNNING or v.phase[r] == RECOVERING
        if driven and must:
            order(r, STOPPING, forced if forced != OK else v.cause[r], now, v, m)
        elif v.phase[r] == RESTING and not must:
            v.phase[r] = RUNNING


@kernel
def stop_everything(reason: int, v: Watch, m: Motion) -> None:
    """Order a stop of every running robot, for an implausible input."""
    for r in range(v.phase.shape[0]):
        driven = v.phase[r] == RUNNING or v.phase[r] == RECOVERING
        if m.robot_figures[r].mode != FIXED and driven:
            order(r, STOPPING, reason, v.last.ordered_at, v, m)
            # The travel of this stop was not planned in this cycle.
            first = m.robot_figures[r].first_joint
            for j in range(first, first + m.robot_figures[r].joint_count):
                # The refused velocity may be true.
                if v.given.has_velocity != 0 and isfinite(v.velocity[j]):
                    top = max(v.fastest[j], m.joint_figures[j].velocity)
                    speed = abs(v.velocity[j]) + m.joint_figures[j].velocity_error
                    v.fastest[j] = max(v.fastest[j], min(speed, top))
                v.rest_low[j], v.rest_high[j] = -inf, inf
                forget_swing(j, m)
