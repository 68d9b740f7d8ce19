"""Convex shapes: a core (point, segment, box) grown by a radius.

A *rounding* is more of that radius: it grows the shape outwards on every side.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from math import isfinite
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ShapeError
from armguard.geometry.pose import Pose


class ShapeKind(IntEnum):
    """Kinds in rank order; a pair kernel takes the lower rank first."""

    SPHERE = 0
    CAPSULE = 1
    BOX = 2


def _positive(shape: str, name: str, value: float, *, zero: bool = False) -> None:
    if not (isfinite(value) and (value > 0.0 or (zero and value == 0.0))):
        bound = ">= 0" if zero else "> 0"
        raise ShapeError(f"{shape} {name} is {value} m; it must be finite and {bound}")


def _point(
    shape: str, name: str, value: tuple[float, float, float]
) -> tuple[float, float, float]:
    numbers = tuple(float(v) for v in value)
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise ShapeError(f"{shape} {name} is {numbers}; it must be 3 finite numbers")
    return numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Sphere:
    """All points within `radius + rounding` of the frame's origin.

    Attributes:
        radius: Radius [m].
        rounding: Further growth outwards [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.SPHERE
    radius: float
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        _positive("Sphere", "radius", self.radius)
        _positive("Sphere", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.radius + self.rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Capsule:
    """All points within `radius + rounding` of a segment; the paper's *cylsphere*.

    Attributes:
        start: One end of the segment [m].
        end: The other end [m]; it may equal `start`, which makes a sphere.
        radius: Radius [m].
        rounding: Further growth outwards [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.CAPSULE
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        object.__setattr__(self, "start", _point("Capsule", "start", self.start))
        object.__setattr__(self, "end", _point("Capsule", "end", self.end))
        _positive("Capsule", "radius", self.radius)
        _positive("Capsule", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.radius + self.rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A rectangular solid about the frame's origin, grown by `rounding`.

    Attributes:
        half_extents: Half of the core's size along x, y, z [m]. A rounded box
            reaches `half_extents + rounding` on every axis.
        rounding: Growth outwards, which rounds edges and corners [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.BOX
    half_extents: tuple[float, float, float]
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        half = _point("Box", "half_extents", self.half_extents)
        object.__setattr__(self, "half_extents", half)
        for axis, value in zip("xyz", half, strict=True):
            _positive("Box", f"half extent {axis}", value)
        _positive("Box", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding


Shape = Sphere | Capsule | Box


@dataclass(frozen=True, slots=True)
class PlacedShape:
    """A shape and where its frame stands in a link, an object or the world.

    Attributes:
        shape: The shape.
        pose: Its frame in the parent's.
        model_error: Largest distance from the shape's surface to the surface it
            stands for; 0 where it *is* that surface [m].
    """

    shape: Shape
    pose: Pose = field(default_factory=Pose)
    model_error: float = 0.0


# A primitive in a flat table is one row of this many float64, whatever its kind:
#   sphere   radius, centre(3)
#   capsule  radius, end point(3), end point(3)
#   box      radius, centre(3), half extents of the core(3), R(9) row by row; the
#            columns of R are the box's axes
# Lengths in metres, in the frame the table is for. Unused places are 0.
ROW_WIDTH = 16


def shape_row(
    shape: Shape, T: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Table row of a shape whose frame stands at `T`, shape (ROW_WIDTH,).

    Args:
        shape: The shape.
        T: Its frame in the table's frame, shape (4, 4); identity if left out.
    """
    T = np.eye(4) if T is None else T
    R, p = T[:3, :3], T[:3, 3]
    row = np.zeros(ROW_WIDTH)
    row[0] = shape.core_radius
    if isinstance(shape, Sphere):
        row[1:4] = p
    elif isinstance(shape, Capsule):
        row[1:4] = R @ shape.start + p
        row[4:7] = R @ shape.end + p
    else:
        row[1:4] = p
        row[4:7] = shape.half_extents
        row[7:16] = R.reshape(9)
    return row
