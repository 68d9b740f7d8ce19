"""Sphere against triangle. Conventions: see docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.contact import contact_gap
from armguard.geometry.simplex import on_triangle
from armguard.geometry.vec3 import (
    along,
    any_perpendicular,
    cross,
    dot,
    norm,
    scaled,
    sub,
)
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]


@kernel
def sphere_triangle(a: Row, b: Row, out: Row) -> None:
    """Signed distance between a sphere and a triangle, with witness points and normal.

    Args:
        a: Sphere row, shape (16,); world [m].
        b: Triangle row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        A centre on the triangle gets the triangle's normal, turned the way its corners
        go round.
    """
    p = (a[1], a[2], a[3])
    first = sub((b[1], b[2], b[3]), p)
    second = sub((b[4], b[5], b[6]), p)
    third = sub((b[7], b[8], b[9]), p)
    u, v = sub(second, first), sub(third, first)
    upright = cross(u, v)
    area = norm(upright)
    r, s, t, _square = on_triangle(first, second, third)
    if area > 0.0 and r > 0.0 and s > 0.0 and t > 0.0:
        # Over the face: the mean of the corners would lose digits that its plane keeps.
        nearer = first if dot(first, first) <= dot(second, second) else second
        apart = scaled(dot(upright, nearer) / (area * area), upright)
    else:
        apart = along(along(scaled(r, first), s, second), t, third)
    gap = norm(apart)
    if not gap <= contact_gap(norm(u) + norm(v), p, (b[1], b[2], b[3])):
        normal = scaled(1.0 / gap, apart)
    elif area > 0.0:
        normal = scaled(1.0 / area, upright)
    else:
        normal = any_perpendicular(u if norm(u) >= norm(v) else v)
    write_witness(gap, p, normal, a[0], b[0], out)
