"""Distances with 50 digits, for the pairs that are measured by a formula.

Every feature of one shape against every feature of the other, and every axis that can
separate: no case is left out, so none can be chosen wrongly.
"""

from itertools import pairwise, product
from typing import Any

import mpmath
import numpy as np
from mpmath import mp, mpf

from armguard.geometry import ShapeKind

mp.dps = 50

# Numbers of 50 digits, in numpy's arrays of objects.
Vector = Any

BOX_SIGNS = list(product((-1, 1), repeat=3))

ZERO = mpf(0)


def norm(a: Vector) -> Any:
    """Length."""
    return mpmath.sqrt(a @ a)


def point_segment(p: Vector, a: Vector, b: Vector) -> Any:
    """Distance of a point from a segment."""
    u = b - a
    t = (p - a) @ u / (u @ u) if u @ u > 0 else ZERO
    return norm(p - (a + min(max(t, ZERO), mpf(1)) * u))


def segment_segment(a: Vector, b: Vector, c: Vector, d: Vector) -> Any:
    """Distance of two segments: ends against segments, and lines inside both."""
    least = min(
        *(point_segment(p, c, d) for p in (a, b)),
        *(point_segment(p, a, b) for p in (c, d)),
    )
    u, v, w = b - a, d - c, c - a
    n = np.cross(u, v)
    square = n @ n
    if square > 0:
        s, t = (np.cross(w, x) @ n / square for x in (v, u))
        if 0 <= s <= 1 and 0 <= t <= 1:
            least = min(least, abs(w @ n) / mpmath.sqrt(square))
    return least


def point_triangle(p: Vector, a: Vector, b: Vector, c: Vector) -> Any:
    """Distance of a point from a triangle."""
    sides = ((a, b), (b, c), (c, a))
    least = min(point_segment(p, *side) for side in sides)
    n = np.cross(b - a, c - a)
    if n @ n > 0 and all(np.cross(y - x, p - x) @ n >= 0 for x, y in sides):
        least = min(least, abs((p - a) @ n) / norm(n))
    return least


class Row:
    """A row in 50 digits."""

    def __init__(self, row: Any) -> None:
        values = np.array([mpf(float(x)) for x in row], dtype=object)
        self.radius, self.origin = values[0], values[1:4]
        self.second, self.third = values[4:7], values[7:10]
        self.sizes = values[4:7]
        self.axes = values[7:16].reshape(3, 3).T

    def local(self, p: Vector) -> Vector:
        """A point in the frame."""
        return self.axes @ (p - self.origin)

    def corner(self, signs: Any) -> Vector:
        """Corner of a box."""
        return self.origin + (np.array(signs) * self.sizes) @ self.axes

    def corners(self) -> list[Vector]:
        """All corners of a box."""
        return [self.corner(signs) for signs in BOX_SIGNS]

    def edges(self) -> list[tuple[Vector, Vector]]:
        """Edges of a box."""
        return [
            (self.corner(signs), self.corner((*signs[:k], 1, *signs[k + 1 :])))
            for signs in BOX_SIGNS
            for k in range(3)
            if signs[k] < 0
        ]


def point_box(p: Vector, box: Row) -> Any:
    """Signed distance of a point from a box."""
    out = abs(box.local(p)) - box.sizes
    return max(out) if max(out) <= 0 else norm(np.maximum(out, ZERO))


def point_cone(p: Vector, cone: Row) -> Any:
    """Signed distance of a point from a truncated cone."""
    x, y, z = cone.local(p)
    lower, half, upper = cone.sizes
    r = mpmath.sqrt(x * x + y * y)
    slant = mpmath.sqrt(4 * half * half + (lower - upper) ** 2)
    side = ((r - lower) * 2 * half + (z + half) * (lower - upper)) / slant
    inside = max(-half - z, z - half, side)
    if inside <= 0:
        return inside
    outline = [(ZERO, -half), (lower, -half), (upper, half), (ZERO, half)]
    q, *ends = (np.array(v, dtype=object) for v in ((r, z), *outline))
    return min(point_segment(q, *side) for side in pairwise(ends))


def polytopes(a: list[Vector], b: list[Vector], axes: list[Vector], apart: Any) -> Any:
    """Signed distance of polytopes: the widest gap of all axes, or the features'."""
    widest = mpf("-inf")
    for n in axes:
        size = norm(n)
        if size < mpf(10) ** -30:
            continue
        heights_a, heights_b = ([p @ n for p in corners] for corners in (a, b))
        gaps = min(heights_b) - max(heights_a), min(heights_a) - max(heights_b)
        widest = max(widest, *(gap / size for gap in gaps))
    return apart() if widest > 0 else widest


def capsule_box(a: Row, b: Row) -> Any:
    """Signed distance of a segment and a box."""
    ends = a.origin, a.second
    axes = [*b.axes, *(np.cross(axis, ends[1] - ends[0]) for axis in b.axes)]

    def apart() -> Any:
        least = min(point_box(p, b) for p in ends)
        return min(least, *(segment_segment(*ends, *edge) for edge in b.edges()))

    return polytopes(ends, b.corners(), axes, apart)


def box_box(a: Row, b: Row) -> Any:
    """Signed distance of two boxes."""
    axes = [*a.axes, *b.axes, *(np.cross(u, v) for u in a.axes for v in b.axes)]

    def apart() -> Any:
        points = [point_box(p, b) for p in a.corners()]
        points += [point_box(p, a) for p in b.corners()]
        lines = [segment_segment(*e, *f) for e in a.edges() for f in b.edges()]
        return min(points + lines)

    return polytopes(a.corners(), b.corners(), axes, apart)


def above_plane(kind: ShapeKind, a: Row, b: Row) -> Any | None:
    """Distance of a core from a plane; None for cores known by their support."""
    up = b.second / norm(b.second)
    match kind:
        case ShapeKind.SPHERE:
            reach = ZERO
        case ShapeKind.CAPSULE:
            reach = max(ZERO, (a.origin - a.second) @ up)
        case ShapeKind.TRIANGLE:
            reach = max(ZERO, *((a.origin - p) @ up for p in (a.second, a.third)))
        case ShapeKind.BOX:
            reach = sum(abs(a.sizes * (a.axes @ up)))
        case ShapeKind.ELLIPSOID:
            reach = norm(a.sizes * (a.axes @ up))
        case ShapeKind.CYLINDER | ShapeKind.CONE:
            x, y, z = a.axes @ up
            lower, half, upper = a.sizes
            across = mpmath.sqrt(x * x + y * y)
            reach = max(lower * across + half * z, upper * across - half * z)
        case _:
            return None
    return (a.origin - b.origin) @ up - reach


def point_ellipsoid(p: Vector, b: Row) -> Any:
    """Signed distance of a point from an ellipsoid: a root between two bounds, halved.

    The nearest surface point is e² y / (t + e²) for the largest root t of the sum of
    (e y / (t + e²))² - 1; or, where that has none above minus the square of the
    shortest axis, it lies there, to either side of the point.
    """
    y = abs(b.local(p))
    squares = b.sizes * b.sizes
    least = min(squares)

    def excess(t: Any) -> Any:
        """The sum less 1, of the parts that are not 0 by 0."""
        own = (y > 0) & (t + squares > 0)
        return sum(squares[own] * y[own] ** 2 / (t + squares[own]) ** 2, ZERO) - 1

    low, high = -least, norm(y) * max(b.sizes)
    longer = squares > least
    q, v = squares[longer], y[longer]
    if max(y[~longer]) == 0 and sum(q * v * v / (q - least) ** 2, ZERO) <= 1:
        x = q * v / (q - least)
        inside = 1 - sum(x * x / q, ZERO)
        return -mpmath.sqrt(sum((x - v) ** 2, ZERO) + least * inside)
    for _ in range(400):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    gap = norm(y * low / (low + squares))
    return gap if low >= 0 else -gap


def signed_distance(
    kind_a: ShapeKind, row_a: Any, kind_b: ShapeKind, row_b: Any
) -> Any | None:
    """Signed distance in 50 digits; None for pairs this file has nothing for."""
    a, b = Row(row_a), Row(row_b)
    match kind_a, kind_b:
        case _, ShapeKind.HALF_SPACE:
            core = above_plane(kind_a, a, b)
        case ShapeKind.BOX, _:
            core = box_box(a, b)
        case ShapeKind.CAPSULE, ShapeKind.BOX:
            core = capsule_box(a, b)
        case ShapeKind.CAPSULE, _:
            core = segment_segment(a.origin, a.second, b.origin, b.second)
        case _, ShapeKind.SPHERE:
            core = norm(a.origin - b.origin)
        case _, ShapeKind.CAPSULE:
            core = point_segment(a.origin, b.origin, b.second)
        case _, ShapeKind.BOX:
            core = point_box(a.origin, b)
        case _, ShapeKind.TRIANGLE:
            core = point_triangle(a.origin, b.origin, b.second, b.third)
        case _, ShapeKind.ELLIPSOID:
            core = point_ellipsoid(a.origin, b)
        case _:
            core = point_cone(a.origin, b)
    return None if core is None else core - a.radius - b.radius
