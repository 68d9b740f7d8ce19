"""Input of a cycle: conversion to arrays of real numbers; never raises in the loop."""

from collections.abc import Mapping, Sequence
from numbers import Real
from reprlib import Repr
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import known_names
from armguard.geometry.pose import LOOKS_LIKE_DEGREES
from armguard.guard.watch import Watch
from armguard.record import attributes
from armguard.robot.kinematics import REVOLUTE
from armguard.robot.limits import FAR_BEYOND_LIMITS
from armguard.scene.tables import RobotPart, SceneTables

Floats = NDArray[np.float64]

# A vector of all joints in the order of `q_names`, or vectors by robot name.
JointVector = ArrayLike | Mapping[str, ArrayLike]

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


def joined(
    what: str,
    value: Mapping[str, ArrayLike],
    robots: Sequence[RobotPart],
    *,
    partial: bool = False,
) -> tuple[Floats, str]:
    """Vector of all joints from vectors by robot name, and its fault, or "".

    Args:
        what: Name of the input.
        value: The vectors.
        robots: Robots in the order of the joints.
        partial: Whether robots may be left out, whose joints then get zero.
    """
    names = [part.name for part in robots]
    found: list[Floats] = []
    try:
        for name in value:
            if name not in names:
                wrong = f"{what} names {described(name)}, no robot"
                return NO_POSITIONS, f"{wrong}; {known_names(names)}"
        for part in robots:
            if part.name not in value and not partial:
                return NO_POSITIONS, f"{what} has no vector of robot '{part.name}'"
            own = real_array(value.get(part.name, np.zeros(part.joint_count)))
            if own.shape != (part.joint_count,):
                return NO_POSITIONS, (
                    f"{what} of robot '{part.name}' has shape {own.shape}; it must be "
                    f"{part.joint_count} numbers in the order of guard.q_names"
                )
            found.append(own)
    except Exception:  # an unknown object may raise any; the loop continues
        return NO_POSITIONS, f"{what} is no mapping of vectors by robot name"
    return np.concatenate(found), ""


def likely_mistake(q: Floats, tables: SceneTables) -> str:
    """Likely mistake behind positions outside their limits, in words; "" if unknown.

    Another unit, see `other_unit`. Another order, if all joints would be within their
    limits in it.

    Args:
        q: Positions, shape (n,) [rad or m].
        tables: The scene.
    """
    unit, known = other_unit(q, tables)
    if known:
        return unit
    slices = [
        slice(part.first_joint, part.first_joint + part.joint_count)
        for part in tables.robots
    ]
    cuts = np.cumsum([part.joint_count for part in tables.robots[::-1]])[:-1]
    backwards, swapped = q.copy(), np.concatenate(np.split(q, cuts)[::-1])
    for own in slices:
        if not within(q, tables, own):
            backwards[own] = q[own][::-1]
    orders = {"the joints": backwards, "the robots": swapped, "all joints": q[::-1]}
    for which, positions in orders.items():
        if within(positions, tables):
            return f"{which} seem to be in reverse order; see guard.q_names"
    return ""


def within(q: Floats, tables: SceneTables, of: Any = slice(None)) -> bool:
    """Whether positions are within the limits of their joints; NaN counts as within."""
    outside = (q < tables.lower) | (q > tables.upper)
    return not outside[of].any()


def other_unit(q: Floats, tables: SceneTables) -> tuple[str, bool]:
    """In words, that positions outside their limits are in another unit.

    Degrees, if a turning joint is beyond two turns and all would be within their limits
    in degrees. Millimetres, if a sliding joint is ten times beyond its limits and all
    would be within them in millimetres.

    Args:
        q: Positions, shape (n,), NaN for joints without one [rad or m].
        tables: The scene.

    Returns:
        The words, "" if there is no such evidence; and whether positions are so far
        off that no other order of the joints explains them.
    """
    turning = turning_joints(tables)
    if (np.abs(q[turning]) > LOOKS_LIKE_DEGREES).any():
        in_degrees = within(np.radians(q), tables, turning)
        return "the positions look like degrees; give radians" * in_degrees, True
    most = FAR_BEYOND_LIMITS * np.maximum(tables.upper, -tables.lower)
    if (np.abs(q) > most)[~turning].any():
        in_millimetres = within(q * 1e-3, tables, ~turning)
        words = "the sliding joints look like millimetres; give metres"
        return words * in_millimetres, True
    return "", False


def turning_joints(tables: SceneTables) -> NDArray[np.bool_]:
    """Whether each joint turns rather than slides, shape (n,)."""
    turning = np.zeros(len(tables.q_names), dtype=bool)
    turning[tables.q_index[tables.joint_kind == REVOLUTE]] = True
    return turning


def top_speeds(tables: SceneTables) -> Floats:
    """Declared top speed of each joint, infinite if none is, (n,) [rad/s or m/s]."""
    tops = np.full(len(tables.q_names), np.inf)
    for part in tables.robots:
        if part.stopping is not None:
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            tops[own] = part.stopping.velocity
    return tops


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
        robots: Robots in the order of the joints.
    """

    def __init__(self, watch: Watch, robots: Sequence[RobotPart]) -> None:
        self.shape = watch.velocity.shape
        self.robots = {part.name: r for r, part in enumerate(robots)}
        self._parts = robots
        self.last_stamp = -np.inf
        self._given, self._stamps = attributes(watch.given), watch.stamps
        self._velocity = watch.velocity

    def take(
        self,
        q: JointVector,
        stamp: float | Mapping[str, float] | None,
        velocity: JointVector | None,
        now: float | None,
    ) -> tuple[Floats, str]:
        """Positions for the kernel, and the fault of the input in words, or "".

        With a fault the positions are empty: the cycle refuses them, and orders its
        stops.
        """
        if type(stamp) is float and type(now) is float and now == now:
            self._given.now = now
            self._stamps.fill(stamp)
        elif fault := self._take_times(stamp, now):
            return NO_POSITIONS, fault
        if fault := self._take_velocity(velocity):
            return NO_POSITIONS, fault
        return self.positions(q)

    def positions(self, q: JointVector) -> tuple[Floats, str]:
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
                given.now = np.nan
            else:
                time = now if type(now) is float else real_number(now)
                # NaN would read as no time given; infinity is refused.
                given.now = time if time == time else np.inf
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
                    return (
                        f"there is a stamp for {described(unknown[0])}, no robot; "
                        f"{known_names(self.robots)}"
                    )
            else:
                stamps.fill(real_number(stamp))
        except Exception:  # an unknown object may raise any; the loop continues
            # No time of the last cycle may count as a time of this one.
            stamps.fill(np.nan)
            given.now = np.nan
            return (
                f"stamp is {described(stamp)} and now is {described(now)}; they must "
                "be numbers [s]"
            )
        return ""

    def _take_velocity(self, velocity: JointVector | None) -> str:
        """Write velocities for the kernel; returns their fault, or ""."""
        self._given.has_velocity = 0
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
        self._given.has_velocity = 1
        return ""

    def _convert(self, what: str, values: JointVector) -> tuple[Floats, str]:
        """Numbers as an array for the kernel, and their fault in words, or ""."""
        if is_mapping(values):
            return joined(what, values, self._parts)
        wanted = f"it must be {self.shape[0]} numbers in the order of guard.q_names"
        try:
            array = real_array(values)
        except Exception:  # an unknown object may raise any; the loop continues
            return NO_POSITIONS, f"{what} is a {kind_of(values)}; {wanted}"
        if array.shape != self.shape:
            return NO_POSITIONS, f"{what} has shape {array.shape}; {wanted}"
        return array, ""
