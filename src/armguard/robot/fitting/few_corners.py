"""Hulls of dense meshes with fewer corners: a cycle reads all corners of a hull."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.pose import Pose
from armguard.geometry.proximity import distances
from armguard.geometry.shapes import Hull, PlacedShape, Sphere

Floats = NDArray[np.float64]

# Corners up to which a hull stays as it is.
FEW = 256

# By how much the hull of the kept corners is grown at most, to hold the others [m].
GROWTH = 2.5e-4

# Directions whose farthest corners are kept first.
DIRECTIONS = 64

# One corner more at a time for so many that are kept.
STEP = 8

# Radius of the sphere that measures the distance of a corner [m].
POINT = 1e-9


def with_few_corners(placed: PlacedShape) -> PlacedShape:
    """A placed hull that holds the given one and has fewer corners.

    Some corners are kept. Their hull is grown by the greatest distance of the others,
    at most `GROWTH`, so it holds them and all that lies between them. That much is
    added to its model error.

    Args:
        placed: The shape; one that is no hull of many corners is returned as it is.
    """
    hull = placed.shape
    if not isinstance(hull, Hull) or len(hull.vertices) <= FEW:
        return placed
    found = fewer(hull.vertices)
    if found is None:
        return placed
    kept, growth = found
    held = Hull(points=kept, rounding=hull.rounding + growth)
    return replace(placed, shape=held, model_error=placed.model_error + growth)


def fewer(corners: Floats) -> tuple[Floats, float] | None:
    """Some of the corners, and the growth of their hull that holds all of them [m].

    None if their hull is flat.

    Args:
        corners: Corners of a hull, shape (n, 3) [m].
    """
    kept = np.unique((corners @ sphere(DIRECTIONS).T).argmax(axis=0))
    while True:
        hull = convex_hull(corners[kept])
        if hull is None:
            return None
        planes = hull.equations
        beyond = corners @ planes[:, :3].T + planes[:, 3]
        # A corner is at least so far from the hull as it lies beyond one of its planes.
        far = beyond.max(axis=1)
        if far.max() > 0.8 * GROWTH:
            # Of each face the farthest; the farthest of these.
            ends = np.unique(beyond.argmax(axis=0))
        else:
            far = gaps(corners, corners[kept])
            if far.max() <= GROWTH - 2.0 * POINT:
                return corners[kept], float(max(far.max(), 0.0) + 2.0 * POINT)
            ends = np.flatnonzero(far > 0.8 * GROWTH)
        most = ends[np.argsort(-far[ends], kind="stable")]
        kept = np.union1d(kept, most[: 1 + len(kept) // STEP])


def gaps(points: Floats, corners: Floats) -> Floats:
    """Distances of points from the hull of corners, shape (n,) [m]."""
    places = np.tile(np.eye(4), (len(points), 1, 1))
    places[:, :3, 3] = points
    point = Sphere(radius=POINT)
    return distances(point, places, Hull(points=corners), Pose()).distance + POINT


def sphere(count: int) -> Floats:
    """Directions that are spread evenly, shape (count, 3)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * k
    wide = np.sqrt(1.0 - z * z)
    return np.column_stack([wide * np.cos(angle), wide * np.sin(angle), z])
