"""Arms in a plane, and their distances to points."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class PlanarArm(NamedTuple):
    """Two links in a plane, with the first joint at the origin.

    Attributes:
        lengths: Lengths of the links [m].
        radius: Radius of the capsules about them [m].
        travel: Greatest extension of a prismatic third joint along the second link; 0
            for an arm of two joints [m].
    """

    lengths: tuple[float, float]
    radius: float
    travel: float = 0.0

    @property
    def reach(self) -> float:
        """Greatest distance of the tip from the first joint [m]."""
        return sum(self.lengths) + self.travel

    def ends(self, q: Floats) -> tuple[Floats, Floats]:
        """Elbows and tips at joint positions (k, 2 or 3), shape (k, 2) [m]."""
        along = unit_vectors(q[:, 0] + q[:, 1])
        elbow = self.lengths[0] * unit_vectors(q[:, 0])
        reach = np.full(len(q), self.lengths[1])
        if self.travel > 0.0:
            reach += q[:, 2]
        return elbow, elbow + reach[:, None] * along

    def distance(self, q: Floats, points: Floats) -> Floats:
        """Distances to points (m, 2) at joint positions (k, n), shape (k, m) [m]."""
        elbow, tip = self.ends(q)
        first = to_segments(points, np.zeros_like(elbow), elbow)
        return np.minimum(first, to_segments(points, elbow, tip)) - self.radius


def to_segments(points: Floats, start: Floats, end: Floats) -> Floats:
    """Distances of points (m, 2) to segments (k, 2), shape (k, m) [m]."""
    way = end - start
    square = np.maximum((way * way).sum(axis=-1), 1e-12)[:, None]
    gap = points - start[:, None]
    share = np.clip((gap @ way[:, :, None])[..., 0] / square, 0.0, 1.0)
    gap -= share[..., None] * way[:, None]
    return np.hypot(gap[..., 0], gap[..., 1])


def unit_vectors(angles: Floats) -> Floats:
    """Unit vectors of angles (n,), shape (n, 2)."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)
