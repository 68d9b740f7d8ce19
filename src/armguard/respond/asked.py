"""What operators ask for, as an array, or in words what it is instead."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.guard.given import described, kind_of, real_array
from armguard.guard.levels import ORDERED, Reason

Floats = NDArray[np.float64]


def as_vector(what: str, value: object, count: int) -> tuple[Floats | None, str]:
    """A vector of so many numbers, or why it is none."""
    try:
        array = real_array(value)
    except Exception:  # whatever a stranger's object raises, the loop goes on
        return None, f"{what} is a {kind_of(value)}; it must be {count} numbers"
    if array.shape != (count,):
        return None, f"{what} has shape {array.shape}; it must be {count} numbers"
    if not np.isfinite(array).all():
        return None, f"{what} holds {array[~np.isfinite(array)][0]}; it must be finite"
    return array, ""


def named_vector(
    what: str, value: Mapping[str, float], names: Sequence[str]
) -> tuple[Floats | None, str]:
    """A vector from numbers by joint name, with nothing for those not named."""
    try:
        for name in value:
            if name not in names:
                return None, f"{what} names {described(name)}, no joint"
        numbers = [value.get(name, 0.0) for name in names]
    except Exception:  # as above
        return None, f"{what} is a {kind_of(value)}; it must be numbers by joint name"
    return as_vector(what, numbers, len(names))


def reason_of_stop(reason: object) -> Reason:
    """The reason of a stop that is ordered: `STOP_ORDERED` if it is none of these."""
    if isinstance(reason, Reason) and reason in ORDERED:
        return reason
    return Reason.STOP_ORDERED
