"""Foundation: shapes, poses, signed distance and witness points of a pair."""

from armguard.geometry.pose import Pose
from armguard.geometry.proximity import Proximities, Proximity, distance, distances
from armguard.geometry.shapes import (
    SHAPES,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    PlacedShape,
    Shape,
    ShapeKind,
    Sphere,
    SupportShape,
    Triangle,
    register_shape,
)

__all__ = [
    "SHAPES",
    "Box",
    "Capsule",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "HalfSpace",
    "Hull",
    "PlacedShape",
    "Pose",
    "Proximities",
    "Proximity",
    "Shape",
    "ShapeKind",
    "Sphere",
    "SupportShape",
    "Triangle",
    "distance",
    "distances",
    "register_shape",
]
