"""Meshes as convex parts: MuJoCo takes every mesh for its convex hull.

The hull of a mesh with large dents touches what the mesh does not. So its triangles are
divided until hulls of the parts are hardly smaller. Together they cover every triangle,
so nothing gets through the surface unseen.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from arrays import Floats

# Triangles are divided if that makes their hulls smaller than this share [-], and so
# often in turn at most.
SMALLER = 0.9
DEEPEST = 5

# What flat parts are made thick by, for a hull to have a volume, each way [m].
THICK = 1e-6


def convex_parts(triangles: Floats, depth: int = 0) -> Iterator[Floats]:
    """Vertices of convex parts that cover a mesh, each of shape (k, 3).

    Args:
        triangles: Corners of its triangles, shape (n, 3, 3) [m].
        depth: How often they were divided already.
    """
    halves = best_halves(triangles) if depth < DEEPEST else None
    if halves is None:
        yield solid_vertices(triangles)
        return
    for half in halves:
        yield from convex_parts(half, depth + 1)


def best_halves(triangles: Floats) -> tuple[Floats, Floats] | None:
    """The division across an axis with the smallest hulls; None if none is worth it."""
    whole = hull_volume(triangles)
    best, found = SMALLER * whole, None
    middles = triangles.mean(axis=1)
    for axis in range(3):
        for cut in np.quantile(middles[:, axis], (0.25, 0.5, 0.75)):
            low = middles[:, axis] < cut
            if not 0 < low.sum() < len(low):
                continue
            volume = hull_volume(triangles[low]) + hull_volume(triangles[~low])
            if volume < best:
                best, found = volume, (triangles[low], triangles[~low])
    return found


def hull_volume(triangles: Floats) -> float:
    """Volume of the convex hull of triangles, 0 if they are flat [m³]."""
    try:
        return float(ConvexHull(triangles.reshape(-1, 3)).volume)
    except QhullError:
        return 0.0


def solid_vertices(triangles: Floats) -> Floats:
    """Their vertices, each once; flat ones are made thick by next to nothing."""
    vertices = np.unique(triangles.reshape(-1, 3), axis=0)
    try:
        ConvexHull(vertices)
    except QhullError:
        sides = [-THICK, THICK]
        offsets = np.stack(np.meshgrid(sides, sides, sides), axis=-1).reshape(-1, 1, 3)
        vertices = (vertices + offsets).reshape(-1, 3)
    return vertices
