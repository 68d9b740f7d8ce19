"""The point of a simplex nearest to the origin.

A simplex is a matrix of float64, a corner a row: 0-2 the corner itself, the difference
of a point of A and one of B; 3-5 the point of A. Corners it does not need are dropped.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, add, along, cross, dot, scaled, sub
from armguard.kernel import kernel

Matrix = NDArray[np.float64]
Weights = tuple[float, float, float, float]

# Numbers a corner has.
CORNER = 6

# A triangle whose sine, or a tetrahedron whose volume, is below this is flat [-].
FLAT_SINE = 1e-14


@kernel
def corner(simplex: Matrix, k: int) -> Vec3:
    """Corner k."""
    return (simplex[k, 0], simplex[k, 1], simplex[k, 2])


@kernel
def on_segment(a: Vec3, b: Vec3) -> tuple[float, float]:
    """Weight of b in the nearest point of a segment, and that point's square."""
    u = sub(b, a)
    uu = dot(u, u)
    au = -dot(a, u)
    if not au > 0.0 or not uu > 0.0:
        return 0.0, dot(a, a)
    if au >= uu:
        return 1.0, dot(b, b)
    t = au / uu
    # From the nearer end: less is lost.
    p = along(a, t, u) if t <= 0.5 else along(b, t - 1.0, u)
    return t, dot(p, p)


@kernel(inline=False)
def on_triangle(a: Vec3, b: Vec3, c: Vec3) -> tuple[float, float, float, float]:
    """Weights of the corners in the nearest point of a triangle, and its square."""
    u, v = sub(b, a), sub(c, a)
    n = cross(u, v)
    nn = dot(n, n)
    uu, vv = dot(u, u), dot(v, v)
    if nn > FLAT_SINE * FLAT_SINE * uu * vv:
        # Weights of the origin's shadow: areas of the triangles it makes with edges.
        na, nc = cross(n, a), cross(n, c)
        wa = dot(nc, b) * -1.0
        wb = dot(nc, a)
        wc = dot(na, b)
        if wa >= 0.0 and wb >= 0.0 and wc >= 0.0:
            total = wa + wb + wc
            if total > 0.0:
                per = 1.0 / total
                height = dot(n, a if dot(a, a) <= dot(b, b) else b)
                return wa * per, wb * per, wc * per, height * height / nn
    else:
        wa = wb = wc = -1.0
    best = np.inf
    answer = (1.0, 0.0, 0.0, dot(a, a))
    if not wc > 0.0:
        t, square = on_segment(a, b)
        best = square
        answer = (1.0 - t, t, 0.0, square)
    if not wb > 0.0:
        t, square = on_segment(a, c)
        if square < best:
            best = square
            answer = (1.0 - t, 0.0, t, square)
    if not wa > 0.0:
        t, square = on_segment(b, c)
        if square < best:
            answer = (0.0, 1.0 - t, t, square)
    return answer


@kernel
def on_tetrahedron(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> tuple[bool, Weights]:
    """Nearest point of a tetrahedron.

    Returns:
        Whether the origin is inside, and the weights of the corners.
    """
    u, v, w = sub(b, a), sub(c, a), sub(d, a)
    volume = dot(cross(u, v), w)
    # Volumes of the four tetrahedra the origin makes with the faces.
    cd, ab = cross(c, d), cross(a, b)
    wa, wb, wc, wd = dot(b, cd), -dot(a, cd), dot(d, ab), -dot(c, ab)
    # Their sum is the volume; that of faces seen from outside has the other sign.
    if volume < 0.0:
        wa, wb, wc, wd = -wa, -wb, -wc, -wd
    span = dot(u, u) * dot(v, v) * dot(w, w)
    flat = not volume * volume > FLAT_SINE * FLAT_SINE * span
    if not flat and wa > 0.0 and wb > 0.0 and wc > 0.0 and wd > 0.0:
        per = 1.0 / (wa + wb + wc + wd)
        return True, (wa * per, wb * per, wc * per, wd * per)
    best = np.inf
    weights = (1.0, 0.0, 0.0, 0.0)
    if flat or not wd > 0.0:
        r, s, t, square = on_triangle(a, b, c)
        if square < best:
            best = square
            weights = (r, s, t, 0.0)
    if flat or not wc > 0.0:
        r, s, t, square = on_triangle(a, b, d)
        if square < best:
            best = square
            weights = (r, s, 0.0, t)
    if flat or not wb > 0.0:
        r, s, t, square = on_triangle(a, c, d)
        if square < best:
            best = square
            weights = (r, 0.0, s, t)
    if flat or not wa > 0.0:
        r, s, t, square = on_triangle(b, c, d)
        if square < best:
            weights = (0.0, r, s, t)
    return False, weights


@kernel
def reduce_simplex(simplex: Matrix, count: int) -> tuple[int, Weights, Vec3, bool]:
    """Drop the corners the nearest point does not need.

    Args:
        simplex: Corners, shape (4, CORNER); those that stay are moved to the front.
        count: How many there are, 1 to 4.

    Returns:
        How many stay, their weights, the nearest point, whether the origin is inside.
    """
    a, b = corner(simplex, 0), corner(simplex, 1)
    c, d = corner(simplex, 2), corner(simplex, 3)
    inside = False
    if count == 1:
        return 1, (1.0, 0.0, 0.0, 0.0), a, False
    if count == 2:
        t, _square = on_segment(a, b)
        weights = (1.0 - t, t, 0.0, 0.0)
    elif count == 3:
        r, s, t, _square = on_triangle(a, b, c)
        weights = (r, s, t, 0.0)
    else:
        inside, weights = on_tetrahedron(a, b, c, d)
    # The nearest point of a sliver is inaccurate, but this mean is surely in it.
    nearest = scaled(weights[0], a)
    if weights[1] > 0.0:
        nearest = along(nearest, weights[1], b)
    if weights[2] > 0.0:
        nearest = along(nearest, weights[2], c)
    if weights[3] > 0.0:
        nearest = along(nearest, weights[3], d)
    kept = 0
    p = q = r = s = 0.0
    for k in range(count):
        if weights[k] > 0.0:
            if kept == 0:
                p = weights[k]
            elif kept == 1:
                q = weights[k]
            elif kept == 2:
                r = weights[k]
            else:
                s = weights[k]
            if kept < k:
                for n in range(CORNER):
                    simplex[kept, n] = simplex[k, n]
            kept += 1
    return kept, (p, q, r, s), nearest, inside


@kernel
def point_of_a(simplex: Matrix, count: int, weights: Weights) -> Vec3:
    """The point of A that belongs to a weighted mean of corners."""
    p = (0.0, 0.0, 0.0)
    for k in range(count):
        q = (simplex[k, 3], simplex[k, 4], simplex[k, 5])
        p = add(p, scaled(weights[k], q))
    return p
