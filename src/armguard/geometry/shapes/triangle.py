"""A triangle: what surfaces are made of."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, empty_row
from armguard.geometry.shapes.sizes import Point, check_size, checked_point


@dataclass(frozen=True, slots=True, kw_only=True)
class Triangle:
    """All points within `rounding` of a flat triangle.

    Attributes:
        a: First corner [m].
        b: Second corner [m].
        c: Third corner [m]; corners may coincide or lie in a line.
        rounding: Growth outwards on all sides [m].

    Raises:
        ShapeError: A number is not finite, or the rounding is negative.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.TRIANGLE
    a: Point
    b: Point
    c: Point
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in "abc":
            corner = checked_point("Triangle", name, getattr(self, name))
            object.__setattr__(self, name, corner)
        check_size("Triangle", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        R, p = T[:3, :3], T[:3, 3]
        row = empty_row(self.rounding, R @ self.a + p)
        row[4:7] = R @ self.b + p
        row[7:10] = R @ self.c + p
        return row

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Triangle":
        """A random one of about this size [m]."""
        a, b, c = rng.uniform(-size, size, (3, 3))
        return cls(
            a=tuple(a),
            b=tuple(b),
            c=tuple(c),
            rounding=0.1 * size * rng.integers(2),
        )
