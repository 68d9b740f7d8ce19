"""Bounded motions of joints, in closed form.

All that is compiled is in this one file: Numba's cache does not see edits in others.
"""

from typing import NamedTuple

import numba
import numpy as np

from arrays import Floats


class Motion(NamedTuple):
    """Joints that accelerate evenly until a switch and otherwise after it.

    A joint that gets to its top speed stays at it.

    Attributes:
        q: Positions at the start, shape (n,) [rad].
        v: Velocities at the start, shape (n,) [rad/s].
        first: Accelerations before the switch, shape (n,) [rad/s²].
        then: Accelerations after it, shape (n,) [rad/s²].
        switch: When that is, shape (n,) [s].
        top: Top speeds, shape (n,) [rad/s].
    """

    q: Floats
    v: Floats
    first: Floats
    then: Floats
    switch: Floats
    top: Floats


@numba.njit(cache=True)
def state_at(t: float, motion: Motion, out: Floats) -> None:
    """Positions and velocities at a time, written to rows 0 and 1 of out, (2, n)."""
    for j in range(motion.q.shape[0]):
        x, s = motion.q[j], motion.v[j]
        for phase in range(2):
            a = motion.first[j] if phase == 0 else motion.then[j]
            lasts = min(t, motion.switch[j])
            if phase == 1:
                lasts = t - lasts
            ramp = lasts
            if a != 0.0:
                top = motion.top[j] if a > 0.0 else -motion.top[j]
                ramp = min(max((top - s) / a, 0.0), lasts)
            x += s * ramp + 0.5 * a * ramp * ramp
            s += a * ramp
            x += s * (lasts - ramp)
        out[0, j], out[1, j] = x, s


@numba.njit(cache=True)
def safe_time(gap: float, levers: Floats, hardest: Floats, state: Floats) -> float:
    """Time in which a gap cannot be used up, by how far levers carry [s].

    Args:
        gap: Distance, > 0 [m].
        levers: Of each joint, shape (n,) [m/rad].
        hardest: Greatest accelerations, shape (n,) [rad/s²].
        state: Positions and velocities, shape (2, n).
    """
    speed = push = 0.0
    for j in range(levers.shape[0]):
        speed += levers[j] * abs(state[1, j])
        push += levers[j] * hardest[j]
    root = np.sqrt(speed * speed + 2.0 * push * gap)
    return float(2.0 * gap / (speed + root)) if root > 0.0 else np.inf
