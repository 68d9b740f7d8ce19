"""FCL, by python-fcl, which offers no way to set the tolerance of 1e-6."""

from typing import Any

import fcl
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


def geometry(shape: Any, T: Any) -> tuple[Any, Any] | None:
    """FCL's shape and the frame it stands at."""
    if isinstance(shape, Sphere):
        return fcl.Sphere(shape.radius), T
    if isinstance(shape, Capsule):
        length, T = along_z(shape, T)
        return fcl.Capsule(shape.radius, length), T
    if isinstance(shape, Box):
        return fcl.Box(*(2.0 * np.array(shape.half_extents))), T
    if isinstance(shape, Triangle):
        # Its own TriangleP gets no distance at all.
        corners = np.array([shape.a, shape.b, shape.c])
        return convex(corners, np.array([[0, 1, 2], [0, 2, 1]])), T
    if isinstance(shape, Cylinder):
        return fcl.Cylinder(shape.radius, shape.height), T
    if isinstance(shape, Cone) and shape.top_radius == 0.0:
        return fcl.Cone(shape.radius, shape.height), T
    if isinstance(shape, Ellipsoid):
        return fcl.Ellipsoid(*shape.semi_axes), T
    if isinstance(shape, HalfSpace):
        return fcl.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), T
    if isinstance(shape, Hull):
        faces = outward_faces(shape)
        if faces is None:
            return None
        return convex(shape.vertices, faces), T
    return None


def convex(vertices: Any, faces: Any) -> Any:
    """FCL's convex polytope."""
    flat = np.concatenate([np.full((len(faces), 1), 3), faces], axis=1).flatten()
    return fcl.Convex(vertices, len(faces), flat)


def ask(pair: Pair) -> float | None:
    """Signed distance, or None where the pair is not supported."""
    one, two = geometry(pair.shape_a, pair.T_a), geometry(pair.shape_b, pair.T_b)
    if one is None or two is None:
        return None
    a, b = (
        fcl.CollisionObject(shape, fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy()))
        for shape, T in (one, two)
    )
    asked = fcl.DistanceRequest(enable_signed_distance=True)
    found = fcl.distance(a, b, asked, fcl.DistanceResult())
    return float(found) - pair.shape_a.rounding - pair.shape_b.rounding
