"""Times of a motion: their unit, their order, and whether they fit the motion."""

import re

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError

Floats = NDArray[np.float64]

# Column names that mean time, and units they may end in: `t`, `time_ms`, `stamp [s]`.
TIME_COLUMN = re.compile(
    r"(?:t|times?|stamps?|timestamps?|time_from_start)"
    r"(?:[ _]?[\[(]?(s|sec|ms|us|µs|ns)[\])]?)?",
    re.IGNORECASE,
)
UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}

# Seconds since 1970 are below this for another three thousand years [s].
MOST_SECONDS = 1e11

# Share of a speed limit that no motion in seconds reaches [-].
SURELY_TOO_FAST = 100.0

# Times that are read as seconds may be in another unit if so much passes from one
# configuration to the next [s], and the top speed in that unit is such a share of its
# limit [-]. No motion has the longer time; one in another unit has at most 1 s.
LONG_PERIOD = 0.5
LIKELY_SHARE = (0.05, 2.0)
SURELY_LONG = 1000.0
OTHER_UNITS = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}


def unit_of(column: str) -> str | None:
    """Unit in the name of a column of times."""
    match = TIME_COLUMN.fullmatch(column)
    return match[1] if match else None


def seconds(name: str, column: str, values: np.ndarray) -> np.ndarray:
    """A column of times [s]."""
    if unit := unit_of(column):
        return np.asarray(values * UNITS[unit.lower()])
    if len(values) and MOST_SECONDS < abs(values[0]) < np.inf:
        raise TrajectoryError(
            f"{name}: '{column}' begins with {values[0]:g}, which is no time in "
            f"seconds; name its unit: '{column}_ms', '{column}_us' or '{column}_ns'"
        )
    return values


def check_times(source: str, stamps: Floats) -> None:
    """Refuse times that are not finite or go back.

    Args:
        source: The file.
        stamps: Times, shape (k,) [s].

    Raises:
        TrajectoryError: There are such times.
    """
    for k in np.flatnonzero(~np.isfinite(stamps)):
        raise TrajectoryError(
            f"{source}: the time of configuration {k + 1} is {stamps[k]:g}; give a "
            "finite time, or delete the configuration"
        )
    for k in np.flatnonzero(~(np.diff(stamps) >= 0.0)):
        raise TrajectoryError(
            f"{source}: time goes from {stamps[k]:g} s to {stamps[k + 1]:g} s at "
            f"configuration {k + 2}; it must not go back: sort the file by time"
        )


def check_change(source: str, q: Floats, stamps: Floats) -> None:
    """Refuse times that are equal where configurations differ, or all equal.

    Args:
        source: The file.
        q: Configurations, shape (k, n) [rad or m].
        stamps: Their times, shape (k,) [s].

    Raises:
        TrajectoryError: There are such times.
    """
    if len(stamps) > 1 and stamps[0] == stamps[-1]:
        raise TrajectoryError(
            f"{source}: all {len(stamps)} configurations have the time {stamps[0]:g} "
            "s; correct the times, or leave them out"
        )
    steps = np.diff(np.where(np.isfinite(q), q, 0.0), axis=0)
    for k in np.flatnonzero(steps.any(axis=1) & (np.diff(stamps) == 0.0)):
        raise TrajectoryError(
            f"{source}: configurations {k + 1} and {k + 2} differ and both have the "
            f"time {stamps[k]:.9g} s; correct a time, or delete one of them"
        )


def check_unit(source: str, used: dict[str, float], period: float) -> None:
    """Refuse times without a unit that do not look like seconds.

    Args:
        source: The file.
        used: Greatest speed of each joint as a share of its speed limit [-].
        period: Median time from one configuration to the next [s].

    Raises:
        TrajectoryError: They look like another unit.
    """
    joint = max(used, key=used.__getitem__, default="")
    share = used.get(joint, 0.0)
    if share > SURELY_TOO_FAST:
        raise TrajectoryError(
            f"{source}: joint '{joint}' would move at {share:.0f} times its speed "
            "limit: the times are too short for seconds; correct them, or write the "
            "unit into the header if they are right: 't_s'"
        )
    low, high = LIKELY_SHARE
    for unit, name in OTHER_UNITS.items():
        likely = period >= LONG_PERIOD and low < share / UNITS[unit] < high
        if likely or (period >= SURELY_LONG and period * UNITS[unit] <= 1.0):
            raise TrajectoryError(
                f"{source}: {period:g} s from one configuration to the next, and at "
                f"most {100.0 * share:.2g} % of a speed limit: that looks like {name}; "
                f"name the times 't_{unit}', or 't_s' if they are seconds"
            )
