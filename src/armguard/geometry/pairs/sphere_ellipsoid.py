"""Sphere against ellipsoid. Conventions: see docs/conventions.md."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.box_frame import to_box, turn_from_box
from armguard.geometry.vec3 import norm, scaled, sub
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

# Newton steps; six are enough for any ellipsoid that is not a needle or a sheet [-].
STEPS = 64

# A step that is this small a share of the unknown ends the search [-].
DONE = 4e-16


@kernel(inline=False)
def sphere_ellipsoid(a: Row, b: Row, out: Row) -> None:
    """Signed distance between a sphere and an ellipsoid, witness points and normal.

    The surface point x nearest to the centre y has y - x = t · x / e² for one number t,
    which is the largest root of one equation; outside it is positive, inside negative.

    Args:
        a: Sphere row, shape (16,); world [m].
        b: Ellipsoid row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        A centre that is equally far from both sides leaves along the positive axis.

    References:
        Eberly, Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid.
        The equation is made nearly straight as for trust regions: More and Sorensen,
        1983.
    """
    p = (a[1], a[2], a[3])
    gap, outward = leave_ellipsoid(to_box(b, p), b[4], b[5], b[6])
    normal = scaled(-1.0, turn_from_box(b, outward))
    write_witness(gap, p, normal, a[0], b[0], out)


@kernel
def leave_ellipsoid(
    y: tuple[float, float, float], e0: float, e1: float, e2: float
) -> tuple[float, tuple[float, float, float]]:
    """Signed distance of a point from an ellipsoid, and the unit normal towards it.

    With least the shortest axis, s = t + least² and d = e² - least²; so that nothing is
    lost where t is nearly -least².
    """
    least = min(e0, e1, e2)
    d0 = (e0 - least) * (e0 + least)
    d1 = (e1 - least) * (e1 + least)
    d2 = (e2 - least) * (e2 + least)
    # Along the shortest axes alone the equation has one root, along the others a step
    # of Newton's method from 0 leads towards another: the one looked for is above both.
    short = (
        y[0] if d0 == 0.0 else 0.0,
        y[1] if d1 == 0.0 else 0.0,
        y[2] if d2 == 0.0 else 0.0,
    )
    s = least * norm(short)
    long, slope = reach(0.0, sub(y, short), e0, e1, e2, d0, d1, d2)
    if long > 1.0:
        s = max(s, (long - 1.0) * long * long / slope)
    if reach(least * least, y, e0, e1, e2, d0, d1, d2)[0] > 1.0:
        s = max(s, least * least)
    if s == 0.0:
        # In the plane across the shortest axis, and not far out.
        g = (over(y[0], d0), over(y[1], d1), over(y[2], d2))
        up = sqrt((1.0 - long) * (1.0 + long)) / least
        if d0 == 0.0:
            g = (up, g[1], g[2])
        elif d1 == 0.0:
            g = (g[0], up, g[2])
        else:
            g = (g[0], g[1], up)
        size = norm(g)
        return -least * least * size, scaled(1.0 / size, g)
    for _ in range(STEPS):
        length, slope = reach(s, y, e0, e1, e2, d0, d1, d2)
        step = (length - 1.0) * length * length / slope
        if not step > DONE * s:
            break
        s += step
    g = (over(y[0], s + d0), over(y[1], s + d1), over(y[2], s + d2))
    size = norm(g)
    return (s - least * least) * size, scaled(1.0 / size, g)


@kernel
def over(y: float, d: float) -> float:
    """Y / d; 0 for nothing over nothing."""
    return y / d if d > 0.0 else 0.0


@kernel
def reach(
    s: float,
    y: tuple[float, float, float],
    e0: float,
    e1: float,
    e2: float,
    d0: float,
    d1: float,
    d2: float,
) -> tuple[float, float]:
    """Length of e · y / (s + d), which is 1 at the root, and minus half its slope."""
    g0, g1, g2 = over(y[0], s + d0), over(y[1], s + d1), over(y[2], s + d2)
    p0, p1, p2 = e0 * g0, e1 * g1, e2 * g2
    slope = p0 * over(p0, s + d0) + p1 * over(p1, s + d1) + p2 * over(p2, s + d2)
    return sqrt(p0 * p0 + p1 * p1 + p2 * p2), slope
