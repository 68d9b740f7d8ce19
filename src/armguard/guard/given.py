"""Input of a cycle: conversion to arrays of real numbers; never raises in the loop."""

from collections.abc import Iterable, Mapping
from numbers import Real
from reprlib import Repr
from typing import TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import did_you_mean
from armguard.guard.watch import HAS_VELOCITY, NOW_TIME, Watch

Floats = NDArray[np.float64]

# Kinds of arrays that hold real numbers, or Python's own objects.
REAL_KINDS = "biufO"

BRIEF = Repr()

FLOAT64 = np.dtype(np.float64)

# Positions of a cycle whose input is refused.
NO_POSITIONS: Floats = np.zeros(0)


def real_number(value: object) -> float:
    """A real number as a Python float.

    Raises:
        TypeError: It is complex, a date, text, an array or a masked value.
        OverflowError: It is larger than a float can be.
    """
    if type(value) is np.ndarray and value.ndim == 0:
        value = value.item()
    if not isinstance(value, Real):
        raise TypeError
    return float(value)


def real_or_none(value: object) -> float | None:
    """A real number as a Python float; None if it is not one."""
    try:
        return real_number(value)
    except Exception:  # an unknown object may raise any exception
        return None


def real_array(value: object) -> Floats:
    """A copy of an array of real numbers.

    Raises:
        TypeError: It holds other values, or masked ones. An unknown object may raise
            any other exception.
    """
    array = np.asarray(value)
    if isinstance(value, np.ma.MaskedArray) or array.dtype.kind not in REAL_KINDS:
        raise TypeError
    return np.array(array, dtype=np.float64)


def is_mapping(value: object) -> TypeGuard[Mapping[str, float]]:
    """Whether a value is a mapping; False if the test itself raises."""
    try:
        return isinstance(value, Mapping)
    except Exception:  # an object's `__class__` may raise
        return False


def described(value: object) -> str:
    """A value as text for a message, truncated."""
    try:
        return BRIEF.repr(value)
    except Exception:  # Python refuses to write integers of 4,300 digits
        return f"a {type(value).__name__}"


def kind_of(value: object) -> str:
    """Type of a value as text for a message."""
    name = type(value).__name__
    if issubclass(type(value), np.ndarray):
        return f"{name} of {getattr(value, 'dtype', '')}"
    return name


class CycleInput:
    """Converts positions, velocities and stamps of a cycle, or returns a fault.

    Attributes:
        shape: Shape of a joint vector, (n,).
        robots: Index of each robot by name.
        last_stamp: Newest stamp where no stops are predicted [s].

    Args:
        watch: Its `given`, `stamps` and `velocity` are written.
        robots: Names of the robots in their order.
    """

    def __init__(self, watch: Watch, robots: Iterable[str]) -> None:
        self.shape = watch.velocity.shape
        self.robots = {name: r for r, name in enumerate(robots)}
        self.last_stamp = -np.inf
        self._given, self._stamps = watch.given, watch.stamps
        self._velocity = watch.velocity

    def take(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float] | None,
        velocity: ArrayLike | None,
        now: float | None,
    ) -> tuple[Floats, str]:
        """Positions for the kernel, and the fault of the input in words, or "".

        With a fault the positions are empty: the cycle refuses them, and orders its
        stops.
        """
        if type(stamp) is float and type(now) is float and now == now:
            self._given[NOW_TIME] = now
            self._stamps.fill(stamp)
        elif fault := self._take_times(stamp, now):
            return NO_POSITIONS, fault
        if fault := self._take_velocity(velocity):
            return NO_POSITIONS, fault
        return self.positions(q)

    def positions(self, q: ArrayLike) -> tuple[Floats, str]:
        """Positions for the kernel, and their fault in words, or ""."""
        if (
            type(q) is np.ndarray
            and q.dtype is FLOAT64
            and q.shape == self.shape
            and q.flags.carray
        ):
            return q, ""
        return self._convert("q", q)

    def judge_stamp(self, stamp: float | Mapping[str, float]) -> str:
        """Store a stamp where no stops are predicted; returns its fault, or ""."""
        try:
            if type(stamp) is float:
                newest = stamp
            elif isinstance(stamp, Mapping):
                stamps = [self.last_stamp, *map(real_number, stamp.values())]
                newest = max(stamps[1:] or stamps)
            else:
                newest = real_number(stamp)
        except Exception:  # an unknown object may raise any; the loop continues
            newest = np.nan
        if not newest >= self.last_stamp:
            return (
                f"stamp is {described(stamp)}; it must be a number not less than the "
                f"last one, {self.last_stamp}"
            )
        self.last_stamp = newest
        return ""

    def _take_times(
        self, stamp: float | Mapping[str, float] | None, now: float | None
    ) -> str:
        """Write stamps and the time of the cycle for the kernel; returns a fault."""
        given, stamps = self._given, self._stamps
        try:
            if now is None:
                given[NOW_TIME] = np.nan
            else:
                time = now if type(now) is float else real_number(now)
                # NaN would read as no time given; infinity is refused.
                given[NOW_TIME] = time if time == time else np.inf
            if type(stamp) is float:
                stamps.fill(stamp)
            elif stamp is None:
                stamps.fill(np.nan)
            elif isinstance(stamp, Mapping):
                for name, r in self.robots.items():
                    own = stamp.get(name)
                    stamps[r] = np.nan if own is None else real_number(own)
                unknown = [name for name in stamp if name not in self.robots]
                if unknown:
                    near = did_you_mean(str(unknown[0]), self.robots)
                    return (
                        f"there is a stamp for {described(unknown[0])}, no robot; "
                        f"{near}"
                    )
            else:
                stamps.fill(real_number(stamp))
        except Exception:  # an unknown object may raise any; the loop continues
            # No time of the last cycle may count as a time of this one.
            stamps.fill(np.nan)
            given[NOW_TIME] = np.nan
            return (
                f"stamp is {described(stamp)} and now is {described(now)}; they must "
                "be numbers [s]"
            )
        return ""

    def _take_velocity(self, velocity: ArrayLike | None) -> str:
        """Write velocities for the kernel; returns their fault, or ""."""
        self._given[HAS_VELOCITY] = 0.0
        if velocity is None:
            return ""
        if not (
            type(velocity) is np.ndarray
            and velocity.dtype is FLOAT64
            and velocity.shape == self.shape
        ):
            velocity, fault = self._convert("velocity", velocity)
            if fault:
                return fault
        self._velocity[:] = velocity
        self._given[HAS_VELOCITY] = 1.0
        return ""

    def _convert(self, what: str, values: ArrayLike) -> tuple[Floats, str]:
        """Numbers as an array for the kernel, and their fault in words, or ""."""
        wanted = f"it must be {self.shape[0]} numbers in the order of guard.q_names"
        try:
            array = real_array(values)
        except Exception:  # an unknown object may raise any; the loop continues
            return NO_POSITIONS, f"{what} is a {kind_of(values)}; {wanted}"
        if array.shape != self.shape:
            return NO_POSITIONS, f"{what} has shape {array.shape}; {wanted}"
        return array, ""
