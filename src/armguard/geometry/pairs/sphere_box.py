"""Sphere against box, sharp or rounded. Conventions: see docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.box_frame import (
    clamp_to_box,
    leave_by_face,
    to_box,
    turn_from_box,
)
from armguard.geometry.contact import contact_gap
from armguard.geometry.vec3 import norm, scaled, sub
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]


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
    if not gap <= contact_gap(norm(half), p, (b[1], b[2], b[3])):
        normal = scaled(1.0 / gap, apart)
    else:
        depth, outward = leave_by_face(local, half)
        # Outside by a hair the distance is good, only its direction is not.
        gap = gap if depth < 0.0 else -depth
        normal = scaled(-1.0, outward)
    write_witness(gap, p, turn_from_box(b, normal), a[0], b[0], out)
