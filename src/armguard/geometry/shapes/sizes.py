"""Checks of sizes and points, with the words a user reads."""

from math import isfinite
from numbers import Real

from armguard.errors import ShapeError

Point = tuple[float, float, float]


def check_size(shape: str, name: str, value: object, *, zero: bool = False) -> None:
    """Refuse a size that is no number, negative, zero unless allowed, or not finite.

    Raises:
        ShapeError: It is.
    """
    if not isinstance(value, Real):
        raise ShapeError(f"{shape} {name} is {value!r}; it must be a number [m]")
    size = float(value)
    if not (isfinite(size) and (size > 0.0 or (zero and size == 0.0))):
        bound = ">= 0" if zero else "> 0"
        raise ShapeError(f"{shape} {name} is {value} m; it must be finite and {bound}")


def checked_point(shape: str, name: str, value: Point) -> Point:
    """Three finite numbers as a tuple of floats.

    Raises:
        ShapeError: They are not.
    """
    try:
        numbers = tuple(map(float, value))
    except (TypeError, ValueError):
        raise ShapeError(
            f"{shape} {name} is {value!r}; it must be 3 numbers, as in (0.1, 0.2, 0.3)"
        ) from None
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise ShapeError(f"{shape} {name} is {numbers}; it must be 3 finite numbers")
    return numbers
