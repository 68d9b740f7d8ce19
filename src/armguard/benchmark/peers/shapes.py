"""Our shapes as those of Coal and of FCL, whose classes have the same names."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.benchmark.peers.frames import along_z, outward_faces
from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Shape,
    Sphere,
    Triangle,
)

Floats = NDArray[np.float64]
Convex = Callable[[Floats, NDArray[np.intp]], Any]


def peer_geometry(
    library: Any, convex: Convex, shape: Shape, T: Floats
) -> tuple[Any, Floats] | None:
    """A library's shape without rounding, and the frame it stands at.

    Args:
        library: The module.
        convex: Makes its polytope of vertices and triangles.
        shape: The shape.
        T: Its frame, shape (4, 4).

    Returns:
        None if the library has nothing for it.
    """
    if isinstance(shape, Sphere):
        return library.Sphere(shape.radius), T
    if isinstance(shape, Capsule):
        length, T = along_z(shape, T)
        return library.Capsule(shape.radius, length), T
    if isinstance(shape, Box):
        return library.Box(*(2.0 * np.array(shape.half_extents))), T
    if isinstance(shape, Triangle):
        # Their own TriangleP is measured against nothing, or against another one.
        corners = np.array([shape.a, shape.b, shape.c])
        return convex(corners, np.array([[0, 1, 2], [0, 2, 1]])), T
    if isinstance(shape, Cylinder):
        return library.Cylinder(shape.radius, shape.height), T
    if isinstance(shape, Cone) and shape.top_radius == 0.0:
        return library.Cone(shape.radius, shape.height), T
    if isinstance(shape, Ellipsoid):
        return library.Ellipsoid(*shape.semi_axes), T
    if isinstance(shape, HalfSpace):
        return library.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), T
    if isinstance(shape, Hull):
        faces = outward_faces(shape)
        return None if faces is None else (convex(shape.vertices, faces), T)
    return None
