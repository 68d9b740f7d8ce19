"""All of space on one side of a plane: a floor, a wall."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, empty_row
from armguard.geometry.shapes.sizes import check_size


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfSpace:
    """All points of the frame with z <= rounding.

    The frame's z axis points out of the solid, so a floor is a `HalfSpace()` at the
    height of its surface.

    Attributes:
        rounding: How far the solid reaches beyond the plane z = 0 [m].

    Raises:
        ShapeError: The rounding is negative or not finite.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.HALF_SPACE
    rounding: float = 0.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_size("HalfSpace", "rounding", self.rounding, zero=True)

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T."""
        row = empty_row(self.rounding, T[:3, 3])
        row[4:7] = T[:3, 2]
        return row

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "HalfSpace":
        """A random one; it has no size but its rounding [m]."""
        return cls(rounding=0.1 * size * rng.integers(2))
