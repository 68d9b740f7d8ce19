"""Lower bound of the distance of two primitives over all positions of an interval.

Fix a direction n from A to B. Over any motion the distance is at least
`min of n·b over B - max of n·a over A`, so each side can be bounded alone. A point p of
A moves with a chain of joints; when these move by Δ,

    n·p(q + Δ) <= n·p + Σ g_k Δ_k + ½ Σ Σ h_jk Δ_j Δ_k + 1/6 Σ Σ Σ |Δ_i Δ_j Δ_k| R_max

    g_k = n · u_k          u_k = axis_k x (p - origin_k)      for a revolute joint,
    h_jk = (n x axis_j) · u_k  for j <= k                     u_k = axis_k, prismatic,

where R_k is the largest distance the points of A can have from axis k: a derivative of
p by several joints is no longer than the lever about the outermost of them. For given
ranges of Δ the greatest value of the first two sums is a convex function of p; so only
vertices of the core are tested, and a radius moves with its centre. Motion common to
both sides changes no distance and is left out.
"""

from math import inf

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer, stack
from armguard.geometry.core_support import core_support
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3, add, dot
from armguard.kernel import kernel
from armguard.lanes import WIDTH
from armguard.motion.joint_rows import (
    TURNED,
    Ends,
    SideMotion,
    joint_ranges,
    joint_rows,
    points_reach,
)
from armguard.motion.pair_state import Pair, levers_of
from armguard.motion.state import NODES, WHOLE, Motion
from armguard.robot.kinematics import PRISMATIC
from armguard.table import Matrix, Vector

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


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
    points = numba.carray(stack(POINTS), (3, WIDTH), np.float64)
    reach = numba.carray(stack(ENDS), (2, WIDTH), np.float64)
    p = q = (row[1], row[2], row[3])
    if kind == CAPSULE:
        q = (row[4], row[5], row[6])
        if dot(s.n, q) > dot(s.n, p):
            p, q = q, p
    put_point(0, p, points)
    put_point(1, q, points)
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
    points = numba.carray(stack(POINTS), (3, WIDTH), np.float64)
    growth = numba.carray(stack(ENDS), (2, WIDTH), np.float64)
    for c in range(WIDTH):
        put_point(c, corner(row, x, y, z, c), points)
    points_reach(True, points, s, growth)
    # Reach of a corner: its projection plus its growth.
    one = other = way_one = way_other = -inf
    for c in range(WIDTH):
        still = dot(s.n, (points[0, c], points[1, c], points[2, c]))
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
def put_point(c: int, p: Vec3, points: Matrix) -> None:
    """Write point c of eight."""
    points[0, c], points[1, c], points[2, c] = p


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
def corner(row: Floats, x: float, y: float, z: float, c: int) -> Vec3:
    """Corner c of a box about a row's origin, in the world."""
    return point_at(row, x if c & 1 else -x, y if c & 2 else -y, z if c & 4 else -z)


@kernel
def point_at(row: Floats, x: float, y: float, z: float) -> Vec3:
    """A point of a row's frame, in the world."""
    return (
        row[1] + row[7] * x + row[8] * y + row[9] * z,
        row[2] + row[10] * x + row[11] * y + row[12] * z,
        row[3] + row[13] * x + row[14] * y + row[15] * z,
    )


@kernel
def hull_reach(row: Floats, s: SideMotion) -> Ends:
    """Greatest reach of a hull's vertices [m]."""
    n, vertices = s.n, int(row[5])
    v = numba.carray(pointer(int(row[4])), (3 * vertices,), np.float64)
    # n in the frame of the hull.
    x = row[7] * n[0] + row[10] * n[1] + row[13] * n[2]
    y = row[8] * n[0] + row[11] * n[1] + row[14] * n[2]
    z = row[9] * n[0] + row[12] * n[1] + row[15] * n[2]
    base = dot(n, (row[1], row[2], row[3]))
    coefficients = numba.carray(stack(ENDS), (2, WIDTH), np.float64)
    box = numba.carray(stack(6), (6,), np.float64)
    points = numba.carray(stack(POINTS), (3, WIDTH), np.float64)
    bounds = numba.carray(stack(ENDS), (2, WIDTH), np.float64)
    reach = numba.carray(stack(ENDS), (2, WIDTH), np.float64)
    still = numba.carray(stack(WIDTH), (WIDTH,), np.float64)
    bounded = vertices > MANY
    best = 0
    if bounded:
        box_of_vertices(v, vertices, box)
        bound_in_box(box, row, s, coefficients)
        best = highest_vertex(v, vertices, box, coefficients)
    one = other = first_bound = last_bound = -inf
    waiting = 0
    for step in range(vertices):
        # The vertex with the greatest bound comes first: it rules out most others.
        i = best if step == 0 else step - 1 if step <= best else step
        a, b, c = v[i], v[i + vertices], v[i + 2 * vertices]
        still[waiting] = base + x * a + y * b + z * c
        first_bound = last_bound = inf
        if bounded and step > 0:
            first_bound, last_bound = interpolated(a, b, c, box, coefficients)
        bounds[0, waiting], bounds[1, waiting] = first_bound, last_bound
        if reaches_more(waiting, one, other, still, bounds, s):
            put_point(waiting, point_at(row, a, b, c), points)
            waiting += 1
        if waiting > 0 and (waiting == WIDTH or step == 0 or step == vertices - 1):
            points_reach(False, points, s, reach)
            for k in range(waiting):
                if reaches_more(k, one, other, still, bounds, s):
                    one, other = max(one, reach[0, k]), max(other, reach[1, k])
            waiting = 0
    return (one, other)


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
    """Write least and greatest coordinates of a hull's vertices, in its frame [m]."""
    for k in range(3):
        least, most = inf, -inf
        for i in range(k * vertices, (k + 1) * vertices):
            least, most = min(least, v[i]), max(most, v[i])
        box[k], box[k + 3] = least, most


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
    points = numba.carray(stack(POINTS), (3, WIDTH), np.float64)
    for k in range(WIDTH):
        a, b, c = box[3 * (k & 1)], box[1 + 3 * (k >> 1 & 1)], box[2 + 3 * (k >> 2)]
        put_point(k, point_at(row, a, b, c), points)
    points_reach(False, points, s, bounds)
    for end in range(2):
        for axis in range(3):
            width = box[axis + 3] - box[axis]
            for k in range(WIDTH):
                if k >> axis & 1:
                    slope = bounds[end, k] - bounds[end, k ^ (1 << axis)]
                    bounds[end, k] = slope / width if width > 0.0 else 0.0


@kernel
def interpolated(a: float, b: float, c: float, box: Floats, bounds: Matrix) -> Ends:
    """Bound of the reach of a point of a box at both ends of the line [m]."""
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
    """Index of the vertex with the greatest bound."""
    best, most = 0, -inf
    for i in range(vertices):
        one, other = interpolated(
            v[i], v[i + vertices], v[i + 2 * vertices], box, bounds
        )
        if one + other > most:
            best, most = i, one + other
    return best


@kernel
def most_way(
    chain: Ints, first: int, count: int, levers: Floats, sizes: Floats
) -> float:
    """Displacement bound of a primitive's points, by levers [m].

    Args:
        chain: Bodies of the chain.
        first: First joint that counts.
        count: Length of the chain.
        levers: Levers of the primitive, shape (depth,).
        sizes: Greatest |Δ| of each body's joint, shape (b,).
    """
    total = 0.0
    for k in range(first, count):
        total += sizes[chain[k]] * levers[k]
    return total


@kernel
def curvature(
    chain: Ints,
    first: int,
    count: int,
    levers: Floats,
    joint_kind: Ints,
    sizes: Floats,
) -> float:
    """Bound on the terms of higher order: 1/6 Σ Σ Σ |Δ_i Δ_j Δ_k| R_max [m].

    Args:
        chain: Bodies of the chain.
        first: First joint that counts.
        count: Length of the chain.
        levers: Levers of the primitive, shape (depth,).
        joint_kind: Joint kinds.
        sizes: Greatest |Δ| of each body's joint, shape (b,).
    """
    total = 0.0
    turned = 0.0
    for k in range(first, count):
        b = chain[k]
        size = sizes[b]
        if joint_kind[b] == PRISMATIC:
            # A prismatic joint is turned by the joints before it, and turns none.
            total += 3.0 * size * turned * turned
        else:
            before = turned * turned * turned
            turned += size
            total += levers[k] * (turned * turned * turned - before)
    return total / 6.0


@kernel(separate=True)
def range_reach(side: int, n: Vec3, p: Pair, m: Motion) -> float:
    """Greatest `n·p` of a side on the whole stop path, about its measured pose [m].

    Args:
        side: 0 for A, 1 for B.
        n: Unit direction.
        p: The pair.
        m: The prediction.
    """
    kind, a, body, plan = p.kind[side], p.row[side], p.body[side], p.plan[side]
    first, count = p.shared, 0 if body < 0 else int(m.length[body])
    if count <= first:
        return still_reach(kind, a, n, m)
    chain, own, sizes = m.joints[body], levers_of(side, p, m), m.spread[plan]
    joint_rows(n, chain, first, count, m.axes, 0, m.joint_kind, m.lever_rows)
    joint_ranges(chain, first, count, m.middle[plan], m.width[plan], m.lever_rows)
    most = most_way(chain, first, count, own, sizes)
    s = SideMotion(n, False, most, first, count, m.lever_rows, m.hessian)
    reach, _ = side_reach(kind, a, s)
    return float(reach + curvature(chain, first, count, own, m.joint_kind, sizes))


@kernel
def still_reach(kind: int, row: Floats, n: Vec3, m: Motion) -> float:
    """Greatest `n·p` of a side that no joint moves [m]."""
    return side_reach(
        kind, row, SideMotion(n, False, 0.0, 0, 0, m.lever_rows, m.hessian)
    )[0]


@kernel(separate=True)
def line_reach(
    side: int, node: int, box: int, both: Matrix, n: Vec3, p: Pair, m: Motion
) -> Vec3:
    """Greatest `n·p` of a side over a box of an interval, at both ends of its line.

    Args:
        side: 0 for A, 1 for B.
        node: The interval.
        box: Box of the interval, see `Motion.box_line`.
        both: Rows of both sides in the world, in the middle of the box.
        n: Unit direction.
        p: The pair.
        m: The prediction.

    Returns:
        Greatest `n·p` at the first and at the other end, and the curvature bound [m].
    """
    kind, a, body, first = p.kind[side], both[side], p.body[side], p.shared
    at = p.plan[side] * NODES + node
    count = 0 if body < 0 else int(m.length[body])
    if count <= first:
        still = still_reach(kind, a, n, m)
        return (still, still, 0.0)
    chain, own = m.joints[body], levers_of(side, p, m)
    axes, origin = m.box_axes, 0
    if box == WHOLE:
        axes, origin = m.node_axes, at * m.parent.shape[0]
    joint_rows(n, chain, first, count, axes, origin, m.joint_kind, m.lever_rows)
    line_ranges(chain, first, count, at, box, m)
    most = most_way(chain, first, count, own, m.sizes)
    s = SideMotion(n, True, most, first, count, m.lever_rows, m.hessian)
    one, other = side_reach(kind, a, s)
    bend = curvature(chain, first, count, own, m.joint_kind, m.sizes)
    return (one, other, bend)


@kernel
def line_ranges(
    chain: Ints, first: int, count: int, at: int, box: int, m: Motion
) -> None:
    """Write the Δ of each joint on a box's line, and its greatest size.

    A joint's position in an interval is `u · way + s · (wide + u · grow)`, with one u
    for all joints and an s of its own, each in [-1, 1]; in a box in a part of that.
    """
    line = m.box_line[box]
    for k in range(first, count):
        b = chain[k]
        row, grow, part = m.lever_rows[k], m.node_grow[at, b], m.box_part[box, b]
        row.width = part * (m.node_wide[at, b] + line.middle * grow)
        row.half_line = line.half * (m.node_way[at, b] + m.box_place[box, b] * grow)
        row.widening = part * line.half * grow
        m.sizes[b] = abs(row.half_line) + row.width + abs(row.widening)
