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
def on_segment(a: Vec3, b: Vec3) -> tuple[float, Vec3]:
    """Weight of b in the nearest point of a segment, and that point."""
    u = sub(b, a)
    uu = dot(u, u)
    au = -dot(a, u)
    if not au > 0.0 or not uu > 0.0:
        return 0.0, a
    if au >= uu:
        return 1.0, b
    t = au / uu
    # From the nearer end: less is lost.
    if t <= 0.5:
        return t, (a[0] + t * u[0], a[1] + t * u[1], a[2] + t * u[2])
    s = 1.0 - t
    return t, (b[0] - s * u[0], b[1] - s * u[1], b[2] - s * u[2])


@kernel(inline=False)
def on_triangle(a: Vec3, b: Vec3, c: Vec3) -> tuple[float, float, float, Vec3]:
    """Weights of the corners in the nearest point of a triangle, and that point."""
    u, v = sub(b, a), sub(c, a)
    n = cross(u, v)
    nn = dot(n, n)
    uu, vv = dot(u, u), dot(v, v)
    if nn > FLAT_SINE * FLAT_SINE * uu * vv:
        # Weights of the origin's shadow: areas of the triangles it makes with edges.
        wa = dot(n, cross(b, c))
        wb = dot(n, cross(c, a))
        wc = dot(n, cross(a, b))
        if wa >= 0.0 and wb >= 0.0 and wc >= 0.0:
            total = wa + wb + wc
            if total > 0.0:
                height = dot(n, a if dot(a, a) <= dot(b, b) else b) / nn
                return wa / total, wb / total, wc / total, scaled(height, n)
    else:
        wa = wb = wc = -1.0
    best = np.inf
    answer = (1.0, 0.0, 0.0, a)
    if not wc > 0.0:
        t, p = on_segment(a, b)
        best = dot(p, p)
        answer = (1.0 - t, t, 0.0, p)
    if not wb > 0.0:
        t, p = on_segment(a, c)
        if dot(p, p) < best:
            best = dot(p, p)
            answer = (1.0 - t, 0.0, t, p)
    if not wa > 0.0:
        t, p = on_segment(b, c)
        if dot(p, p) < best:
            best = dot(p, p)
            answer = (0.0, 1.0 - t, t, p)
    return answer


@kernel(inline=False)
def on_tetrahedron(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> tuple[bool, Weights, Vec3]:
    """Nearest point of a tetrahedron.

    Returns:
        Whether the origin is inside, the corners' weights, and the nearest point.
    """
    u, v, w = sub(b, a), sub(c, a), sub(d, a)
    n = cross(u, v)
    volume = dot(n, w)
    size = abs(volume)
    # Volumes of the four tetrahedra the origin makes with the faces.
    wa = dot(b, cross(c, d))
    wb = -dot(a, cross(c, d))
    wc = dot(a, cross(b, d))
    wd = -dot(a, cross(b, c))
    # Their sum is the volume; that of faces seen from outside has the other sign.
    sign = 1.0 if volume >= 0.0 else -1.0
    wa, wb, wc, wd = sign * wa, sign * wb, sign * wc, sign * wd
    span = dot(u, u) * dot(v, v) * dot(w, w)
    flat = not size * size > FLAT_SINE * FLAT_SINE * span
    if not flat and wa > 0.0 and wb > 0.0 and wc > 0.0 and wd > 0.0:
        total = wa + wb + wc + wd
        weights = (wa / total, wb / total, wc / total, wd / total)
        return True, weights, (0.0, 0.0, 0.0)
    best = np.inf
    weights = (1.0, 0.0, 0.0, 0.0)
    nearest = a
    if flat or not wd > 0.0:
        r, s, t, p = on_triangle(a, b, c)
        if dot(p, p) < best:
            best = dot(p, p)
            weights, nearest = (r, s, t, 0.0), p
    if flat or not wc > 0.0:
        r, s, t, p = on_triangle(a, b, d)
        if dot(p, p) < best:
            best = dot(p, p)
            weights, nearest = (r, s, 0.0, t), p
    if flat or not wb > 0.0:
        r, s, t, p = on_triangle(a, c, d)
        if dot(p, p) < best:
            best = dot(p, p)
            weights, nearest = (r, 0.0, s, t), p
    if flat or not wa > 0.0:
        r, s, t, p = on_triangle(b, c, d)
        if dot(p, p) < best:
            best = dot(p, p)
            weights, nearest = (0.0, r, s, t), p
    return False, weights, nearest


@kernel
def reduce_simplex(simplex: Matrix, count: int) -> tuple[int, Weights, Vec3, bool]:
    """Drop the corners the nearest point does not need.

    Args:
        simplex: Corners, shape (4, CORNER); those that stay are moved to the front.
        count: How many there are, 1 to 4.

    Returns:
        How many stay, their weights, the nearest point, whether the origin is inside.
    """
    inside = False
    if count == 1:
        weights = (1.0, 0.0, 0.0, 0.0)
        nearest = corner(simplex, 0)
    elif count == 2:
        t, nearest = on_segment(corner(simplex, 0), corner(simplex, 1))
        weights = (1.0 - t, t, 0.0, 0.0)
    elif count == 3:
        r, s, t, nearest = on_triangle(
            corner(simplex, 0), corner(simplex, 1), corner(simplex, 2)
        )
        weights = (r, s, t, 0.0)
    else:
        inside, weights, nearest = on_tetrahedron(
            corner(simplex, 0),
            corner(simplex, 1),
            corner(simplex, 2),
            corner(simplex, 3),
        )
    kept = 0
    a = b = c = d = 0.0
    for k in range(count):
        if weights[k] > 0.0:
            if kept == 0:
                a = weights[k]
            elif kept == 1:
                b = weights[k]
            elif kept == 2:
                c = weights[k]
            else:
                d = weights[k]
            for n in range(CORNER):
                simplex[kept, n] = simplex[k, n]
            kept += 1
    weights = (a, b, c, d)
    if not inside:
        # Of a sliver the nearest point is told badly, but this one is surely in it.
        nearest = (0.0, 0.0, 0.0)
        for k in range(kept):
            nearest = along(nearest, weights[k], corner(simplex, k))
    return kept, weights, nearest, inside


@kernel
def point_of_a(simplex: Matrix, count: int, weights: Weights) -> Vec3:
    """The point of A that belongs to a weighted mean of corners."""
    p = (0.0, 0.0, 0.0)
    for k in range(count):
        q = (simplex[k, 3], simplex[k, 4], simplex[k, 5])
        p = add(p, scaled(weights[k], q))
    return p
