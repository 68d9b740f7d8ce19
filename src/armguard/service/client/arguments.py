"""Arguments of a client, or an error with the value and its remedy."""

from collections.abc import Mapping, Sequence
from math import inf, isnan, nan
from numbers import Integral, Real
from reprlib import repr as brief
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import RefusedError, known_names
from armguard.recording.rights import Role
from armguard.service.wire.layout import TWIST

Floats = NDArray[np.float64]

# Longer times look like milliseconds: of an answer in a loop, and of a reply [s].
LONG_ANSWER, LONG_REPLY = 5.0, 1000.0

PORTS = 65535

# A HELLO has room for no larger number.
MOST_EVERY = 2**31 - 1


def numbers_of(
    values: ArrayLike | None,
    name: str,
    count: int | None = None,
    parts: str = "joint, in the order of Welcome.names",
) -> Floats:
    """An array of real numbers.

    Args:
        values: The array, in any form.
        name: What it is, for messages.
        count: How many numbers it must have; any if None.
        parts: What each number is for, for messages.

    Raises:
        RefusedError: It holds other values, or has another shape.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "iufO":
            raise TypeError
        numbers = array.astype(np.float64)
    except (TypeError, ValueError):
        raise RefusedError(
            f"{name} is {brief(values)}; it must be real numbers"
        ) from None
    if count is not None and numbers.shape != (count,):
        raise RefusedError(
            f"{name} has shape {numbers.shape}; it must be ({count},), one for "
            f"each {parts}"
        )
    return numbers


def seconds_of(value: Any, name: str, long: float) -> float:
    """A time to wait, infinite to wait without a limit [s].

    Args:
        value: The time.
        name: What it is, for messages.
        long: A longer time looks like milliseconds [s].

    Raises:
        RefusedError: It is no number, or looks like milliseconds.
    """
    seconds = float(value) if isinstance(value, Real) else nan
    if isnan(seconds):
        raise RefusedError(f"{name} is {brief(value)}; it must be a number [s]")
    if long < seconds < inf:
        raise RefusedError(
            f"{name} is {seconds:g} s, which looks like milliseconds; give seconds: "
            f"{seconds * 1e-3:g}"
        )
    return seconds


def watchdog_of(value: Any) -> float:
    """A watchdog [s].

    Raises:
        RefusedError: It is no finite number above 0, or looks like milliseconds.
    """
    watchdog = seconds_of(value, "watchdog", LONG_ANSWER)
    if not 0.0 < watchdog < inf:
        raise RefusedError(f"watchdog is {watchdog:g} s; it must be finite and > 0")
    return watchdog


def whole_number_of(value: Any, name: str, least: int, most: int) -> int:
    """A whole number in a range.

    Raises:
        RefusedError: It is none.
    """
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not (whole and least <= value <= most):
        raise RefusedError(
            f"{name} is {brief(value)}; it must be a whole number from {least} to "
            f"{most}"
        )
    return int(value)


def role_of(value: Any) -> Role:
    """A role.

    Raises:
        RefusedError: It is none.
    """
    if value not in tuple(Role):
        roles = ", ".join(f"Role.{role.name}" for role in Role)
        raise RefusedError(f"role is {brief(value)}; it must be one of {roles}")
    return Role(value)


def text_of(value: Any, name: str) -> str:
    """A text.

    Raises:
        RefusedError: It is none.
    """
    if not isinstance(value, str):
        raise RefusedError(f"{name} is {brief(value)}; it must be text")
    return value


def names_of(value: Any, name: str) -> tuple[str, ...]:
    """Names: one, or several.

    Raises:
        RefusedError: They are no text.
    """
    several = isinstance(value, tuple | list)
    return tuple(text_of(one, name) for one in (value if several else (value,)))


def twist_rows(twists: Any, tools: Sequence[str]) -> list[list[float]]:
    """Twists by tool as rows: the index of the tool, then its twist.

    Args:
        twists: Twists by the name of a tool, shape (6,) each [m/s], [rad/s].
        tools: Names of all tools.

    Raises:
        RefusedError: They are no mapping, or there is no such tool.
    """
    if not isinstance(twists, Mapping):
        raise RefusedError(
            f"the desired motion is {brief(twists)}; give a twist by tool, such as "
            "{'left': [vx, vy, vz, wx, wy, wz]}"
        )
    rows = []
    for name, twist in twists.items():
        if name not in tools:
            known = known_names(tools, 12)
            raise RefusedError(f"the scene has no tool '{name}'; {known}")
        what, parts = f"the twist of '{name}'", "of vx, vy, vz, wx, wy, wz"
        six = numbers_of(twist, what, TWIST - 1, parts)
        rows.append([tools.index(name), *six])
    return rows
