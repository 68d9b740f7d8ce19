"""Foundation: shapes, poses, signed distance and witness points of a pair."""

from armguard.geometry.pose import Pose
from armguard.geometry.proximity import Proximity, distance
from armguard.geometry.shapes import (
    Box,
    Capsule,
    PlacedShape,
    Shape,
    ShapeKind,
    Sphere,
)

__all__ = [
    "Box",
    "Capsule",
    "PlacedShape",
    "Pose",
    "Proximity",
    "Shape",
    "ShapeKind",
    "Sphere",
    "distance",
]
