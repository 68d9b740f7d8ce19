"""What callers hand to a cycle: real numbers, or refused without raising out of it."""

from collections.abc import Mapping
from numbers import Real
from reprlib import Repr
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Kinds of arrays that hold real numbers, or Python's own objects.
REAL_KINDS = "biufO"

BRIEF = Repr()


def real_number(value: object) -> float:
    """A real number as Python's own.

    Raises:
        TypeError: It is none: complex, a date, text, an array or a masked value.
        OverflowError: It is larger than a float can be.
    """
    if type(value) is np.ndarray and value.ndim == 0:
        value = value.item()
    if not isinstance(value, Real):
        raise TypeError
    return float(value)


def real_or_none(value: object) -> float | None:
    """The same, None in place of an error."""
    try:
        return real_number(value)
    except Exception:  # whatever a stranger's object raises
        return None


def real_array(value: object) -> Floats:
    """A copy of an array of real numbers.

    Raises:
        TypeError: It holds others, or masked values; and whatever else an object of a
            stranger raises.
    """
    array = np.asarray(value)
    if isinstance(value, np.ma.MaskedArray) or array.dtype.kind not in REAL_KINDS:
        raise TypeError
    return np.array(array, dtype=np.float64)


def is_mapping(value: object) -> TypeGuard[Mapping[str, float]]:
    """Whether a value is a mapping, also where an object refuses to say."""
    try:
        return isinstance(value, Mapping)
    except Exception:  # an object's `__class__` may raise
        return False


def described(value: object) -> str:
    """A value in a message, cut short."""
    try:
        return BRIEF.repr(value)
    except Exception:  # Python refuses to write integers of 4,300 digits
        return f"a {type(value).__name__}"


def kind_of(value: object) -> str:
    """What a value is, in a message."""
    name = type(value).__name__
    if issubclass(type(value), np.ndarray):
        return f"{name} of {getattr(value, 'dtype', '')}"
    return name
