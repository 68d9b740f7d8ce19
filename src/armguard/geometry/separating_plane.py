"""A plane between two shapes: proof that they are at least so far apart."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.core_support import core_support
from armguard.geometry.vec3 import Vec3, add, dot, scaled, sub
from armguard.kernel import kernel

Row = NDArray[np.float64]


@kernel
def separation(kind_a: int, a: Row, kind_b: int, b: Row, normal: Vec3) -> float:
    """How far two shapes are apart along a direction: no more than their distance [m].

    Args:
        kind_a: ShapeKind of A, not a half-space.
        a: Its row, shape (16,); world [m].
        kind_b: ShapeKind of B, not a half-space.
        b: Its row, shape (16,); world [m].
        normal: Unit vector from A towards B.
    """
    between = sub((b[1], b[2], b[3]), (a[1], a[2], a[3]))
    far_a = core_support(kind_a, a, normal)
    near_b = core_support(kind_b, b, scaled(-1.0, normal))
    gap = dot(normal, sub(add(between, near_b), far_a))
    return float(gap - a[0] - b[0])
