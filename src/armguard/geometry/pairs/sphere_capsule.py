"""Sphere against capsule. Conventions: see docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.contact import contact_gap
from armguard.geometry.segments import closest_on_segment
from armguard.geometry.vec3 import along, any_perpendicular, norm, scaled, sub
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]


@kernel
def sphere_capsule(a: Row, b: Row, out: Row) -> None:
    """Signed distance between a sphere and a capsule, with witness points and normal.

    Args:
        a: Sphere row, shape (16,); world [m].
        b: Capsule row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        A centre on the axis gets a normal at right angles to it.
    """
    p = (a[1], a[2], a[3])
    start = (b[1], b[2], b[3])
    u = (b[4] - b[1], b[5] - b[2], b[6] - b[3])
    t = closest_on_segment(p, start, u)
    apart = sub(along(start, t, u), p)
    gap = norm(apart)
    met = gap <= contact_gap(norm(u), p, start)
    normal = any_perpendicular(u) if met else scaled(1.0 / gap, apart)
    write_witness(gap, p, normal, a[0], b[0], out)
