"""Any two convex shapes, by support functions. Conventions: docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.gjk import CLOSE, gjk
from armguard.geometry.penetration import core_depth
from armguard.geometry.simplex import CORNER, point_of_a
from armguard.geometry.vec3 import add, scaled
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

# How far beyond touching B is moved to find the witness points, as a share of the
# largest number met [-].
BEYOND = 1e-6

# A distance of close cores less sure than this share of the largest number met is left
# to the expanding polytope [-].
UNPROVEN = 1e-11


@kernel(inline=False, entry=True)
def convex_convex(kind_a: int, a: Row, kind_b: int, b: Row, out: Row) -> None:
    """Signed distance between two convex shapes, with witness points and normal.

    Args:
        kind_a: ShapeKind of A, not a half-space.
        a: Its row, shape (16,); world [m].
        kind_b: ShapeKind of B, not a half-space.
        b: Its row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.
    """
    simplex = array_at(stack(24), (4, CORNER), np.float64)
    still = (0.0, 0.0, 0.0)
    gap, lower, v, proof, met, count, weights, largest = gjk(
        kind_a, a, kind_b, b, still, simplex
    )
    origin = (a[1], a[2], a[3])
    p = add(origin, point_of_a(simplex, count, weights))
    unsure = gap - lower > UNPROVEN * largest and gap < CLOSE * largest
    if not (met or unsure):
        write_witness(gap, p, proof, a[0], b[0], out)
        return
    depth, normal = core_depth(kind_a, a, kind_b, b, simplex, count, v, largest)
    if not met and lower > 0.0 and lower >= -depth:
        # Of two proofs that they are apart the better one; no more than it proves.
        write_witness(lower, p, proof, a[0], b[0], out)
        return
    # Where they touch once B has been moved out, and a little further: there the
    # nearest point of A - B is unique, and lies on the normal.
    out_of_it = scaled(depth + BEYOND * largest, normal)
    _gap, _lower, _v, _proof, _met, count, weights, _largest = gjk(
        kind_a, a, kind_b, b, out_of_it, simplex
    )
    p = add(origin, point_of_a(simplex, count, weights))
    write_witness(-depth, p, normal, a[0], b[0], out)
