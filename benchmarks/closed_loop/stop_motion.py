"""How one joint comes to rest: the closed form of a stop."""

from math import pi, sin, sqrt

import numba


@numba.njit(cache=True)
def rest_after(speed, deceleration, ramp):
    """Time from the effect of a stop until the joint first stands [s].

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
    """How far beyond its rest a joint is while it settles, and how fast.

    Out and back once, without a jump of the speed.

    Args:
        t: Time since the rest [s].
        height: Farthest [rad or m].
        duration: Time until it is back [s].

    Returns:
        Way beyond the rest [rad or m] and speed [rad/s or m/s].
    """
    if height == 0.0 or t <= 0.0 or t >= duration:
        return 0.0, 0.0
    u = pi * t / duration
    return height * sin(u) ** 2, height * pi / duration * sin(2.0 * u)
