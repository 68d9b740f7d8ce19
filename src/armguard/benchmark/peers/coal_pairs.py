"""A pair of shapes as Coal measures it, with all that can be made before made."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


class CoalPair(NamedTuple):
    """What a call of Coal needs.

    Attributes:
        functor: Distance of the two geometries.
        T_a: Frame of A.
        T_b: Frame of B.
        request: Coal's own settings.
        result: Where it answers.
        geometries: The two; the functor only points to them.
    """

    functor: Any
    T_a: Any
    T_b: Any
    request: Any
    result: Any
    geometries: tuple[Any, Any]


def coal_pair(a: Shape, T_a: Floats, b: Shape, T_b: Floats) -> CoalPair:
    """Two shapes ready to be measured.

    Raises:
        ImportError: Coal is not installed.
    """
    import coal

    geometries, frames = [], []
    for shape, T in ((a, T_a), (b, T_b)):
        geometry, own = coal_geometry(shape)
        geometry.setSweptSphereRadius(shape.rounding)
        geometries.append(geometry)
        world = T @ own
        frames.append(coal.Transform3s(world[:3, :3], world[:3, 3]))
    return CoalPair(
        coal.ComputeDistance(*geometries),
        frames[0],
        frames[1],
        coal.DistanceRequest(),
        coal.DistanceResult(),
        (geometries[0], geometries[1]),
    )


def coal_geometry(shape: Shape) -> tuple[Any, Floats]:
    """Coal's geometry, and its frame in the shape's.

    Raises:
        TypeError: Coal has nothing for this shape.
    """
    import coal

    own = np.eye(4)
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius), own
    if isinstance(shape, Capsule):
        start, end = np.array(shape.start), np.array(shape.end)
        length = float(np.linalg.norm(end - start))
        own[:3, 2] = (end - start) / length
        side = np.eye(3)[int(np.argmin(np.abs(own[:3, 2])))]
        own[:3, 0] = np.cross(side, own[:3, 2])
        own[:3, 0] /= np.linalg.norm(own[:3, 0])
        own[:3, 1] = np.cross(own[:3, 2], own[:3, 0])
        own[:3, 3] = (start + end) / 2.0
        return coal.Capsule(shape.radius, length), own
    if isinstance(shape, Box):
        return coal.Box(*(2.0 * np.array(shape.half_extents))), own
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.height), own
    if isinstance(shape, Cone):
        return coal.Cone(shape.radius, shape.height), own
    if isinstance(shape, HalfSpace):
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), own
    if isinstance(shape, Ellipsoid):
        return coal.Ellipsoid(*shape.semi_axes), own
    if isinstance(shape, Triangle):
        corners = np.array([shape.a, shape.b, shape.c])
        return coal_convex(corners, np.array([[0, 1, 2], [0, 2, 1]])), own
    if isinstance(shape, Hull):
        return coal_convex(shape.vertices, outward_faces(shape.vertices)), own
    raise TypeError(f"Coal has nothing for a {type(shape).__name__}")


def coal_convex(vertices: Floats, faces: NDArray[np.integer[Any]]) -> Any:
    """Coal's convex polytope."""
    import coal

    points = coal.StdVec_Vec3s()
    points.extend(list(vertices))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*(int(i) for i in face)) for face in faces])
    return coal.Convex(points, triangles)


def outward_faces(vertices: Floats) -> NDArray[np.integer[Any]]:
    """Triangles of a hull whose corners go round counter-clockwise from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    faces = hull.simplices.copy()
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return np.asarray(faces)
