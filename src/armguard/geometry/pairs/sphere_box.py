"""Sphere against box, sharp or rounded. Conventions: see docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.box_frame import (
    clamp_to_box,
    leave_by_face,
    to_box,
    turn_from_box,
)
from armguard.geometry.vec3 import norm, scaled, sub
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

# Below this distance of the cores their direction is mostly round-off [m].
TOUCHING_GAP = 1e-10


@kernel
def sphere_box(a: Row, b: Row, out: Row) -> None:
    """Signed distance between a sphere and a box, with witness points and normal.

    A centre inside the core leaves it by the nearest face.

    Args:
        a: Sphere row, shape (16,); world [m].
        b: Box row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        Of several nearest faces the first in the order x, y, z gives the normal.
    """
    p = (a[1], a[2], a[3])
    local = to_box(b, p)
    half = (b[4], b[5], b[6])
    apart = sub(clamp_to_box(local, half), local)
    gap = norm(apart)
    if not gap <= TOUCHING_GAP:
        normal = scaled(1.0 / gap, apart)
    else:
        depth, outward = leave_by_face(local, half)
        gap = -depth
        normal = scaled(-1.0, outward)
    write_witness(gap, p, turn_from_box(b, normal), a[0], b[0], out)
