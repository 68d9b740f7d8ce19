"""Reach of a side of a pair: the greatest `n·p` over its points and all positions.

For given ranges of its joints the second-order bound of `n·p` is a convex function of
the point p, so only vertices of the core are tested, eight at a time; a radius moves
with its centre.
"""

from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, pointer, stack
from armguard.geometry.core_support import (
    LAST,
    ODD,
    SECOND,
    core_support,
    first_highest,
    lane_numbers,
)
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3, add, dot
from armguard.kernel import kernel
from armguard.lanes import WIDTH, bits, either, least, load, mask, most, splat, store
from armguard.motion.joint_rows import (
    EIGHT,
    TURNED,
    Ends,
    SideMotion,
    points_reach,
)
from armguard.table import Matrix, Vector

Floats = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
TRIANGLE = int(ShapeKind.TRIANGLE)
CYLINDER = int(ShapeKind.CYLINDER)
CONE = int(ShapeKind.CONE)
ELLIPSOID = int(ShapeKind.ELLIPSOID)
HULL = int(ShapeKind.HULL)
HALF_SPACE = int(ShapeKind.HALF_SPACE)


# Coordinates of eight points, and numbers for two values of each of them [-].
POINTS = 3 * WIDTH
ENDS = 2 * WIDTH

# Above this count of vertices, a bound over the box of a hull costs less than it saves.
MANY = 16

# What the rounding of that bound cannot exceed [m].
ROUNDING = 1e-12


@kernel(inline=False)
def side_reach(kind: int, row: Floats, s: SideMotion) -> Ends:
    """Greatest `n·p` over a primitive's points and all positions, to second order [m].

    A vertex is skipped if it cannot reach the greatest value even with the displacement
    bound.

    Args:
        kind: ShapeKind of the primitive.
        row: Row of the primitive in the world, shape (16,).
        s: The joints that move it.

    Returns:
        The value twice, or one for each end of the line.
    """
    if s.end <= s.first:
        if kind == HALF_SPACE:
            reach = half_space_reach(row, s.n)
        else:
            reach = row[0] + core_reach(kind, row, s.n)
        return (reach, reach)
    if kind == HALF_SPACE or kind == TRIANGLE:
        # Neither is part of a link.
        return (inf, inf)
    if kind == SPHERE or kind == CAPSULE:
        one, other = segment_reach(kind, row, s)
    elif kind == HULL:
        one, other = hull_reach(row, s)
    else:
        one, other = box_reach(kind, row, s)
    return (row[0] + one, row[0] + other)


@kernel
def segment_reach(kind: int, row: Floats, s: SideMotion) -> Ends:
    """Greatest reach of a sphere's centre, or of the ends of a capsule's axis [m]."""
    reach = array_at(stack(ENDS), (2, WIDTH), np.float64)
    p = q = (row[1], row[2], row[3])
    if kind == CAPSULE:
        q = (row[4], row[5], row[6])
        if dot(s.n, q) > dot(s.n, p):
            p, q = q, p
    first = mask(1)
    x, y, z = splat(q[0]), splat(q[1]), splat(q[2])
    points = (
        either(first, splat(p[0]), x),
        either(first, splat(p[1]), y),
        either(first, splat(p[2]), z),
    )
    points_reach(False, points, s, reach)
    one, other = reach[0, 0], reach[1, 0]
    if kind == CAPSULE and dot(s.n, q) + s.most > min(one, other):
        one, other = max(one, reach[0, 1]), max(other, reach[1, 1])
    return (one, other)


@kernel
def box_reach(kind: int, row: Floats, s: SideMotion) -> Ends:
    """Greatest reach of a box's corners, or of a curved core within a box [m].

    A curved core reaches at most its support plus the growth of the box about it.
    """
    x, y, z = row[4], row[5], row[6]
    if kind == CYLINDER or kind == CONE:
        x = y = max(row[4], row[6])
        z = row[5]
    elif kind != BOX and kind != ELLIPSOID:
        x = y = z = row[6]
    growth = array_at(stack(ENDS), (2, WIDTH), np.float64)
    heights = array_at(stack(WIDTH), (WIDTH,), np.float64)
    corners = point_at(row, signed(ODD, x), signed(SECOND, y), signed(LAST, z))
    points_reach(True, corners, s, growth)
    store(heights, 0, dot(s.n, corners))
    # Reach of a corner: its projection plus its growth.
    one = other = way_one = way_other = -inf
    for c in range(WIDTH):
        still = heights[c]
        if kind == BOX and still + s.most <= min(one, other):
            continue
        one, other = max(one, still + growth[0, c]), max(other, still + growth[1, c])
        way_one = max(way_one, growth[0, c])
        way_other = max(way_other, growth[1, c])
    if kind == BOX:
        return (one, other)
    core = core_reach(kind, row, s.n)
    return (min(one, core + way_one), min(other, core + way_other))


@kernel
def signed(positive: int, number: float) -> Any:
    """A number in the lanes of these bits, its opposite in the others."""
    return either(mask(positive), splat(number), splat(-number))


@kernel
def core_reach(kind: int, row: Floats, n: Vec3) -> float:
    """Greatest `n·p` of a core [m]."""
    return dot(n, add((row[1], row[2], row[3]), core_support(kind, row, n)))


@kernel
def half_space_reach(row: Floats, n: Vec3) -> float:
    """Greatest `n·p` of a half-space [m]: finite only along its own outward normal.

    The plane's own normal replaces the direction, so the two may differ by round-off
    only: the effect of an angle would grow with the coordinates of the other primitive.
    """
    outward = (row[4], row[5], row[6])
    for k in range(3):
        if not abs(n[k] - outward[k]) <= TURNED:
            return inf
    return float(row[0] + dot(outward, (row[1], row[2], row[3])))


@kernel
def point_at(row: Floats, x: Any, y: Any, z: Any) -> Any:
    """A point of a row's frame, or eight as lanes, in the world."""
    return (
        row[1] + row[7] * x + row[8] * y + row[9] * z,
        row[2] + row[10] * x + row[11] * y + row[12] * z,
        row[3] + row[13] * x + row[14] * y + row[15] * z,
    )


@kernel
def hull_reach(row: Floats, s: SideMotion) -> Ends:
    """Greatest reach of a hull's vertices [m]."""
    n, vertices = s.n, int(row[5])
    v = array_at(pointer(int(row[4])), (3 * vertices,), np.float64)
    # n in the frame of the hull.
    x = row[7] * n[0] + row[10] * n[1] + row[13] * n[2]
    y = row[8] * n[0] + row[11] * n[1] + row[14] * n[2]
    z = row[9] * n[0] + row[12] * n[1] + row[15] * n[2]
    base = dot(n, (row[1], row[2], row[3]))
    coefficients = array_at(stack(ENDS), (2, WIDTH), np.float64)
    box = array_at(stack(6), (6,), np.float64)
    bounds = array_at(stack(ENDS), (2, WIDTH), np.float64)
    reach = array_at(stack(ENDS), (2, WIDTH), np.float64)
    still = array_at(stack(WIDTH), (WIDTH,), np.float64)
    one = other = -inf
    best = -1
    if vertices > MANY:
        # The vertex with the greatest bound comes first: it rules out most others.
        box_of_vertices(v, vertices, box)
        bound_in_box(box, row, s, coefficients)
        best = highest_vertex(v, vertices, box, coefficients)
        at = eight_from(best, vertices)
        points_reach(False, point_at(row, *eight_vertices(v, vertices, at)), s, reach)
        one, other = reach[0, best - at], reach[1, best - at]
    for start in range(0, vertices, WIDTH):
        at = eight_from(start, vertices)
        a, b, c = eight_vertices(v, vertices, at)
        turned = base + a * x + b * y + c * z
        first_bound = last_bound = splat(inf)
        if best >= 0:
            first_bound, last_bound = interpolated(a, b, c, box, coefficients)
        below = turned + s.most <= min(one, other)
        within = (first_bound + ROUNDING <= one) & (last_bound + ROUNDING <= other)
        if bits(below | within) == EIGHT:
            continue
        store(still, 0, turned)
        store(bounds[0], 0, first_bound)
        store(bounds[1], 0, last_bound)
        points_reach(False, point_at(row, a, b, c), s, reach)
        for k in range(WIDTH):
            if at + k != best and reaches_more(k, one, other, still, bounds, s):
                one, other = max(one, reach[0, k]), max(other, reach[1, k])
    return (one, other)


@kernel
def eight_from(i: int, vertices: int) -> int:
    """First of eight vertices in a row, of which vertex i is one."""
    return max(min(i, vertices - WIDTH), 0)


@kernel
def eight_vertices(v: Floats, vertices: int, at: int) -> Any:
    """Coordinates of eight vertices from one on, as lanes; the last one is repeated.

    Args:
        v: Coordinates x of all vertices, then y, then z [m].
        vertices: Their count.
        at: The first of the eight.
    """
    if vertices < WIDTH:
        points = array_at(stack(POINTS), (3, WIDTH), np.float64)
        for k in range(WIDTH):
            i = min(k, vertices - 1)
            for c in range(3):
                points[c, k] = v[i + c * vertices]
        return (load(points[0], 0), load(points[1], 0), load(points[2], 0))
    return (load(v, at), load(v, at + vertices), load(v, at + 2 * vertices))


@kernel
def reaches_more(
    k: int, one: float, other: float, still: Vector, bounds: Matrix, s: SideMotion
) -> bool:
    """Whether vertex k of eight may reach beyond the greatest values so far.

    Args:
        k: The vertex.
        one: Greatest value so far, at one end of the line [m].
        other: The same at the other end.
        still: `n·p` of the vertices at rest, shape (8,) [m].
        bounds: Bounds of their reach, shape (2, 8) [m].
        s: The joints that move them.
    """
    if still[k] + s.most <= min(one, other):
        return False
    within = bounds[0, k] + ROUNDING <= one and bounds[1, k] + ROUNDING <= other
    return not within


@kernel
def box_of_vertices(v: Floats, vertices: int, box: Floats) -> None:
    """Write least and greatest coordinates of a hull's vertices, in its frame [m].

    Args:
        v: Coordinates x of all vertices, then y, then z [m].
        vertices: Their count, 8 or more.
        box: The six, overwritten.
    """
    ends = array_at(stack(ENDS), (2, WIDTH), np.float64)
    for k in range(3):
        low = high = load(v, k * vertices)
        for start in range(WIDTH, vertices, WIDTH):
            x = load(v, k * vertices + eight_from(start, vertices))
            low, high = least(low, x), most(high, x)
        store(ends[0], 0, low)
        store(ends[1], 0, high)
        box[k], box[k + 3] = ends[0, 0], ends[1, 0]
        for lane in range(1, WIDTH):
            box[k] = min(box[k], ends[0, lane])
            box[k + 3] = max(box[k + 3], ends[1, lane])


@kernel
def bound_in_box(box: Floats, row: Floats, s: SideMotion, bounds: Matrix) -> None:
    """Write an interpolation that bounds the reach of every point in a box.

    The reach is a convex function of the point, so between the corners of a box it is
    at most the trilinear interpolation of its values there.

    Args:
        box: Least and greatest coordinates in the frame of the row [m].
        row: Row of the primitive in the world.
        s: The joints that move it.
        bounds: Coefficients of both ends, overwritten, shape (2, 8): that of a product
            of coordinates from the box's least ones is at the index with the bits of
            its factors.
    """
    corners = (
        either(mask(ODD), splat(box[3]), splat(box[0])),
        either(mask(SECOND), splat(box[4]), splat(box[1])),
        either(mask(LAST), splat(box[5]), splat(box[2])),
    )
    points_reach(False, point_at(row, *corners), s, bounds)
    for end in range(2):
        for axis in range(3):
            width = box[axis + 3] - box[axis]
            for k in range(WIDTH):
                if k >> axis & 1:
                    slope = bounds[end, k] - bounds[end, k ^ (1 << axis)]
                    bounds[end, k] = slope / width if width > 0.0 else 0.0


@kernel
def interpolated(a: Any, b: Any, c: Any, box: Floats, bounds: Matrix) -> Any:
    """Bound of the reach of points of a box, as lanes, at both ends of the line [m]."""
    x, y, z = a - box[0], b - box[1], c - box[2]
    one, other = bounds[0], bounds[1]
    return (
        one[0]
        + x * (one[1] + y * (one[3] + z * one[7]) + z * one[5])
        + y * (one[2] + z * one[6])
        + z * one[4],
        other[0]
        + x * (other[1] + y * (other[3] + z * other[7]) + z * other[5])
        + y * (other[2] + z * other[6])
        + z * other[4],
    )


@kernel
def highest_vertex(v: Floats, vertices: int, box: Floats, bounds: Matrix) -> int:
    """Index of the first vertex with the greatest bound, of 8 vertices or more."""
    found = array_at(stack(ENDS), (2, WIDTH), np.float64)
    lane, top, place = lane_numbers(), splat(-inf), splat(0.0)
    for start in range(0, vertices, WIDTH):
        at = eight_from(start, vertices)
        one, other = interpolated(
            load(v, at),
            load(v, at + vertices),
            load(v, at + 2 * vertices),
            box,
            bounds,
        )
        higher = one + other > top
        top = either(higher, one + other, top)
        place = either(higher, lane + at, place)
    store(found[0], 0, top)
    store(found[1], 0, place)
    return int(found[1, first_highest(found)])
