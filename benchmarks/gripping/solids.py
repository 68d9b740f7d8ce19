"""Upright boxes and cylinders, and how far apart two are: closed forms, many at once.

Nothing here is shared with the guard's own distances. Solids do not turn, so the
distance along z and the distance in the plane are told apart.
"""

from dataclasses import dataclass, replace

import numpy as np

from arrays import Floats


@dataclass(frozen=True, slots=True)
class Solid:
    """A box along the axes, or a cylinder that stands.

    Attributes:
        half: Half of its sizes along x, y, z; of a cylinder 0, 0 and half its height,
            shape (3,) [m].
        radius: Radius of a cylinder; 0 of a box [m].
        at: Its middle in the world, shape (3,), or in each of n cycles, (n, 3) [m].
    """

    half: Floats
    radius: float
    at: Floats

    def moved_to(self, at: Floats) -> "Solid":
        """The same elsewhere."""
        return replace(self, at=np.asarray(at, dtype=np.float64))

    @property
    def reach(self) -> float:
        """How far it reaches from its middle in the plane [m]."""
        return float(np.hypot(self.half[0], self.half[1])) + self.radius


def box(half, at) -> Solid:
    """A box by half of its sizes and its middle [m]."""
    return Solid(np.asarray(half, dtype=np.float64), 0.0, np.asarray(at, dtype=float))


def cylinder(radius: float, half_height: float, at) -> Solid:
    """A cylinder that stands, by its middle [m]."""
    half = np.array([0.0, 0.0, half_height])
    return Solid(half, radius, np.asarray(at, dtype=np.float64))


def gaps(a: Solid, b: Solid) -> Floats:
    """Signed distance of two solids in each cycle, shape () or (n,) [m].

    Exact while they are apart. Where they overlap it is the least depth along z or in
    the plane, negative; in the plane exact unless the axis of a cylinder is inside the
    other solid.
    """
    apart = np.abs(b.at - a.at) - (a.half + b.half)
    plane = _signed(apart[..., 0], apart[..., 1]) - (a.radius + b.radius)
    return np.asarray(_signed(plane, apart[..., 2]))


def _signed(u: Floats, v: Floats) -> Floats:
    """Signed distance from two that are at right angles."""
    outside = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
    return np.where(np.maximum(u, v) > 0.0, outside, np.maximum(u, v))
