"""How far a primitive reaches beyond the points it encloses.

For two convex bodies, one inside the other, the largest distance from the outer to the
inner is the largest difference of their support functions. So a fit is judged without
touching a surface: along a set of directions.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel

Floats = NDArray[np.float64]


def directions(count: int = 400) -> Floats:
    """Unit vectors spread evenly over the sphere, shape (count, 3)."""
    k = np.arange(count) + 0.5
    polar = np.arccos(1.0 - 2.0 * k / count)
    azimuth = np.pi * (1.0 + 5.0**0.5) * k
    return np.column_stack(
        [
            np.cos(azimuth) * np.sin(polar),
            np.sin(azimuth) * np.sin(polar),
            np.cos(polar),
        ]
    )


def support(points: Floats, normals: Floats) -> Floats:
    """Support function of points along normals, shape (k,) [m]."""
    return np.asarray((points @ normals.T).max(axis=0))


@kernel(inline=False, entry=True)
def judge_capsule(
    ends: Floats, points: Floats, normals: Floats, inner: Floats
) -> tuple[float, float]:
    """Smallest capsule on a given axis around points, and how far it overreaches.

    Args:
        ends: Both ends of the axis, shape (6,) [m].
        points: Points to enclose, shape (n, 3) [m].
        normals: Directions, shape (k, 3).
        inner: Support function of the points along them, shape (k,) [m].

    Returns:
        Overreach [m] and radius [m].
    """
    ux, uy, uz = ends[3] - ends[0], ends[4] - ends[1], ends[5] - ends[2]
    uu = ux * ux + uy * uy + uz * uz
    radius2 = 0.0
    for i in range(points.shape[0]):
        x, y, z = (
            points[i, 0] - ends[0],
            points[i, 1] - ends[1],
            points[i, 2] - ends[2],
        )
        t = (x * ux + y * uy + z * uz) / uu if uu > 0.0 else 0.0
        t = min(max(t, 0.0), 1.0)
        x, y, z = x - t * ux, y - t * uy, z - t * uz
        radius2 = max(radius2, x * x + y * y + z * z)
    radius = sqrt(radius2)
    worst = 0.0
    for k in range(normals.shape[0]):
        a, b, c = normals[k, 0], normals[k, 1], normals[k, 2]
        first = a * ends[0] + b * ends[1] + c * ends[2]
        second = a * ends[3] + b * ends[4] + c * ends[5]
        worst = max(worst, max(first, second) + radius - inner[k])
    return worst, radius


@kernel(inline=False, entry=True)
def judge_box(
    centre: Floats,
    half: Floats,
    R: Floats,
    points: Floats,
    normals: Floats,
    inner: Floats,
) -> tuple[float, float]:
    """Smallest rounding of a given core box around points, and how far it overreaches.

    Args:
        centre: Centre of the core, shape (3,) [m].
        half: Half extents of the core, shape (3,) [m].
        R: Its axes as columns, shape (3, 3).
        points: Points to enclose, shape (n, 3) [m].
        normals: Directions, shape (k, 3).
        inner: Support function of the points along them, shape (k,) [m].

    Returns:
        Overreach [m] and rounding [m].
    """
    rounding2 = 0.0
    for i in range(points.shape[0]):
        excess2 = 0.0
        for axis in range(3):
            along = 0.0
            for r in range(3):
                along += R[r, axis] * (points[i, r] - centre[r])
            out = abs(along) - half[axis]
            if out > 0.0:
                excess2 += out * out
        rounding2 = max(rounding2, excess2)
    rounding = sqrt(rounding2)
    worst = 0.0
    for k in range(normals.shape[0]):
        reach = rounding - inner[k]
        for axis in range(3):
            along = 0.0
            for r in range(3):
                along += R[r, axis] * normals[k, r]
            reach += abs(along) * half[axis]
        for r in range(3):
            reach += centre[r] * normals[k, r]
        worst = max(worst, reach)
    return worst, rounding
