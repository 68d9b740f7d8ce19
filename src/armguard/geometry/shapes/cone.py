"""A solid cone, pointed or truncated."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, framed_row
from armguard.geometry.shapes.sizes import check_size


@dataclass(frozen=True, slots=True, kw_only=True)
class Cone:
    """A solid cone about the frame's z axis, centred at half height.

    Attributes:
        radius: Radius of the core at its lower end, z = -height/2 [m].
        height: Height of the core [m].
        top_radius: Radius at the upper end, z = height/2; 0 is a point [m].
        rounding: Growth outwards, which rounds rims and point [m].

    Raises:
        ShapeError: A size is negative, zero or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.CONE
    radius: float
    height: float
    top_radius: float = 0.0
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_size("Cone", "radius", self.radius)
        check_size("Cone", "height", self.height)
        check_size("Cone", "top_radius", self.top_radius, zero=True)
        check_size("Cone", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        return framed_row(
            self.rounding, T, (self.radius, self.height / 2.0, self.top_radius)
        )

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Cone":
        """A random one of about this size [m], every other one truncated."""
        radius, half, top = size * 10.0 ** rng.uniform(-1.0, 0.0, 3)
        return cls(
            radius=radius,
            height=2 * half,
            top_radius=top * rng.integers(2),
            rounding=0.1 * size * rng.integers(2),
        )
