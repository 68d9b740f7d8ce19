"""A lower bound of the distance of two primitives over all positions of a span.

Fix a direction n from A to B. Over any motion the distance is at least
`min of n·b over B - max of n·a over A`, so each side can be bounded alone. A point p of
A rides on a chain of joints; when these move by Δ,

    n·p(q + Δ)  <=  n·p + Σ Δ_k g_k(p) + ½ Σ Σ |Δ_j| |Δ_k| R_max(j,k),
    g_k(p) = n · (axis_k x (p - origin_k))        for a turning joint,
    g_k(p) = n · axis_k                            for a sliding one,

where R_k is the largest distance the points of A can have from axis k: the second
derivative of p by two joints is no longer than the lever about the outer of the two.
For a range of Δ the first sum is largest at an end of each joint's range. All of it is
convex in p, so it is largest at a vertex of the core; and a radius moves with its
centre. Motion common to both sides changes no distance and is left out.
"""

from math import inf

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer
from armguard.geometry.core_support import core_support
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, add, cross, dot
from armguard.kernel import kernel
from armguard.motion.state import open_motion
from armguard.robot.kinematics import PRISMATIC

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

# Places in a row that tells how a joint moves points along n: g(p) = slope·p + level,
# and the joint's range of Δ; or, over a span, its way and width.
SLOPE = 0
LEVEL = 3
FROM = 4
TO = 5


@kernel
def joint_rows(
    n: Vec3,
    chain: Ints,
    first: int,
    count: int,
    axes: Floats,
    joint_kind: Ints,
    one: Floats,
    other: Floats,
    rows: Floats,
) -> None:
    """Write how each joint of a chain moves points along n.

    Args:
        n: Unit direction.
        chain: Bodies of the chain, shape (depth,).
        first: First of them that counts.
        count: Length of the chain.
        axes: Axes in the world, shape (b, 6).
        joint_kind: Joint kinds, shape (b,).
        one: Least Δ of each body's joint, or half its way, shape (b,).
        other: Greatest Δ, or its width, shape (b,).
        rows: Overwritten, shape (depth, LEVER_ROW).
    """
    for k in range(first, count):
        b = chain[k]
        direction = (axes[b, 0], axes[b, 1], axes[b, 2])
        if joint_kind[b] == PRISMATIC:
            rows[k, 0] = rows[k, 1] = rows[k, 2] = 0.0
            rows[k, LEVEL] = dot(n, direction)
        else:
            slope = cross(n, direction)
            rows[k, 0], rows[k, 1], rows[k, 2] = slope
            rows[k, LEVEL] = -dot(slope, (axes[b, 3], axes[b, 4], axes[b, 5]))
        rows[k, FROM] = one[b]
        rows[k, TO] = other[b]


@kernel
def farthest_move(p: Vec3, first: int, count: int, rows: Floats) -> float:
    """How far p can move along n to the first order, each joint in its own range."""
    way = 0.0
    for k in range(first, count):
        g = rows[k, 0] * p[0] + rows[k, 1] * p[1] + rows[k, 2] * p[2] + rows[k, LEVEL]
        way += max(g * rows[k, FROM], g * rows[k, TO])
    return way


@kernel
def farthest_on_line(p: Vec3, u: float, first: int, count: int, rows: Floats) -> float:
    """The same where every joint is at `u · way ± width`."""
    way = 0.0
    for k in range(first, count):
        g = rows[k, 0] * p[0] + rows[k, 1] * p[1] + rows[k, 2] * p[2] + rows[k, LEVEL]
        way += u * g * rows[k, FROM] + abs(g) * rows[k, TO]
    return way


@kernel
def point_reach(
    n: Vec3, p: Vec3, u: float, first: int, count: int, rows: Floats
) -> float:
    """`n·p` and how far it can grow; u = 0 for ranges, ±1 for an end of a line."""
    if u == 0.0:
        return dot(n, p) + farthest_move(p, first, count, rows)
    return dot(n, p) + farthest_on_line(p, u, first, count, rows)


@kernel(inline=False)
def side_reach(
    kind: int,
    row: Floats,
    n: Vec3,
    u: float,
    first: int,
    count: int,
    rows: Floats,
) -> float:
    """Greatest `n·p` over a primitive's points and all positions, to first order [m].

    Args:
        kind: ShapeKind.
        row: Its row in the world, shape (16,).
        n: Unit direction.
        u: 0 for ranges, else the end of the line the joints are on.
        first: First joint of the chain that counts.
        count: Length of the chain; no more than `first` for what stands still.
        rows: Written by `joint_rows`.
    """
    origin = (row[1], row[2], row[3])
    if count <= first:
        if kind == HALF_SPACE:
            return half_space_reach(row, n)
        return float(row[0] + dot(n, add(origin, core_support(kind, row, n))))
    if kind == SPHERE or kind == CAPSULE:
        reach = -inf
        for end in range(1, 5 if kind == CAPSULE else 2, 3):
            p = (row[end], row[end + 1], row[end + 2])
            reach = max(reach, point_reach(n, p, u, first, count, rows))
        return float(row[0] + reach)
    if kind == HULL:
        return float(row[0] + hull_reach(row, n, u, first, count, rows))
    if kind == HALF_SPACE or kind == TRIANGLE:
        # Neither rides on a link.
        return inf
    x, y, z = row[4], row[5], row[6]
    if kind == CYLINDER or kind == CONE:
        x = y = max(row[4], row[6])
        z = row[5]
    elif kind != BOX and kind != ELLIPSOID:
        x = y = z = row[6]
    # A curved core moves no farther than the box around it, on top of its own support.
    still = dot(n, add(origin, core_support(kind, row, n)))
    reach = move = -inf
    for c in range(8):
        p = corner(row, x, y, z, c)
        way = point_reach((0.0, 0.0, 0.0), p, u, first, count, rows)
        reach = max(reach, dot(n, p) + way)
        move = max(move, way)
    return float(row[0] + min(reach, still + move))


@kernel
def half_space_reach(row: Floats, n: Vec3) -> float:
    """Greatest `n·p` of a half-space: finite only against its own normal.

    A normal that round-off has turned a little would make it infinite; the plane is
    taken as it is, and the direction as its opposite.
    """
    outward = (row[4], row[5], row[6])
    if dot(n, outward) < 1.0 - 1e-12:
        return inf
    return float(row[0] + dot(outward, (row[1], row[2], row[3])))


@kernel
def corner(row: Floats, x: float, y: float, z: float, c: int) -> Vec3:
    """Corner c of a box about a row's origin, in the world."""
    x = x if c & 1 else -x
    y = y if c & 2 else -y
    z = z if c & 4 else -z
    return (
        row[1] + row[7] * x + row[8] * y + row[9] * z,
        row[2] + row[10] * x + row[11] * y + row[12] * z,
        row[3] + row[13] * x + row[14] * y + row[15] * z,
    )


@kernel
def hull_reach(
    row: Floats, n: Vec3, u: float, first: int, count: int, rows: Floats
) -> float:
    """Greatest reach of a hull's vertices.

    A vertex that could not be the one even if it moved as far as any does is passed
    over: g is at most its value at the origin plus slope times reach.
    """
    origin = (row[1], row[2], row[3])
    vertices = int(row[5])
    v = numba.carray(pointer(int(row[4])), (3 * vertices,), np.float64)
    most_move = 0.0
    for k in range(first, count):
        slope = abs(rows[k, 0]) + abs(rows[k, 1]) + abs(rows[k, 2])
        g = rows[k, 0] * origin[0] + rows[k, 1] * origin[1] + rows[k, 2] * origin[2]
        size = abs(g + rows[k, LEVEL]) + slope * row[6]
        if u == 0.0:
            most_move += size * max(abs(rows[k, FROM]), abs(rows[k, TO]))
        else:
            most_move += size * (abs(rows[k, FROM]) + rows[k, TO])
    # n in the frame of the hull.
    x = row[7] * n[0] + row[10] * n[1] + row[13] * n[2]
    y = row[8] * n[0] + row[11] * n[1] + row[14] * n[2]
    z = row[9] * n[0] + row[12] * n[1] + row[15] * n[2]
    base = dot(n, origin)
    best = -inf
    for i in range(vertices):
        a, b, c = v[i], v[i + vertices], v[i + 2 * vertices]
        if base + x * a + y * b + z * c + most_move <= best:
            continue
        p = (
            origin[0] + row[7] * a + row[8] * b + row[9] * c,
            origin[1] + row[10] * a + row[11] * b + row[12] * c,
            origin[2] + row[13] * a + row[14] * b + row[15] * c,
        )
        best = max(best, point_reach(n, p, u, first, count, rows))
    return best


@kernel
def curvature(
    chain: Ints,
    first: int,
    count: int,
    levers: Floats,
    joint_kind: Ints,
    sizes: Floats,
) -> float:
    """What the first order leaves out: ½ Σ Σ |Δ_j| |Δ_k| R_max(j,k) [m].

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
            # It is turned by the joints before it, and turns nothing itself.
            total += size * turned
        else:
            total += levers[k] * size * (0.5 * size + turned)
            turned += size
    return total


@kernel(inline=False)
def range_reach(
    kind: int,
    row: int,
    body: int,
    plan: int,
    levers: int,
    first: int,
    n: Vec3,
    motion: int,
) -> float:
    """Greatest `n·p` of a side on the whole stop path, from where it is now [m].

    Args:
        kind: ShapeKind.
        row: Address of its row in the world.
        body: Its body, -1 if it stands still.
        plan: NEXT or NOW, the stop of its robot.
        levers: Address of its levers.
        first: First joint that does not move both sides alike.
        n: Unit direction.
        motion: Address of the ledger of the prediction.
    """
    m = open_motion(motion)
    a = numba.carray(pointer(row), (ROW_WIDTH,), np.float64)
    count = 0 if body < 0 else int(m.length[body])
    if count <= first:
        return float(side_reach(kind, a, n, 0.0, first, first, m.lever_rows))
    chain, low, high = m.joints[body], m.low[plan], m.high[plan]
    joint_rows(n, chain, first, count, m.axes, m.joint_kind, low, high, m.lever_rows)
    reach = side_reach(kind, a, n, 0.0, first, count, m.lever_rows)
    own = numba.carray(pointer(levers), (m.joints.shape[1],), np.float64)
    return float(
        reach + curvature(chain, first, count, own, m.joint_kind, m.spread[plan])
    )


@kernel(inline=False)
def line_reach(
    kind: int,
    row: int,
    body: int,
    at: int,
    levers: int,
    first: int,
    n: Vec3,
    motion: int,
) -> Vec3:
    """The same over one span, for the two ends of its line, and what it leaves out.

    Args:
        kind: ShapeKind.
        row: Address of its row in the world, in the middle of the span.
        body: Its body, -1 if it stands still.
        at: The span among those of all plans.
        levers: Address of its levers.
        first: First joint that does not move both sides alike.
        n: Unit direction.
        motion: Address of the ledger of the prediction.

    Returns:
        Greatest `n·p` at the first end, at the other, and the curvature [m].
    """
    m = open_motion(motion)
    a = numba.carray(pointer(row), (ROW_WIDTH,), np.float64)
    count = 0 if body < 0 else int(m.length[body])
    if count <= first:
        still = side_reach(kind, a, n, 0.0, first, first, m.lever_rows)
        return (still, still, 0.0)
    bodies = m.parent.shape[0]
    axes = m.node_axes[at * bodies : (at + 1) * bodies]
    chain, way, width = m.joints[body], m.node_way[at], m.node_width[at]
    joint_rows(n, chain, first, count, axes, m.joint_kind, way, width, m.lever_rows)
    one = other = 0.0
    for end in range(2):
        u = 2.0 * end - 1.0
        one, other = other, side_reach(kind, a, n, u, first, count, m.lever_rows)
    own = numba.carray(pointer(levers), (m.joints.shape[1],), np.float64)
    bend = curvature(chain, first, count, own, m.joint_kind, m.node_size[at])
    return (one, other, bend)
