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
        half_extents: Half of the core's size along x, y, z [m]. A rounded box
            reaches `half_extents + rounding` on every axis.
        rounding: Growth outwards, which rounds edges and corners [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.BOX
    half_extents: Point
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        half = checked_point("Box", "half_extents", self.half_extents)
        object.__setattr__(self, "half_extents", half)
        for axis, value in zip("xyz", half, strict=True):
            check_size("Box", f"half extent {axis}", value)
        check_size("Box", "rounding", self.rounding, zero=True)

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
        half = tuple(size * 10.0 ** rng.uniform(-1.5, 0.0, 3))
        return cls(half_extents=half, rounding=0.1 * size * rng.integers(2))
