"""What operators ask for, as an array, or in words what it is instead."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def as_vector(what: str, value: object, count: int) -> tuple[Floats | None, str]:
    """A vector of so many numbers, or why it is none."""
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
    what: str, value: Mapping[str, float], names: Sequence[str]
) -> tuple[Floats | None, str]:
    """A vector from numbers by joint name, with nothing for those not named."""
    for name in value:
        if name not in names:
            return None, f"{what} names '{name}', no joint"
    return as_vector(what, [value.get(name, 0.0) for name in names], len(names))
