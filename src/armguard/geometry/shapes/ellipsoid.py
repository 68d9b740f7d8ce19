"""An ellipsoid."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, framed_row
from armguard.geometry.shapes.sizes import Point, check_size, checked_point


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipsoid:
    """An ellipsoid about the frame's origin, its axes along the frame's.

    Attributes:
        semi_axes: Half of the core's size along x, y, z [m].
        rounding: Growth outwards; what comes of it is no ellipsoid any more [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.ELLIPSOID
    semi_axes: Point
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        axes = checked_point("Ellipsoid", "semi_axes", self.semi_axes)
        object.__setattr__(self, "semi_axes", axes)
        for axis, value in zip("xyz", axes, strict=True):
            check_size("Ellipsoid", f"semi-axis {axis}", value)
        check_size("Ellipsoid", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        return framed_row(self.rounding, T, self.semi_axes)

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Ellipsoid":
        """A random one of about this size [m]."""
        axes = tuple(size * 10.0 ** rng.uniform(-1.0, 0.0, 3))
        return cls(semi_axes=axes, rounding=0.1 * size * rng.integers(2))
