"""Convex shapes: a core grown by a radius, one shape a file.

A *rounding* is more of that radius: it grows the shape outwards on every side.
"""

from armguard.geometry.shapes.box import Box
from armguard.geometry.shapes.capsule import Capsule
from armguard.geometry.shapes.cone import Cone
from armguard.geometry.shapes.cylinder import Cylinder
from armguard.geometry.shapes.ellipsoid import Ellipsoid
from armguard.geometry.shapes.half_space import HalfSpace
from armguard.geometry.shapes.hull import Hull
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.placed import PlacedShape
from armguard.geometry.shapes.registry import SHAPES, Shape, register_shape
from armguard.geometry.shapes.row import ROW_WIDTH, shape_row
from armguard.geometry.shapes.sphere import Sphere
from armguard.geometry.shapes.support import SupportShape
from armguard.geometry.shapes.triangle import Triangle

__all__ = [
    "ROW_WIDTH",
    "SHAPES",
    "Box",
    "Capsule",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "HalfSpace",
    "Hull",
    "PlacedShape",
    "Shape",
    "ShapeKind",
    "Sphere",
    "SupportShape",
    "Triangle",
    "register_shape",
    "shape_row",
]
