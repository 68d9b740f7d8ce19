"""Sets of points on a surface: which are connected, and how far they extend."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Directions to all sides, by whose extremes the extent is found.
SIDES = 200


def voxels(points: Floats, edge: float) -> Ints:
    """Cubes that points are in, shape (n, 3)."""
    return np.floor(points / edge).astype(np.int64)


def key(cubes: Ints) -> Ints:
    """Numbers of cubes."""
    return np.asarray((cubes[:, 0] << 42) + (cubes[:, 1] << 21) + cubes[:, 2])


# A cube with those about it.
ABOUT = np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3), axis=-1).reshape(-1, 3)


def near(points: Floats, others: Floats, edge: float) -> Bools:
    """Which points are in a cube of this edge [m] that holds or adjoins other points.

    They include all that are nearer to another point than the edge.
    """
    cubes = np.unique(voxels(others, edge), axis=0)
    wide = (cubes[:, None] + ABOUT).reshape(-1, 3)
    return np.isin(key(voxels(points, edge)), key(wide))


def connected(points: Floats, edge: float) -> Ints:
    """Number of the part to which each of some points belongs, shape (n,).

    Points whose cubes of this edge [m] adjoin are of one part.
    """
    cubes, which = np.unique(voxels(points, edge), axis=0, return_inverse=True)
    keys = key(cubes)
    order = np.argsort(keys)
    labels, pairs = np.arange(len(cubes)), []
    for step in ABOUT:
        place = np.searchsorted(keys[order], key(cubes + step))
        place = order[np.minimum(place, len(cubes) - 1)]
        pairs.append(np.where(keys[place] == key(cubes + step), place, labels))
    while True:
        least = np.minimum.reduce([labels[pair] for pair in pairs])
        least = least[least]
        if (least == labels).all():
            break
        labels = least
    return np.unique(labels, return_inverse=True)[1][which.reshape(-1)]


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
