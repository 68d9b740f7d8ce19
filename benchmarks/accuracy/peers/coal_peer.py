"""Coal, with tolerances of 1e-12 and a thousand iterations."""

from typing import Any

import coal
import numpy as np

from accuracy.peers.frames import along_z, outward_faces
from accuracy.regimes import Pair
from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Sphere,
    Triangle,
)


def request() -> Any:
    """A request set so that its answers are as good as they get."""
    asked = coal.DistanceRequest()
    asked.enable_signed_distance = True
    asked.gjk_tolerance = asked.epa_tolerance = 1e-12
    asked.gjk_max_iterations = asked.epa_max_iterations = 1000
    return asked


def geometry(shape: Any, T: Any) -> tuple[Any, Any] | None:
    """Coal's shape and the frame it stands at."""
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius), T
    if isinstance(shape, Capsule):
        length, T = along_z(shape, T)
        return coal.Capsule(shape.radius, length), T
    if isinstance(shape, Box):
        return coal.Box(*(2.0 * np.array(shape.half_extents))), T
    if isinstance(shape, Triangle):
        # Its own TriangleP is measured against nothing but another one.
        corners = np.array([shape.a, shape.b, shape.c])
        return convex(corners, np.array([[0, 1, 2], [0, 2, 1]])), T
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.height), T
    if isinstance(shape, Cone) and shape.top_radius == 0.0:
        return coal.Cone(shape.radius, shape.height), T
    if isinstance(shape, Ellipsoid):
        return coal.Ellipsoid(*shape.semi_axes), T
    if isinstance(shape, HalfSpace):
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), T
    if isinstance(shape, Hull):
        faces = outward_faces(shape)
        if faces is None:
            return None
        return convex(shape.vertices, faces), T
    return None


def convex(vertices: Any, faces: Any) -> Any:
    """Coal's convex polytope."""
    points = coal.StdVec_Vec3s()
    points.extend(list(vertices))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*(int(i) for i in face)) for face in faces])
    return coal.Convex(points, triangles)


def ask(pair: Pair) -> float | None:
    """Signed distance, or None where the pair is not supported."""
    one, two = geometry(pair.shape_a, pair.T_a), geometry(pair.shape_b, pair.T_b)
    if one is None or two is None:
        return None
    frames = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in (one[1], two[1])]
    try:
        found = coal.distance(
            one[0], frames[0], two[0], frames[1], request(), coal.DistanceResult()
        )
    except RuntimeError as error:
        if "not yet" in str(error) or "not supported" in str(error):
            return None
        raise
    return float(found) - pair.shape_a.rounding - pair.shape_b.rounding
