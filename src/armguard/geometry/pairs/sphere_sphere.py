"""Sphere against sphere. Conventions: see docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import norm, scaled, sub
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]


@kernel
def sphere_sphere(a: Row, b: Row, out: Row) -> None:
    """Signed distance between two spheres, with witness points and normal.

    Args:
        a: Sphere row, shape (16,); world [m].
        b: Sphere row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        Concentric spheres get the normal +z.
    """
    p, q = (a[1], a[2], a[3]), (b[1], b[2], b[3])
    apart = sub(q, p)
    gap = norm(apart)
    normal = scaled(1.0 / gap, apart) if gap > 0.0 else (0.0, 0.0, 1.0)
    write_witness(gap, p, normal, a[0], b[0], out)
