"""Our shapes as those of Coal and of FCL, whose classes have the same names.

And a pair of shapes as Coal measures it.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Shape,
    ShapeKind,
    Sphere,
    Triangle,
)
from arrays import Floats

Convex = Callable[[Floats, NDArray[np.intp]], Any]


# Axis of a capsule below which a peer takes it for a sphere [m].
SHORT = 1e-9


def is_ball(kind: int, row: Floats) -> bool:
    """Whether a primitive's row is a sphere, or a capsule without a length."""
    short = float(np.linalg.norm(row[4:7] - row[1:4])) <= SHORT
    return kind == ShapeKind.SPHERE or (kind == ShapeKind.CAPSULE and short)


def peer_geometry(
    library: Any, convex: Convex, shape: Shape, T: Floats
) -> tuple[Any, Floats] | None:
    """A library's shape without rounding, and its frame.

    Args:
        library: The module.
        convex: Makes its polytope of vertices and triangles.
        shape: The shape.
        T: Its frame, shape (4, 4).

    Returns:
        None if the library has nothing for it.
    """
    match shape:
        case Sphere():
            return library.Sphere(shape.radius), T
        case Capsule():
            length, T = along_z(shape, T)
            return library.Capsule(shape.radius, length), T
        case Box():
            return library.Box(*shape.size), T
        case Triangle():
            # Their own TriangleP is measured against nothing, or against another one.
            corners = np.array([shape.a, shape.b, shape.c])
            return convex(corners, np.array([[0, 1, 2], [0, 2, 1]])), T
        case Cylinder():
            return library.Cylinder(shape.radius, shape.height), T
        case Cone(top_radius=0.0):
            return library.Cone(shape.radius, shape.height), T
        case Ellipsoid():
            return library.Ellipsoid(*shape.semi_axes), T
        case HalfSpace():
            return library.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), T
        case Hull():
            faces = outward_faces(shape)
            return None if faces is None else (convex(shape.vertices, faces), T)
    return None


def along_z(shape: Capsule, T: Floats) -> tuple[float, Floats]:
    """Length of a capsule's axis and a frame in whose z axis it lies, centred."""
    start, end = np.array(shape.start), np.array(shape.end)
    length = float(np.linalg.norm(end - start))
    z = (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    local = np.eye(4)
    local[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    local[:3, 3] = (start + end) / 2.0
    return length, T @ local


def outward_faces(shape: Hull) -> NDArray[np.intp] | None:
    """Triangles of a hull's surface, counter-clockwise from outside; None if flat."""
    if len(shape.vertices) < 4:
        return None
    spread = np.ptp(shape.vertices, axis=0)
    if not spread.min() > 0.0:
        return None
    try:
        hull = ConvexHull(shape.vertices / spread)
    except QhullError:
        return None
    faces = hull.simplices.copy()
    corners = hull.points[faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (n * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return np.asarray(faces)


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
        TypeError: Coal has nothing for one of them.
    """
    import coal

    geometries, frames = [], []
    for shape, T in ((a, T_a), (b, T_b)):
        found = peer_geometry(coal, coal_convex, shape, T)
        if found is None:
            raise TypeError(f"Coal has nothing for a {type(shape).__name__}")
        geometry, world = found
        geometry.setSweptSphereRadius(shape.rounding)
        geometries.append(geometry)
        frames.append(coal.Transform3s(world[:3, :3], world[:3, 3]))
    return CoalPair(
        coal.ComputeDistance(*geometries),
        frames[0],
        frames[1],
        coal.DistanceRequest(),
        coal.DistanceResult(),
        (geometries[0], geometries[1]),
    )


def coal_convex(vertices: Floats, faces: NDArray[np.intp]) -> Any:
    """Coal's convex polytope."""
    import coal

    points = coal.StdVec_Vec3s()
    points.extend(list(vertices))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*(int(i) for i in face)) for face in faces])
    return coal.Convex(points, triangles)
