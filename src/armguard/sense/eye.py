"""The view of a sensor in the world, and bodies that are in no view."""

from math import inf, tan

import numpy as np
from numpy.typing import NDArray

from armguard.scene.sensors import SceneSensor

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Rays along each edge of a view.
RAYS = 33


class Eye:
    """A sensor in the world.

    Args:
        sensor: The sensor.
        T: Its frame in the world, shape (4, 4).
        reach: Distance up to which it sees [m].
    """

    def __init__(self, sensor: SceneSensor, T: Floats, reach: float) -> None:
        self.sensor, self.reach = sensor, reach
        self.R, self.origin = T[:3, :3], T[:3, 3].copy()

    def in_view(self, points: Floats) -> Bools:
        """Which points are in its view, whatever is before them."""
        sensor, local = self.sensor, (points - self.origin) @ self.R
        depth = np.maximum(local[:, 2], 1e-9)
        far = depth if sensor.along == "axis" else np.linalg.norm(local, axis=1)
        inside = (local[:, 2] > 0.0) & (far <= self.reach)
        if sensor.narrow:
            slope = np.hypot(local[:, 0], local[:, 1]) / depth
            return np.asarray(inside & (slope <= tan(0.5 * sensor.view[0])))
        for k in range(2):
            place = local[:, k] / depth * sensor.focal[k] + sensor.middle[k]
            inside &= (place >= -0.5) & (place <= sensor.zones[k] - 0.5)
        return np.asarray(inside)

    def rays(self) -> Floats:
        """Rays all over its view, to the end of its reach, shape (n, 3) [m]."""
        sensor = self.sensor
        x, y = (
            (np.linspace(-0.5, sensor.zones[k] - 0.5, RAYS) - sensor.middle[k])
            / sensor.focal[k]
            for k in range(2)
        )
        u, v = (part.ravel() for part in np.meshgrid(x, y))
        rays = np.stack([u, v, np.ones(len(u))], axis=1)
        if sensor.narrow:
            rays = rays[np.hypot(u, v) <= tan(0.5 * sensor.view[0])]
        if sensor.along == "ray":
            rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return np.asarray(self.reach * rays @ self.R.T)


def unseen(origins: Floats, ways: Floats, lengths: Floats, normal: Floats) -> float:
    """Diameter of the largest ball that touches a plane and meets none of some rays.

    It touches the plane at the origin. A point y is in a ball of diameter d if
    |y|² < d n·y.

    Args:
        origins: Where the rays begin, shape (n, 3) [m].
        ways: Their directions, unit vectors, shape (n, 3).
        lengths: Their lengths, shape (n,) [m].
        normal: The normal of the plane, a unit vector, shape (3,).
    """
    square = np.einsum("ij,ij->i", origins, origins)
    along = np.einsum("ij,ij->i", origins, ways)
    height, slope = origins @ normal, ways @ normal
    # |o + t w|² / n·(o + t w) is least before the plane where its derivative is zero.
    root = np.sqrt(np.maximum(
        height * height - 2.0 * along * height * slope + slope * slope * square, 0.0
    ))  # fmt: skip
    flat = np.abs(slope) < 1e-9
    t = np.where(flat, -along, (root - height) / np.where(flat, 1.0, slope))
    t = np.clip(t, 0.0, lengths)
    above = height + t * slope
    with np.errstate(divide="ignore"):
        size = (square + t * (2.0 * along + t)) / np.where(above > 0.0, above, 0.0)
    return float(size.min(initial=inf))
