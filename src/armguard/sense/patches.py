"""Sets of points on a surface: which are connected, and how far they extend."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Directions to all sides, by whose extremes the extent is found.
SIDES = 200


def near(points: Floats, others: Floats, within: float) -> Bools:
    """Which points are nearer to another point than a distance [m], shape (n,)."""
    from scipy.spatial import cKDTree

    far = cKDTree(others).query(points, distance_upper_bound=within)[0]
    return np.asarray(np.isfinite(far))


def connected(points: Floats, edge: float) -> Ints:
    """Number of the part to which each of some points belongs, shape (n,).

    Points whose cubes of this edge [m] adjoin are of one part.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    places = np.floor(points / edge)
    cubes, which = np.unique(places, axis=0, return_inverse=True)
    pairs = cKDTree(cubes).query_pairs(1.0, p=np.inf, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(cubes),) * 2)
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels[which.reshape(-1)])


def extent(points: Floats) -> float:
    """Largest distance of two of some points, by their extremes to all sides [m]."""
    k = np.arange(SIDES) + 0.5
    turn, z = np.pi * (1.0 + sqrt(5.0)) * k, 1.0 - k / SIDES
    ring = np.sqrt(1.0 - z * z)
    sides = np.stack([ring * np.cos(turn), ring * np.sin(turn), z])
    along = points @ sides
    ends = points[np.unique([along.argmin(axis=0), along.argmax(axis=0)])]
    apart = ends[:, None] - ends
    return float(np.sqrt((apart * apart).sum(axis=2).max()))
