"""The plant: double integrators that obey an operator, until a stop takes effect.

All that is compiled is in this one file: Numba's cache does not see edits in others.
"""

from math import pi, sin, sqrt
from typing import NamedTuple

import numba
import numpy as np

from arrays import Floats, Ints

# Phases of an arm: it follows its operator; a stop or a brake; it rests and holds.
FREE = 0
STOPPING = 1
HELD = 2


class Plant(NamedTuple):
    """State and true figures of all arms; n joints, a arms; written in place.

    A stop that is ordered is carried out, whatever the guard answers later.

    Attributes:
        first: First joint of each arm, and n, shape (a + 1,).
        phase: Phase of each arm, shape (a,).
        braked: 1 where it was the brake that took effect, shape (a,).
        stop_at: Time at which the ordered stop takes effect, inf if none, shape (a,).
        brake_at: The same of an ordered brake, shape (a,).
        began: Time at which the present stop took effect, shape (a,) [s].
        rest_at: Time from which on all joints of the arm rest, shape (a,) [s].
        velocity: Top speed, shape (n,) [rad/s or m/s].
        acceleration: Acceleration with which the input is followed, shape (n,).
        q: Positions, shape (n,) [rad or m].
        v: Velocities, shape (n,) [rad/s or m/s].
        q0: Positions when it took effect, shape (n,).
        v0: Velocities when it took effect, shape (n,).
        deceleration: Of the ordered or present stop, shape (n,).
        ramp: Its ramp, shape (n,) [s].
        swing: How far a stop from top speed swings beyond its rest, or, if negative,
            back before it, shape (n,).
        swing_time: How long that takes, shape (n,) [s].
        brake: Deceleration of the brake, shape (n,).
    """

    first: Ints
    phase: Ints
    braked: Ints
    stop_at: Floats
    brake_at: Floats
    began: Floats
    rest_at: Floats
    velocity: Floats
    acceleration: Floats
    q: Floats
    v: Floats
    q0: Floats
    v0: Floats
    deceleration: Floats
    ramp: Floats
    swing: Floats
    swing_time: Floats
    brake: Floats


def plant_at(
    q: Floats, first: Ints, velocity: Floats, acceleration: Floats, brake: Floats
) -> Plant:
    """A plant at rest; no arm is its operator's yet: see `release`.

    Args:
        q: Positions, shape (n,) [rad or m].
        first: First joint of each arm, and n, shape (a + 1,).
        velocity: True top speeds, shape (n,).
        acceleration: True accelerations, shape (n,).
        brake: True decelerations of the brakes, shape (n,).
    """
    n, arms = len(q), len(first) - 1
    plant = Plant(
        np.asarray(first, dtype=np.int64),
        *np.zeros((2, arms), dtype=np.int64),
        *np.zeros((4, arms)),
        *np.zeros((11, n)),
    )
    plant.phase[:] = HELD
    plant.stop_at[:] = plant.brake_at[:] = np.inf
    plant.velocity[:], plant.acceleration[:] = velocity, acceleration
    plant.brake[:] = brake
    plant.q[:] = plant.q0[:] = q
    plant.deceleration[:] = 1.0
    return plant


@numba.njit(cache=True)
def rest_after(speed, deceleration, ramp):
    """Time from the effect of a stop until the joint first rests [s].

    Args:
        speed: Speed at the effect, >= 0 [rad/s or m/s].
        deceleration: Its full value [rad/s² or m/s²].
        ramp: Time in which it rises linearly from 0 to that [s].
    """
    if speed <= 0.0:
        return 0.0
    if speed <= 0.5 * deceleration * ramp:
        return sqrt(2.0 * ramp * speed / deceleration)
    return 0.5 * ramp + speed / deceleration


@numba.njit(cache=True)
def stopping_travel(t, speed, deceleration, ramp):
    """Way since the effect of a stop, and the speed left; no swing yet.

    Args:
        t: Time since the effect [s].
        speed: Speed at the effect, >= 0 [rad/s or m/s].
        deceleration: Its full value [rad/s² or m/s²].
        ramp: Time in which it rises linearly from 0 to that [s].

    Returns:
        Way [rad or m] and speed [rad/s or m/s], both >= 0.
    """
    t = min(t, rest_after(speed, deceleration, ramp))
    if t <= ramp:
        jerk = deceleration / ramp if ramp > 0.0 else 0.0
        way = speed * t - jerk * t**3 / 6.0
        return way, max(speed - 0.5 * jerk * t * t, 0.0)
    left = speed - 0.5 * deceleration * ramp
    on = t - ramp
    way = speed * ramp - deceleration * ramp**2 / 6.0 + left * on
    return way - 0.5 * deceleration * on * on, max(left - deceleration * on, 0.0)


@numba.njit(cache=True)
def swing_out(t, height, duration):
    """How far from its rest a joint is while it settles, and how fast.

    Out and back once, without a jump of the speed.

    Args:
        t: Time since the rest [s].
        height: Farthest, onwards; negative for a swing back [rad or m].
        duration: Time until it is back [s].

    Returns:
        Way from the rest, onwards [rad or m], and speed [rad/s or m/s].
    """
    if height == 0.0 or t <= 0.0 or t >= duration:
        return 0.0, 0.0
    u = pi * t / duration
    return height * sin(u) ** 2, height * pi / duration * sin(2.0 * u)


@numba.njit(cache=True)
def follow(p, arm, duration, desired):
    """Move an arm as its operator desires, within its true figures.

    Args:
        p: Plant.
        arm: Arm.
        duration: How long [s].
        desired: Desired velocities, shape (n,).
    """
    for j in range(p.first[arm], p.first[arm + 1]):
        aim = min(max(desired[j], -p.velocity[j]), p.velocity[j])
        change = aim - p.v[j]
        a = p.acceleration[j] if change > 0.0 else -p.acceleration[j]
        ramp = min(change / a, duration)
        p.q[j] += p.v[j] * ramp + 0.5 * a * ramp * ramp
        if ramp < duration:
            p.q[j] += aim * (duration - ramp)
            p.v[j] = aim
        else:
            p.v[j] += a * ramp


@numba.njit(cache=True)
def take_effect(p, arm, t, brake):
    """Begin a stop, or a brake in its place, from the present state."""
    p.phase[arm] = STOPPING
    p.braked[arm] = 1 if brake else 0
    p.began[arm] = t
    last = 0.0
    for j in range(p.first[arm], p.first[arm + 1]):
        p.q0[j], p.v0[j] = p.q[j], p.v[j]
        if brake:
            p.deceleration[j] = p.brake[j]
            p.ramp[j] = p.swing[j] = 0.0
        rest = rest_after(abs(p.v0[j]), p.deceleration[j], p.ramp[j])
        if p.v0[j] != 0.0 and p.swing[j] != 0.0:
            rest += p.swing_time[j]
        last = max(last, rest)
    p.rest_at[arm] = t + last


@numba.njit(cache=True)
def come_to_rest(p, arm, t):
    """State of an arm that stops, at time t; it holds once all its joints rest."""
    on = t - p.began[arm]
    for j in range(p.first[arm], p.first[arm + 1]):
        speed = abs(p.v0[j])
        sign = 1.0 if p.v0[j] >= 0.0 else -1.0
        way, left = stopping_travel(on, speed, p.deceleration[j], p.ramp[j])
        since = on - rest_after(speed, p.deceleration[j], p.ramp[j])
        height = p.swing[j] * speed / p.velocity[j]
        beyond, swinging = swing_out(since, height, p.swing_time[j])
        p.q[j] = p.q0[j] + sign * (way + beyond)
        p.v[j] = sign * (left + swinging)
    if t >= p.rest_at[arm]:
        p.phase[arm] = HELD
        p.v[p.first[arm] : p.first[arm + 1]] = 0.0


@numba.njit(cache=True)
def advance_arm(p, arm, t0, t1, desired):
    """Move one arm from t0 to t1; orders take effect at their instant in between."""
    t = t0
    while t < t1:
        if p.phase[arm] == HELD:
            return
        if p.brake_at[arm] <= t:
            p.brake_at[arm] = p.stop_at[arm] = np.inf
            take_effect(p, arm, t, True)
        elif p.stop_at[arm] <= t:
            p.stop_at[arm] = np.inf
            take_effect(p, arm, t, False)
        end = min(t1, p.brake_at[arm], p.stop_at[arm])
        if p.phase[arm] == FREE:
            follow(p, arm, end - t, desired)
        else:
            come_to_rest(p, arm, end)
        t = end


@numba.njit(cache=True)
def advance(p, tick, substep, desired, q_rows, v_rows, free_rows):
    """Move all arms over some substeps and write down every state.

    Args:
        p: Plant.
        tick: Number of the substep the plant is at.
        substep: Its length [s].
        desired: Desired velocities, shape (n,).
        q_rows: Positions after each substep, shape (k, n), overwritten.
        v_rows: Velocities after each substep, shape (k, n), overwritten.
        free_rows: Whether each arm is its operator's then, shape (k, a), overwritten.
    """
    for k in range(q_rows.shape[0]):
        t0, t1 = (tick + k) * substep, (tick + k + 1) * substep
        for arm in range(p.phase.shape[0]):
            advance_arm(p, arm, t0, t1, desired)
            free_rows[k, arm] = p.phase[arm] == FREE
        q_rows[k] = p.q
        v_rows[k] = p.v


def order_stop(
    p: Plant, arm: int, at: float, stop: tuple[Floats, Floats, Floats, Floats]
) -> None:
    """Have a stop take effect at a time, unless one is ordered or under way.

    Args:
        p: Plant.
        arm: Arm.
        at: Time at which it takes effect [s].
        stop: Deceleration, ramp, swing from top speed, and its time, each (n,).
    """
    if p.phase[arm] != FREE or p.stop_at[arm] < np.inf:
        return
    p.stop_at[arm] = at
    own = slice(p.first[arm], p.first[arm + 1])
    p.deceleration[own], p.ramp[own], p.swing[own], p.swing_time[own] = (
        figure[own] for figure in stop
    )


def order_brake(p: Plant, arm: int, at: float) -> None:
    """Have the brake take effect at a time, unless it is ordered or on already."""
    if p.phase[arm] != HELD and not p.braked[arm]:
        p.brake_at[arm] = min(p.brake_at[arm], at)


def release(p: Plant, arm: int) -> bool:
    """Give an arm that rests back to its operator; whether that was so."""
    if p.phase[arm] != HELD:
        return False
    p.phase[arm] = FREE
    p.braked[arm] = 0
    p.stop_at[arm] = p.brake_at[arm] = np.inf
    return True
