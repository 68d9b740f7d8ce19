"""Sphere against cylinder or cone. Conventions: see docs/conventions.md."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.box_frame import to_box, turn_from_box
from armguard.geometry.contact import contact_gap
from armguard.geometry.vec3 import scaled
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]


@kernel(inline=False)
def sphere_cone(a: Row, b: Row, out: Row) -> None:
    """Signed distance between a sphere and a cylinder or cone, truncated or not.

    Around the axis everything looks the same, so it is a point against a trapezoid in
    the half-plane of axis and centre.

    Args:
        a: Sphere row, shape (16,); world [m].
        b: Cylinder or cone row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        A centre on the axis leaves sideways along the frame's x; of several ways out of
        equal length the first of lower end, upper end, side is taken.
    """
    p = (a[1], a[2], a[3])
    local = to_box(b, p)
    lower, height, upper = b[4], b[5], b[6]
    r = sqrt(local[0] * local[0] + local[1] * local[1])
    z = local[2]
    # The slant's outward normal.
    slant_r, slant_z = 2.0 * height, lower - upper
    length = sqrt(slant_r * slant_r + slant_z * slant_z)
    slant_r, slant_z = slant_r / length, slant_z / length
    below, above = -height - z, z - height
    beside = slant_r * (r - lower) + slant_z * (z + height)
    if below <= 0.0 and above <= 0.0 and beside <= 0.0:
        gap, out_r, out_z = below, 0.0, -1.0
        if above > gap:
            gap, out_z = above, 1.0
        if beside > gap:
            gap, out_r, out_z = beside, slant_r, slant_z
    else:
        gap, out_r, out_z = nearest_of_outline(r, z, lower, height, upper)
        if gap > contact_gap(lower + height + upper, p, (b[1], b[2], b[3])):
            out_r, out_z = out_r / gap, out_z / gap
        elif below >= max(above, beside):
            out_r, out_z = 0.0, -1.0
        elif above >= beside:
            out_r, out_z = 0.0, 1.0
        else:
            out_r, out_z = slant_r, slant_z
    outward = (out_r, 0.0, out_z)
    if r > 0.0:
        outward = (out_r * local[0] / r, out_r * local[1] / r, out_z)
    normal = scaled(-1.0, turn_from_box(b, outward))
    write_witness(gap, p, normal, a[0], b[0], out)


@kernel
def nearest_of_outline(
    r: float, z: float, lower: float, height: float, upper: float
) -> tuple[float, float, float]:
    """Distance of a point outside the trapezoid, and the way to it from there."""
    # Ends: discs of the two radii.
    best_r, best_z = r - min(r, lower), z + height
    best = best_r * best_r + best_z * best_z
    end_r, end_z = r - min(r, upper), z - height
    square = end_r * end_r + end_z * end_z
    if square < best:
        best, best_r, best_z = square, end_r, end_z
    along_r, along_z = upper - lower, 2.0 * height
    t = ((r - lower) * along_r + (z + height) * along_z) / (
        along_r * along_r + along_z * along_z
    )
    t = min(max(t, 0.0), 1.0)
    side_r, side_z = r - (lower + t * along_r), z - (-height + t * along_z)
    square = side_r * side_r + side_z * side_z
    if square < best:
        best, best_r, best_z = square, side_r, side_z
    return sqrt(best), best_r, best_z
