"""Distances with 50 digits, for the pairs that are measured by a formula.

Every feature of one shape against every feature of the other, and every axis that can
separate: no case is left out, so none can be chosen wrongly.
"""

from itertools import product
from typing import Any

import mpmath
from mpmath import mp, mpf

from armguard.geometry import ShapeKind

mp.dps = 50

Vector = list[Any]

BOX_SIGNS = list(product((-1, 1), repeat=3))


def sub(a: Vector, b: Vector) -> Vector:
    """A vector less another."""
    return [x - y for x, y in zip(a, b, strict=True)]


def dot(a: Vector, b: Vector) -> Any:
    """Inner product."""
    return sum((x * y for x, y in zip(a, b, strict=True)), mpf(0))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


def along(a: Vector, t: Any, u: Vector) -> Vector:
    """A point and a multiple of a vector."""
    return [x + t * y for x, y in zip(a, u, strict=True)]


def norm(a: Vector) -> Any:
    """Length."""
    return mpmath.sqrt(dot(a, a))


def point_segment(p: Vector, a: Vector, b: Vector) -> Any:
    """Distance of a point from a segment."""
    u = sub(b, a)
    square = dot(u, u)
    t = dot(sub(p, a), u) / square if square > 0 else mpf(0)
    return norm(sub(p, along(a, min(max(t, mpf(0)), mpf(1)), u)))


def segment_segment(a: Vector, b: Vector, c: Vector, d: Vector) -> Any:
    """Distance of two segments: ends against segments, and lines inside both."""
    least = min(
        point_segment(a, c, d),
        point_segment(b, c, d),
        point_segment(c, a, b),
        point_segment(d, a, b),
    )
    u, v, w = sub(b, a), sub(d, c), sub(c, a)
    n = cross(u, v)
    square = dot(n, n)
    if square > 0:
        s = dot(cross(w, v), n) / square
        t = dot(cross(w, u), n) / square
        if 0 <= s <= 1 and 0 <= t <= 1:
            least = min(least, abs(dot(w, n)) / mpmath.sqrt(square))
    return least


def point_triangle(p: Vector, a: Vector, b: Vector, c: Vector) -> Any:
    """Distance of a point from a triangle."""
    least = min(point_segment(p, a, b), point_segment(p, b, c), point_segment(p, c, a))
    n = cross(sub(b, a), sub(c, a))
    square = dot(n, n)
    if square > 0 and all(
        dot(cross(sub(y, x), sub(p, x)), n) >= 0 for x, y in ((a, b), (b, c), (c, a))
    ):
        least = min(least, abs(dot(sub(p, a), n)) / mpmath.sqrt(square))
    return least


class Row:
    """A row in 50 digits."""

    def __init__(self, row: Any) -> None:
        values = [mpf(float(x)) for x in row]
        self.radius, self.origin = values[0], values[1:4]
        self.second, self.third = values[4:7], values[7:10]
        self.sizes = values[4:7]
        self.axes = [[values[7 + 3 * i + j] for i in range(3)] for j in range(3)]

    def local(self, p: Vector) -> Vector:
        """A point in the frame."""
        w = sub(p, self.origin)
        return [dot(w, axis) for axis in self.axes]

    def corner(self, signs: Any) -> Vector:
        """Corner of a box."""
        p = self.origin
        for sign, size, axis in zip(signs, self.sizes, self.axes, strict=True):
            p = along(p, sign * size, axis)
        return p

    def edges(self) -> list[tuple[Vector, Vector]]:
        """Edges of a box."""
        found = []
        for signs in BOX_SIGNS:
            for k in range(3):
                if signs[k] < 0:
                    other = [*signs[:k], 1, *signs[k + 1 :]]
                    found.append((self.corner(signs), self.corner(other)))
        return found


def point_box(p: Vector, box: Row) -> Any:
    """Signed distance of a point from a box."""
    out = [abs(x) - h for x, h in zip(box.local(p), box.sizes, strict=True)]
    if max(out) <= 0:
        return max(out)
    return norm([max(x, mpf(0)) for x in out])


def point_cone(p: Vector, cone: Row) -> Any:
    """Signed distance of a point from a truncated cone."""
    x, y, z = cone.local(p)
    lower, half, upper = cone.sizes
    r = mpmath.sqrt(x * x + y * y)
    slant = mpmath.sqrt(4 * half * half + (lower - upper) ** 2)
    planes = [-half - z, z - half]
    planes.append(((r - lower) * 2 * half + (z + half) * (lower - upper)) / slant)
    if max(planes) <= 0:
        return max(planes)
    outline = [(0, -half), (lower, -half), (upper, half), (0, half)]
    ends = [[mpf(u), mpf(v), mpf(0)] for u, v in outline]
    q = [r, z, mpf(0)]
    return min(point_segment(q, ends[k], ends[k + 1]) for k in range(3))


def shadow(points: list[Vector], n: Vector) -> tuple[Any, Any]:
    """Least and largest of points along n."""
    heights = [dot(p, n) for p in points]
    return min(heights), max(heights)


def polytopes(
    corners: tuple[list[Vector], list[Vector]], axes: list[Vector], apart: Any
) -> Any:
    """Signed distance of polytopes: the widest gap of all axes, or the features'."""
    widest = mpf("-inf")
    for n in axes:
        size = norm(n)
        if size < mpf(10) ** -30:
            continue
        low_a, high_a = shadow(corners[0], n)
        low_b, high_b = shadow(corners[1], n)
        widest = max(widest, (low_b - high_a) / size, (low_a - high_b) / size)
    return apart() if widest > 0 else widest


def capsule_box(a: Row, b: Row) -> Any:
    """Signed distance of a segment and a box."""
    start, end = a.origin, a.second
    u = sub(end, start)
    corners = [b.corner(s) for s in BOX_SIGNS]
    axes = b.axes + [cross(axis, u) for axis in b.axes]

    def apart() -> Any:
        least = min(point_box(start, b), point_box(end, b))
        return min(least, *(segment_segment(start, end, *edge) for edge in b.edges()))

    return polytopes(([start, end], corners), axes, apart)


def box_box(a: Row, b: Row) -> Any:
    """Signed distance of two boxes."""
    corners = [a.corner(s) for s in BOX_SIGNS], [b.corner(s) for s in BOX_SIGNS]
    axes = a.axes + b.axes + [cross(u, v) for u in a.axes for v in b.axes]

    def apart() -> Any:
        points = [point_box(p, b) for p in corners[0]]
        points += [point_box(p, a) for p in corners[1]]
        lines = [segment_segment(*e, *f) for e in a.edges() for f in b.edges()]
        return min(points + lines)

    return polytopes(corners, axes, apart)


def above_plane(kind: ShapeKind, a: Row, b: Row) -> Any | None:
    """Distance of a core from a plane; None for cores known by their support."""
    up = [x / norm(b.second) for x in b.second]
    if kind == ShapeKind.SPHERE:
        reach = [mpf(0)]
    elif kind in (ShapeKind.CAPSULE, ShapeKind.TRIANGLE):
        ends = [a.origin, a.second, a.third][: 2 if kind == ShapeKind.CAPSULE else 3]
        reach = [-dot(sub(p, a.origin), up) for p in ends]
    elif kind in (ShapeKind.BOX, ShapeKind.ELLIPSOID):
        parts = [h * dot(up, e) for h, e in zip(a.sizes, a.axes, strict=True)]
        box = kind == ShapeKind.BOX
        reach = [sum(abs(x) for x in parts) if box else norm(parts)]
    elif kind in (ShapeKind.CYLINDER, ShapeKind.CONE):
        x, y, z = (dot(up, e) for e in a.axes)
        lower, half, upper = a.sizes
        across = mpmath.sqrt(x * x + y * y)
        reach = [lower * across + half * z, upper * across - half * z]
    else:
        return None
    return dot(sub(a.origin, b.origin), up) - max(reach)


def point_ellipsoid(p: Vector, b: Row) -> Any:
    """Signed distance of a point from an ellipsoid: a root between two bounds, halved.

    The nearest surface point is e² y / (t + e²) for the largest root t of the sum of
    (e y / (t + e²))² - 1; or, where that has none above minus the square of the
    shortest axis, it lies there, to either side of the point.
    """
    away = sub(p, b.origin)
    y = [abs(dot(away, e)) for e in b.axes]
    squares = [h * h for h in b.sizes]
    least = min(squares)

    def excess(t: Any) -> Any:
        parts = [
            q * v * v / (t + q) ** 2
            for q, v in zip(squares, y, strict=True)
            if v > 0 and t + q > 0
        ]
        return sum(parts, mpf(0)) - 1

    low, high = -least, norm(y) * max(b.sizes)
    rest = [(q, v) for q, v in zip(squares, y, strict=True) if q > least]
    shortest = [v for q, v in zip(squares, y, strict=True) if q == least]
    if (
        max(shortest) == 0
        and sum((q * v * v / (q - least) ** 2 for q, v in rest), mpf(0)) <= 1
    ):
        x = [q * v / (q - least) for q, v in rest]
        inside = 1 - sum(
            (u * u / q for u, (q, _v) in zip(x, rest, strict=True)), mpf(0)
        )
        moved = sum(((u - v) ** 2 for u, (_q, v) in zip(x, rest, strict=True)), mpf(0))
        return -mpmath.sqrt(moved + least * inside)
    for _ in range(400):
        middle = (low + high) / 2
        if excess(middle) > 0:
            low = middle
        else:
            high = middle
    gap = [v * low / (low + q) for q, v in zip(squares, y, strict=True)]
    return norm(gap) if low >= 0 else -norm(gap)


def signed_distance(
    kind_a: ShapeKind, row_a: Any, kind_b: ShapeKind, row_b: Any
) -> Any | None:
    """Signed distance in 50 digits; None for pairs this file has nothing for."""
    a, b = Row(row_a), Row(row_b)
    if kind_b == ShapeKind.HALF_SPACE:
        core = above_plane(kind_a, a, b)
    elif kind_a == ShapeKind.BOX:
        core = box_box(a, b)
    elif kind_a == ShapeKind.CAPSULE:
        core = (
            capsule_box(a, b)
            if kind_b == ShapeKind.BOX
            else segment_segment(a.origin, a.second, b.origin, b.second)
        )
    elif kind_b == ShapeKind.SPHERE:
        core = norm(sub(a.origin, b.origin))
    elif kind_b == ShapeKind.CAPSULE:
        core = point_segment(a.origin, b.origin, b.second)
    elif kind_b == ShapeKind.BOX:
        core = point_box(a.origin, b)
    elif kind_b == ShapeKind.TRIANGLE:
        core = point_triangle(a.origin, b.origin, b.second, b.third)
    elif kind_b == ShapeKind.ELLIPSOID:
        core = point_ellipsoid(a.origin, b)
    else:
        core = point_cone(a.origin, b)
    return None if core is None else core - a.radius - b.radius
