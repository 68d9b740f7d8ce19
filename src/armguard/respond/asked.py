"""What operators ask for, as velocities of joints: from positions, and from twists."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Share of the greatest deceleration a joint that goes to a position plans with [-].
GENTLE = 0.5


def velocity_towards(
    target: Floats, held: Floats, deceleration: Floats, period: float
) -> Floats:
    """Velocities that lead to positions, and stop there, shape (n,).

    Args:
        target: Where the joints are to be, shape (n,) [rad or m].
        held: Where they were told to be by now, shape (n,) [rad or m].
        deceleration: What each can slow down by, shape (n,) [rad/s² or m/s²].
        period: Time of a cycle [s].
    """
    way = target - held
    size = np.abs(way)
    # From this speed it stops within the way, a cycle at that speed included.
    d = GENTLE * deceleration
    speed = d * (np.sqrt(period * period + 2.0 * size / d) - period)
    velocity: Floats = np.sign(way) * np.minimum(size / period, speed)
    return velocity


def as_vector(what: str, value: object, count: int) -> tuple[Floats | None, str]:
    """A vector of so many finite numbers, or in words what it is instead."""
    try:
        array = np.array(value, dtype=np.float64)
    except Exception:  # whatever a stranger's object raises, the loop goes on
        return None, f"{what} is a {type(value).__name__}; it must be {count} numbers"
    if array.shape != (count,):
        return None, f"{what} has shape {array.shape}; it must be {count} numbers"
    if not np.isfinite(array).all():
        return None, f"{what} holds {array[~np.isfinite(array)][0]}; it must be finite"
    return array, ""


def named_vector(
    what: str, value: Mapping[str, float], names: tuple[str, ...]
) -> tuple[Floats | None, str]:
    """A vector from numbers by joint name; joints that are not named get none."""
    places = {name: k for k, name in enumerate(names)}
    array = np.zeros(len(names))
    for name, number in value.items():
        if name not in places:
            return None, f"{what} names '{name}', no joint"
        array[places[name]] = number
    return as_vector(what, array, len(names))
