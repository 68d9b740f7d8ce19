"""Checks of sizes and points, with the words a user reads."""

from math import isfinite

from armguard.errors import ShapeError

Point = tuple[float, float, float]


def check_size(shape: str, name: str, value: float, *, zero: bool = False) -> None:
    """Refuse a size that is negative, zero unless allowed, or not finite.

    Raises:
        ShapeError: It is.
    """
    if not (isfinite(value) and (value > 0.0 or (zero and value == 0.0))):
        bound = ">= 0" if zero else "> 0"
        raise ShapeError(f"{shape} {name} is {value} m; it must be finite and {bound}")


def checked_point(shape: str, name: str, value: Point) -> Point:
    """Three finite numbers as a tuple of floats.

    Raises:
        ShapeError: They are not.
    """
    numbers = tuple(float(v) for v in value)
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise ShapeError(f"{shape} {name} is {numbers}; it must be 3 finite numbers")
    return numbers
