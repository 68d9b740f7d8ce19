"""A lower bound of the distance of two primitives over all positions of a span.

Fix a direction n from A to B. Over any motion the distance is at least
`min of n·b over B - max of n·a over A`, so each side can be bounded alone. A point p of
A rides on a chain of joints; when these move by Δ,

    n·p(q + Δ) <= n·p + Σ g_k Δ_k + ½ Σ Σ h_jk Δ_j Δ_k + 1/6 Σ Σ Σ |Δ_i Δ_j Δ_k| R_max

    g_k = n · u_k          u_k = axis_k x (p - origin_k)      for a turning joint,
    h_jk = (n x axis_j) · u_k  for j <= k                     u_k = axis_k, sliding,

where R_k is the largest distance the points of A can have from axis k: a derivative of
p by several joints is no longer than the lever about the outermost of them. For given
ranges of Δ the first two sums have their greatest values at ends of the ranges, which
is a convex function of p; so only vertices of the core are looked at, and a radius
moves with its centre. Motion common to both sides changes no distance and is left out.
"""

from math import inf

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer
from armguard.geometry.core_support import core_support
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, add, cross, dot, norm, sub
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

# Places in a row that tells how a joint moves points, see LEVER_ROW: g(p) is
# slope·p + level. Its range of Δ is FROM to TO, or over a span FROM is half its way on
# a line and TO how far it may be off that.
SLOPE = 0  # n x axis, 3 numbers; 0 for a sliding joint
LEVEL = 3
FROM = 4
TO = 5
AXIS = 6  # 3 numbers
ORIGIN = 9  # 3 numbers
TURNS = 12  # 1 for a turning joint, 0 for a sliding one
DERIVATIVE = 13  # u_k of the vertex that is looked at, 3 numbers


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
        row = rows[k]
        direction = (axes[b, 0], axes[b, 1], axes[b, 2])
        for x in range(3):
            row[AXIS + x] = axes[b, x]
            row[ORIGIN + x] = axes[b, x + 3]
        if joint_kind[b] == PRISMATIC:
            row[0] = row[1] = row[2] = row[TURNS] = 0.0
            row[LEVEL] = dot(n, direction)
        else:
            slope = cross(n, direction)
            row[0], row[1], row[2] = slope
            row[LEVEL] = -dot(slope, (axes[b, 3], axes[b, 4], axes[b, 5]))
            row[TURNS] = 1.0
        row[FROM] = one[b]
        row[TO] = other[b]


@kernel
def point_reach(
    n: Vec3, p: Vec3, u: float, first: int, count: int, rows: Floats
) -> float:
    """`n·p` and how far it can grow, to the second order [m].

    Args:
        n: Direction; 0 for the growth alone.
        p: A vertex of the core, in the world [m].
        u: 0 where every joint has its own range, else the end of the line, -1 or 1.
        first: First joint of the chain that counts.
        count: Length of the chain.
        rows: Written by `joint_rows`.
    """
    way = dot(n, p)
    along = across = 0.0
    for k in range(first, count):
        own = rows[k]
        g = own[0] * p[0] + own[1] * p[1] + own[2] * p[2] + own[LEVEL]
        move = (own[AXIS], own[AXIS + 1], own[AXIS + 2])
        if own[TURNS] != 0.0:
            origin = (own[ORIGIN], own[ORIGIN + 1], own[ORIGIN + 2])
            move = cross(move, sub(p, origin))
        low, high = own[FROM], own[TO]
        if u == 0.0:
            way += max(g * low, g * high)
            low, high = 0.0, max(abs(low), abs(high))
        else:
            way += u * g * low + abs(g) * high
        for j in range(first, k + 1):
            other = rows[j]
            share = 0.5 if j == k else 1.0
            h = share * dot((other[0], other[1], other[2]), move)
            if u == 0.0:
                across += abs(h) * high * max(abs(other[FROM]), abs(other[TO]))
            else:
                along += h * low * other[FROM]
                across += abs(h) * (
                    abs(low) * other[TO] + high * (abs(other[FROM]) + other[TO])
                )
    return way + across + max(along, 0.0)


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
    """Greatest `n·p` over a primitive's points and all positions, to second order [m].

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
    over: no derivative is longer than the slope times the hull's farthest point.
    """
    origin = (row[1], row[2], row[3])
    vertices = int(row[5])
    v = numba.carray(pointer(int(row[4])), (3 * vertices,), np.float64)
    most_move = turned = 0.0
    for k in range(first, count):
        own = rows[k]
        size = max(abs(own[FROM]), abs(own[TO]))
        if u != 0.0:
            size = abs(own[FROM]) + own[TO]
        lever = 1.0
        if own[TURNS] != 0.0:
            arm = sub(origin, (own[ORIGIN], own[ORIGIN + 1], own[ORIGIN + 2]))
            lever = norm(arm) + row[6]
        most_move += lever * size * (1.0 + turned + 0.5 * size)
        turned += size
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
    """What the second order leaves out: 1/6 Σ Σ Σ |Δ_i Δ_j Δ_k| R_max [m].

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
            total += 3.0 * size * turned * turned
        else:
            before = turned * turned * turned
            turned += size
            total += levers[k] * (turned * turned * turned - before)
    return total / 6.0


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
    """The same over one span, for the two ends of its line, and what that leaves out.

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
