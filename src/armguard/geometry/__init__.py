"""Foundation: shapes, poses, signed distance and witness points of a pair."""

from armguard.geometry.pose import Pose
from armguard.geometry.proximity import Proximity, distance
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
    "Proximity",
    "Shape",
    "ShapeKind",
    "Sphere",
    "SupportShape",
    "Triangle",
    "distance",
    "register_shape",
]
