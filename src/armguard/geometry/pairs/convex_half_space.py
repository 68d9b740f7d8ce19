"""Any shape against a half-space. Conventions: see docs/conventions.md."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.core_support import core_support
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import add, dot, norm, scaled, sub
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

HALF_SPACE = int(ShapeKind.HALF_SPACE)

# Normals whose sum is shorter than this are opposite: the planes never meet [-].
OPPOSITE = 1e-12


@kernel(inline=False)
def convex_half_space(kind_a: int, a: Row, b: Row, out: Row) -> None:
    """Signed distance between a shape and a half-space, with witnesses and normal.

    The deepest point of the shape is its support against the half-space's normal.

    Args:
        kind_a: ShapeKind of A.
        a: Its row, shape (16,); world [m].
        b: Half-space row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        No translation separates two half-spaces whose surfaces meet; their distance is
        minus infinity, with A's own normal, and both witness points on A's surface.
    """
    surface = (b[1], b[2], b[3])
    up = (b[4], b[5], b[6])
    inward = scaled(-1.0, up)
    origin = (a[1], a[2], a[3])
    if kind_a != HALF_SPACE:
        deepest = core_support(kind_a, a, inward)
        # Origins first: far from the world's, a sum with them loses digits.
        gap = dot(sub(origin, surface), up) + dot(deepest, up)
        write_witness(gap, add(origin, deepest), inward, a[0], b[0], out)
        return
    facing = (a[4], a[5], a[6])
    if norm(add(facing, up)) <= OPPOSITE:
        gap = dot(sub(origin, surface), up)
        write_witness(gap, origin, facing, a[0], b[0], out)
        return
    write_witness(0.0, origin, facing, a[0], 0.0, out)
    out[0] = -inf
    out[4], out[5], out[6] = out[1], out[2], out[3]
