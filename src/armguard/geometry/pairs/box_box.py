"""Box against box, sharp or rounded. Conventions: see docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.box_frame import to_box, turn_from_box, turn_to_box
from armguard.geometry.box_separation import box_distance
from armguard.geometry.gjk import gjk
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.simplex import CORNER, point_of_a
from armguard.geometry.vec3 import add
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

BOX = int(ShapeKind.BOX)

# Share of the largest number met beyond which boxes are clearly apart [-].
APART = 1e-3

# Share of it within which a proof is sharp to round-off [-].
SHARP = 1e-14


@kernel(inline=False)
def box_box(a: Row, b: Row, out: Row) -> None:
    """Signed distance between two boxes, with witness points and normal.

    Clearly apart: the few steps that simplices need between polytopes, if they end with
    a proof sharp to round-off. Otherwise the nearest of sixteen vertices to the other
    box, or of the edge pairs that can be nearest; overlapping, the widest of fifteen
    axes.

    Args:
        a: Box row, shape (16,); world [m].
        b: Box row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.
    """
    simplex = array_at(stack(24), (4, CORNER), np.float64)
    gap, lower, _v, proof, _met, count, weights, largest = gjk(
        BOX, a, BOX, b, (0.0, 0.0, 0.0), simplex
    )
    if gap > APART * largest and gap - lower <= SHARP * largest:
        p = add((a[1], a[2], a[3]), point_of_a(simplex, count, weights))
        write_witness(gap, p, proof, a[0], b[0], out)
        return
    gap, p, normal = box_distance(
        (a[4], a[5], a[6]),
        (b[4], b[5], b[6]),
        to_box(a, (b[1], b[2], b[3])),
        turn_to_box(a, (b[7], b[10], b[13])),
        turn_to_box(a, (b[8], b[11], b[14])),
        turn_to_box(a, (b[9], b[12], b[15])),
    )
    world = add(turn_from_box(a, p), (a[1], a[2], a[3]))
    write_witness(gap, world, turn_from_box(a, normal), a[0], b[0], out)
