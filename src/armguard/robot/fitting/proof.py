"""Proof that primitives hold a surface; shares nothing with the fitting."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import Box, Capsule, Ellipsoid, PlacedShape, Sphere

Floats = NDArray[np.float64]

# Halvings after which a piece that lies in no primitive counts as uncovered [-]; a
# metre becomes a tenth of a millimetre.
DEPTH = 14

# Pieces after which the proof is given up: an uncovered face becomes four times as many
# each time, the seam between two primitives only twice.
PIECES = 400_000


def uncovered(triangles: Floats, shapes: Sequence[PlacedShape]) -> Floats:
    """Pieces of triangles that could not be shown to lie in one primitive.

    A triangle whose corners lie in one convex primitive lies in it. Others are cut in
    four, again and again.

    Args:
        triangles: Corners, shape (n, 3, 3) [m].
        shapes: Primitives.

    Returns:
        Corners of what is left, shape (k, 3, 3) [m]; nothing left is the proof.
    """
    left = np.asarray(triangles, dtype=np.float64)
    for _ in range(DEPTH):
        corners = left.reshape(-1, 3)
        done = np.zeros(len(left), dtype=np.bool_)
        for placed in shapes:
            done |= inside(placed, corners).reshape(-1, 3).all(axis=1)
        left = left[~done]
        if len(left) == 0 or len(left) > PIECES:
            return left
        left = quartered(left)
    return left


def quartered(triangles: Floats) -> Floats:
    """Each triangle as four of half its size, shape (4n, 3, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
    return np.concatenate(
        [
            np.stack(corner, axis=1)
            for corner in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ]
    )


def inside(placed: PlacedShape, points: Floats) -> NDArray[np.bool_]:
    """Which points lie in a primitive, shape (n,)."""
    T = placed.pose.matrix()
    local = (points - T[:3, 3]) @ T[:3, :3]
    shape = placed.shape
    if isinstance(shape, Box):
        excess = np.maximum(np.abs(local) - shape.half_extents, 0.0)
        radius = shape.rounding
    elif isinstance(shape, Capsule):
        start, axis = np.array(shape.start), np.subtract(shape.end, shape.start)
        length2 = float(axis @ axis)
        t = (local - start) @ axis / length2 if length2 > 0.0 else np.zeros(len(local))
        excess = local - start - np.multiply.outer(np.clip(t, 0.0, 1.0), axis)
        radius = shape.radius + shape.rounding
    elif isinstance(shape, Sphere):
        excess, radius = local, shape.core_radius
    elif isinstance(shape, Ellipsoid) and shape.rounding == 0.0:
        excess, radius = local / shape.semi_axes, 1.0
    else:
        raise TypeError(f"links are not fitted with a {type(shape).__name__}")
    return np.asarray((excess**2).sum(axis=1) <= radius**2)
