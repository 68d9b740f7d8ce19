"""A box, sharp or rounded."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, framed_row
from armguard.geometry.shapes.sizes import Point, check_size, checked_point


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A rectangular solid about the frame's origin, grown by `rounding`.

    Attributes:
        size: The core's full size along x, y, z [m]. A rounded box is
            `size + 2 * rounding` long on every axis.
        rounding: Growth outwards, which rounds edges and corners [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.BOX
    size: Point
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        size = checked_point("Box", "size", self.size)
        object.__setattr__(self, "size", size)
        for axis, value in zip("xyz", size, strict=True):
            check_size("Box", f"size {axis}", value)
        check_size("Box", "rounding", self.rounding, zero=True)

    @property
    def half_extents(self) -> Point:
        """Half of the core's size along x, y, z [m]."""
        x, y, z = self.size
        return x / 2.0, y / 2.0, z / 2.0

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        return framed_row(self.rounding, T, self.half_extents)

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Box":
        """A random one of about this size [m], every other one rounded."""
        sizes = tuple(2.0 * size * 10.0 ** rng.uniform(-1.5, 0.0, 3))
        return cls(size=sizes, rounding=0.1 * size * rng.integers(2))
