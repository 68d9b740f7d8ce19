"""A segment grown by a radius."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, empty_row
from armguard.geometry.shapes.sizes import Point, check_size, checked_point


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
    start: Point
    end: Point
    radius: float
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        object.__setattr__(self, "start", checked_point("Capsule", "start", self.start))
        object.__setattr__(self, "end", checked_point("Capsule", "end", self.end))
        check_size("Capsule", "radius", self.radius)
        check_size("Capsule", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.radius + self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        R, p = T[:3, :3], T[:3, 3]
        row = empty_row(self.core_radius, R @ self.start + p)
        row[4:7] = R @ self.end + p
        return row

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Capsule":
        """A random one of about this size [m]."""
        ends = rng.uniform(-size, size, (2, 3))
        return cls(
            start=tuple(ends[0]), end=tuple(ends[1]), radius=size * rng.uniform(0, 0.5)
        )
