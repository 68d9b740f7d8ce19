"""Every class of shapes there is; tests and the accuracy table read it from here."""

from typing import TypeVar

from armguard.geometry.shapes.box import Box
from armguard.geometry.shapes.capsule import Capsule
from armguard.geometry.shapes.cone import Cone
from armguard.geometry.shapes.cylinder import Cylinder
from armguard.geometry.shapes.ellipsoid import Ellipsoid
from armguard.geometry.shapes.half_space import HalfSpace
from armguard.geometry.shapes.hull import Hull
from armguard.geometry.shapes.sphere import Sphere
from armguard.geometry.shapes.support import SupportShape
from armguard.geometry.shapes.triangle import Triangle

Shape = (
    Sphere
    | Capsule
    | Box
    | Triangle
    | Cylinder
    | Cone
    | Ellipsoid
    | Hull
    | SupportShape
    | HalfSpace
)

SHAPES: dict[str, type[Shape]] = {
    shape.__name__: shape
    for shape in (
        Sphere,
        Capsule,
        Box,
        Triangle,
        Cylinder,
        Cone,
        Ellipsoid,
        Hull,
        HalfSpace,
    )
}

NewShape = TypeVar("NewShape", bound=type[SupportShape])


def register_shape(shape: NewShape) -> NewShape:
    """Decorator: take a class of shapes into the registry, under its name.

    The tests hold a registered class to every law of distances; its classmethod
    `example(rng, size)` gives them shapes to try.
    """
    SHAPES[shape.__name__] = shape
    return shape
