"""Capsule against capsule. Conventions: see docs/conventions.md."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.contact import contact_gap
from armguard.geometry.segments import closest_on_segments
from armguard.geometry.vec3 import (
    Vec3,
    along,
    any_perpendicular,
    cross,
    dot,
    extent,
    norm,
    scaled,
    sub,
)
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

# Sine of the angle below which two axes span no plane [-].
PLANE_SIN = 1e-7


@kernel
def capsule_capsule(a: Row, b: Row, out: Row) -> None:
    """Signed distance between two capsules, with witness points and normal.

    The Minkowski difference of two axes is flat, so axis distance minus both radii is
    the exact signed distance, overlapping as well as apart.

    Args:
        a: Capsule row, shape (16,); world [m].
        b: Capsule row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        Where the axes meet, the normal is at right angles to both.
        Witness points of parallel axes are not unique; the distance is.

    References:
        Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
    """
    p, q = (a[1], a[2], a[3]), (b[1], b[2], b[3])
    u = (a[4] - a[1], a[5] - a[2], a[6] - a[3])
    v = (b[4] - b[1], b[5] - b[2], b[6] - b[3])
    s, t = closest_on_segments(p, u, q, v)
    on_a = along(p, s, u)
    apart = sub(along(q, t, v), on_a)
    gap = norm(apart)
    if not gap <= contact_gap(extent(u) + extent(v), p, q):
        normal = scaled(1.0 / gap, apart)
    else:
        normal = crossing_normal(u, v, sub(q, p))
    write_witness(gap, on_a, normal, a[0], b[0], out)


@kernel
def crossing_normal(u: Vec3, v: Vec3, w: Vec3) -> Vec3:
    """Unit normal to both axes, for axes that meet; any such one if parallel."""
    n = cross(u, v)
    length = norm(n)
    if length > PLANE_SIN * norm(u) * norm(v):
        # Towards B as far as that is known, so that a pass through the crossing
        # does not flip it by chance.
        return scaled((1.0 if dot(n, w) >= 0.0 else -1.0) / length, n)
    return any_perpendicular(u if dot(u, u) >= dot(v, v) else v)
