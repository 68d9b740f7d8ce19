"""A solid cylinder."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, framed_row
from armguard.geometry.shapes.sizes import check_size


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinder:
    """A solid cylinder about the frame's z axis, centred, grown by `rounding`.

    Attributes:
        radius: Radius of the core [m].
        height: Height of the core, from -height/2 to height/2 [m].
        rounding: Growth outwards, which rounds the rims [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.CYLINDER
    radius: float
    height: float
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_size("Cylinder", "radius", self.radius)
        check_size("Cylinder", "height", self.height)
        check_size("Cylinder", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        return framed_row(
            self.rounding, T, (self.radius, self.height / 2.0, self.radius)
        )

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Cylinder":
        """A random one of about this size [m]."""
        radius, half = size * 10.0 ** rng.uniform(-1.0, 0.0, 2)
        return cls(
            radius=radius, height=2 * half, rounding=0.1 * size * rng.integers(2)
        )
