"""A point grown by a radius."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, empty_row
from armguard.geometry.shapes.sizes import check_size


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
        check_size("Sphere", "radius", self.radius)
        check_size("Sphere", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.radius + self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        return empty_row(self.core_radius, T[:3, 3])

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Sphere":
        """A random one of about this size [m]."""
        return cls(radius=size * rng.uniform(0.1, 1.0))
