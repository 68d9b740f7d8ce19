"""Into the frame of a box and out of it; a box row is radius, centre, half, R."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3
from armguard.kernel import kernel

Row = NDArray[np.float64]


@kernel
def to_box(box: Row, p: Vec3) -> Vec3:
    """Coordinates of a world point in the box's frame, Rᵀ·(p - centre)."""
    return turn_to_box(box, (p[0] - box[1], p[1] - box[2], p[2] - box[3]))


@kernel
def turn_to_box(box: Row, u: Vec3) -> Vec3:
    """A world direction in the box's frame, Rᵀ·u."""
    return (
        box[7] * u[0] + box[10] * u[1] + box[13] * u[2],
        box[8] * u[0] + box[11] * u[1] + box[14] * u[2],
        box[9] * u[0] + box[12] * u[1] + box[15] * u[2],
    )


@kernel
def turn_from_box(box: Row, u: Vec3) -> Vec3:
    """A direction of the box's frame in the world, R·u."""
    return (
        box[7] * u[0] + box[8] * u[1] + box[9] * u[2],
        box[10] * u[0] + box[11] * u[1] + box[12] * u[2],
        box[13] * u[0] + box[14] * u[1] + box[15] * u[2],
    )


@kernel
def clamp(x: float, h: float) -> float:
    """X, kept within [-h, h]; a NaN in either stays NaN."""
    if x < -h:
        return -h
    if x > h:
        return h
    return x + 0.0 * h


@kernel
def clamp_to_box(p: Vec3, h: Vec3) -> Vec3:
    """The point of the box with half extents h nearest to p, in the box's frame."""
    return (clamp(p[0], h[0]), clamp(p[1], h[1]), clamp(p[2], h[2]))


@kernel
def leave_by_face(p: Vec3, h: Vec3) -> tuple[float, Vec3]:
    """Shortest way out of a box from a point inside.

    Returns:
        The depth [m] and the outward unit normal of the nearest face; of several, the
        first in the order x, y, z.
    """
    depth = h[0] - abs(p[0])
    normal = (1.0 if p[0] >= 0.0 else -1.0, 0.0, 0.0)
    if h[1] - abs(p[1]) < depth:
        depth = h[1] - abs(p[1])
        normal = (0.0, 1.0 if p[1] >= 0.0 else -1.0, 0.0)
    if h[2] - abs(p[2]) < depth:
        depth = h[2] - abs(p[2])
        normal = (0.0, 0.0, 1.0 if p[2] >= 0.0 else -1.0)
    return depth, normal
