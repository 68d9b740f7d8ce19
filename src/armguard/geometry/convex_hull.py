"""Convex hulls of points, and the libraries that only meshes and hulls need."""

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ModelError

Floats = NDArray[np.float64]


def mesh_library(name: str) -> Any:
    """A module of a library of the extra `meshes`.

    Raises:
        ModelError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        library = name.partition(".")[0]
        raise ModelError(
            f"meshes and hulls need {library}: pip install 'armguard[meshes]'"
        ) from None


def convex_hull(points: Floats) -> Any:
    """Hull of points, a `scipy.spatial.ConvexHull`; None if they span no volume.

    Args:
        points: Shape (n, 3), or (n, 2) in a plane.

    Raises:
        ModelError: SciPy is not installed.
    """
    spatial = mesh_library("scipy.spatial")
    try:
        return spatial.ConvexHull(points)
    except (spatial.QhullError, ValueError):
        return None
