"""The kinds of shapes, as the kernels distinguish them."""

from enum import IntEnum


class ShapeKind(IntEnum):
    """Kinds in rank order; a pair kernel takes the lower rank first."""

    SPHERE = 0
    CAPSULE = 1
    BOX = 2
    TRIANGLE = 3
    CYLINDER = 4
    CONE = 5
    ELLIPSOID = 6
    HULL = 7
    SUPPORT = 8
    HALF_SPACE = 9
