"""Bounds of the distance of two links in a tile of a tube.

In a tile all joints are at the same place of one straight line, and each may deviate
from there by a width of its own. Two lower bounds of the distance are known; the larger
counts:

- The distance in the middle less how far both sides may be carried, see `carry`. The
  signed distance changes by no more than that, overlapping as well as apart.
- The gap along the normal in the middle, by the first two derivatives of both sides'
  reach, see `armguard.motion.gap_bound`.
"""

from math import cos, inf, sin, sqrt
from typing import Annotated, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.batch.balls import SLACK
from armguard.batch.plan import Plan
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, cross, dot, norm, scaled, sub
from armguard.geometry.witness import WITNESS_WIDTH, turn_witness
from armguard.kernel import kernel
from armguard.motion.gap_bound import curvature
from armguard.motion.joint_rows import JointRow, SideMotion, joint_rows
from armguard.motion.side_reach import side_reach
from armguard.record import Records
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.table import IntMatrix, IntVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
CYLINDER = int(ShapeKind.CYLINDER)
CONE = int(ShapeKind.CONE)
ELLIPSOID = int(ShapeKind.ELLIPSOID)
HALF_SPACE = int(ShapeKind.HALF_SPACE)

# Columns of `Links.pairs`.
LINK_A, LINK_B, SHARED = range(3)

# Models of a link: primitives that enclose it, and its exact shapes.
PRIMITIVES, EXACT = range(2)


@table
class Links(NamedTuple):
    """Pairs of links, and what a bound of them writes.

    Attributes:
        body: Body of each link, -1 for the world, shape (l,).
        spans: First primitive and end, first exact shape and end, shape (l, 4).
        pairs: Two links, and how many joints move both alike, shape (k, 3).
        need: Distance that each pair has to keep, shape (k,) [m].
        joints: See `Chains`, shape (b, depth).
        length: Lengths of the chains, shape (b,).
        q: Joint positions in the middle of the tile, shape (n,).
        line: Half of each joint's line, signed, shape (n,).
        bow: How far each joint's curve may leave its line, shape (n,).
        wide: How far each joint may leave its curve, shape (n,).
        away: Joint positions, each off by its width so that a pair is nearer, (n,).
        slope: Derivative of a pair's distance by each joint, shape (n,).
        T: Poses of the bodies, shape (b, 12).
        axes: Their axes: direction and a point, shape (b, 6).
        size: Greatest displacement of each body's joint, shape (b,).
        drift: The same without `wide`, shape (b,).
        rows: Rows of the shapes of one model of both links, shape (s, 16).
        reaches: Greatest distance of a shape's points from each axis anywhere in the
            tile, shape (s, depth) [m].
        sway: How far a shape's points may be carried, and how far without `wide`,
            shape (s, 2) [m].
        lever_rows: Scratch for gradients, see `joint_rows`, shape (depth,).
        hessian: Scratch for second derivatives, shape (depth, 8 · depth).
    """

    body: IntVector
    spans: IntMatrix
    pairs: IntMatrix
    need: Vector
    joints: IntMatrix
    length: IntVector
    q: Vector
    line: Vector
    bow: Vector
    wide: Vector
    away: Vector
    slope: Vector
    T: Matrix
    axes: Matrix
    size: Vector
    drift: Vector
    rows: Matrix
    reaches: Matrix
    sway: Matrix
    lever_rows: Annotated[Records[JointRow], 1]
    hessian: Matrix


class TileGap(NamedTuple):
    """Distance of two links in a tile [m].

    Attributes:
        lower: It is never below this.
        upper: At every place of the line some position has it below this.
        found: A distance that it has in the tile.
    """

    lower: float
    upper: float
    found: float


@kernel
def move_links(q: Floats, p: Plan, t: Links) -> None:
    """Poses of all bodies and axes of their joints, see `forward_kinematics`."""
    for body in range(p.parent.shape[0]):
        up, kind, T, F = p.parent[body], p.joint_kind[body], t.T[body], p.frames[body]
        if up < 0:
            for k in range(12):
                T[k] = F[k]
        else:
            above = t.T[up]
            angle, sine, cosine = 0.0, 0.0, 1.0
            if kind != FIXED:
                angle = q[p.q_index[body]] * p.gain[body, 0] + p.gain[body, 1]
            if kind != FIXED and kind != PRISMATIC:
                sine, cosine = sin(angle), cos(angle)
            for r in range(3):
                u, v, x = above[4 * r], above[4 * r + 1], above[4 * r + 2]
                a = u * F[0] + v * F[4] + x * F[8]
                b = u * F[1] + v * F[5] + x * F[9]
                d = u * F[2] + v * F[6] + x * F[10]
                o = u * F[3] + v * F[7] + x * F[11] + above[4 * r + 3]
                T[4 * r], T[4 * r + 1] = a * cosine + b * sine, b * cosine - a * sine
                T[4 * r + 2] = d
                T[4 * r + 3] = o + (angle * d if kind == PRISMATIC else 0.0)
        for r in range(3):
            t.axes[body, r], t.axes[body, r + 3] = T[4 * r + 2], T[4 * r + 3]


@kernel
def size_joints(p: Plan, t: Links) -> None:
    """Greatest displacement of each body's joint in the tile."""
    for body in range(p.parent.shape[0]):
        t.size[body] = t.drift[body] = 0.0
        if p.parent[body] >= 0 and p.joint_kind[body] != FIXED:
            j, gain = p.q_index[body], abs(p.gain[body, 0])
            t.drift[body] = gain * (abs(t.line[j]) + t.bow[j])
            t.size[body] = t.drift[body] + gain * t.wide[j]


@kernel
def count_of(link: int, model: int, t: Links) -> int:
    """Count of shapes of a link in a model; primitives where it has no exact ones."""
    first, end = t.spans[link, 2], t.spans[link, 3]
    if model == PRIMITIVES or end == first:
        first, end = t.spans[link, 0], t.spans[link, 1]
    return int(end - first)


@kernel
def kind_of(link: int, model: int, k: int, p: Plan, t: Links) -> int:
    """ShapeKind of shape k of a link in a model."""
    if model == PRIMITIVES or t.spans[link, 3] == t.spans[link, 2]:
        return int(p.kinds[t.spans[link, 0] + k])
    return int(p.exact_kinds[t.spans[link, 2] + k])


@kernel
def place_shapes(
    link: int, model: int, at: int, shared: int, p: Plan, t: Links
) -> None:
    """Place the shapes of a link in a model, and find how far the tile carries them.

    Args:
        link: The link.
        model: PRIMITIVES or EXACT.
        at: Row of its first shape.
        shared: How many joints do not count.
        p: The plan.
        t: The links.
    """
    body, exact = t.body[link], t.spans[link, 3] > t.spans[link, 2]
    for k in range(count_of(link, model, t)):
        kind = kind_of(link, model, k, p, t)
        local, row = p.rows[t.spans[link, 0] + k], t.rows[at + k]
        if model == EXACT and exact:
            local = p.exact_rows[t.spans[link, 2] + k]
        if body < 0:
            for c in range(ROW_WIDTH):
                row[c] = local[c]
            t.sway[at + k, 0] = t.sway[at + k, 1] = 0.0
        else:
            place_row(kind, local, t.T[body], row)
            carry(kind, body, at + k, shared, p, t)


@kernel
def carry(kind: int, body: int, at: int, shared: int, p: Plan, t: Links) -> None:
    """How far the joints of a tile may carry the points of a shape.

    Change the joints one after the other, the one nearest to the root first: what a
    joint turns then is where it is in the middle of the tile, so a point goes no
    farther than its distance from the axis there times the angle.
    """
    total = drift = 0.0
    for back in range(t.length[body] - shared):
        k = t.length[body] - 1 - back
        b = t.joints[body, k]
        lever = reach = 1.0
        if p.joint_kind[b] != PRISMATIC:
            lever = lever_of(kind, t.rows[at], t.axes[b])
            reach = lever + total
        t.reaches[at, k] = reach
        drift += reach * t.drift[b]
        total += lever * t.size[b]
    t.sway[at, 0], t.sway[at, 1] = total, drift


@kernel
def lever_of(kind: int, row: Floats, axis: Floats) -> float:
    """Distance of a shape's farthest point from an axis, or a little more [m]."""
    direction, origin = (axis[0], axis[1], axis[2]), (axis[3], axis[4], axis[5])
    found = norm(cross(direction, sub((row[1], row[2], row[3]), origin)))
    if kind == SPHERE:
        return float(found + row[0])
    if kind == CAPSULE:
        end = norm(cross(direction, sub((row[4], row[5], row[6]), origin)))
        return float(max(found, end) + row[0])
    return float(found + row[0] + extent_of(kind, row))


@kernel
def extent_of(kind: int, row: Floats) -> float:
    """Greatest distance of a core's points from the origin of its row [m]."""
    if kind == SPHERE:
        return 0.0
    if kind == CAPSULE:
        return float(norm((row[4] - row[1], row[5] - row[2], row[6] - row[3])))
    if kind == BOX:
        return float(sqrt(row[4] * row[4] + row[5] * row[5] + row[6] * row[6]))
    if kind == CYLINDER or kind == CONE:
        across = max(row[4], row[6])
        return float(sqrt(across * across + row[5] * row[5]))
    if kind == ELLIPSOID:
        return float(max(row[4], row[5], row[6]))
    return float(inf if kind == HALF_SPACE else row[6])


@kernel(inline=False)
def directed_gap(
    pair: int, i: int, j: int, kind_i: int, kind_j: int, n: Vec3, p: Plan, t: Links
) -> float:
    """Least gap along a direction over the tile, bounded to the second order [m].

    Args:
        pair: The pair of links.
        i: Row of a shape of the first link.
        j: Row of a shape of the second.
        kind_i: ShapeKind of the first.
        kind_j: ShapeKind of the second.
        n: Unit direction from the first to the second.
        p: The plan.
        t: The links.
    """
    gap_one = gap_other = bend = 0.0
    first = t.pairs[pair, SHARED]
    for side in range(2):
        at, kind, along = (i, kind_i, n) if side == 0 else (j, kind_j, scaled(-1.0, n))
        body = t.body[t.pairs[pair, side]]
        count = first if body < 0 else int(t.length[body])
        if count > first:
            chain = t.joints[body]
            joint_rows(
                along, chain, first, count, t.axes, 0, p.joint_kind, t.lever_rows
            )
            for k in range(first, count):
                row, b = t.lever_rows[k], chain[k]
                j_q, gain = p.q_index[b], p.gain[b, 0]
                row.width = abs(gain) * (t.bow[j_q] + t.wide[j_q])
                row.half_line, row.widening = gain * t.line[j_q], 0.0
            reaches = t.reaches[at]
            bend += curvature(chain, first, count, reaches, p.joint_kind, t.size)
        motion = SideMotion(
            along, True, t.sway[at, 0], first, count, t.lever_rows, t.hessian
        )
        one, other = side_reach(kind, t.rows[at], motion)
        gap_one -= one
        gap_other -= other
    return float(min(gap_one, gap_other) - bend)


@kernel
def balls_apart(i: int, j: int, kind_i: int, kind_j: int, t: Links) -> float:
    """Distance of balls round two shapes, no more than that of the shapes [m]."""
    a, b = t.rows[i], t.rows[j]
    x, y, z = a[1] - b[1], a[2] - b[2], a[3] - b[3]
    apart = sqrt(x * x + y * y + z * z)
    return float(apart - a[0] - b[0] - extent_of(kind_i, a) - extent_of(kind_j, b))


@kernel
def measure_rows(
    i: int, j: int, kind_i: int, kind_j: int, t: Links, seen: Floats
) -> None:
    """Witness of two placed shapes, the first being that of the lower kind."""
    if kind_i > kind_j:
        measure(kind_j, t.rows[j], kind_i, t.rows[i], seen)
        turn_witness(seen)
    else:
        measure(kind_i, t.rows[i], kind_j, t.rows[j], seen)


@kernel(inline=False)
def bound_model(
    pair: int, model: int, limit: float, nearest: Floats, p: Plan, t: Links
) -> TileGap:
    """Bounds of two links' distance over the tile by one model of both.

    Args:
        pair: The pair of links.
        model: PRIMITIVES or EXACT.
        limit: Distance from which on no more has to be known [m].
        nearest: Witness of the nearest two shapes in the middle, overwritten.
        p: The plan.
        t: The links, their bodies in the middle of the tile.
    """
    seen = numba.carray(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    a, b, shared = t.pairs[pair, LINK_A], t.pairs[pair, LINK_B], t.pairs[pair, SHARED]
    many, others = count_of(a, model, t), count_of(b, model, t)
    place_shapes(a, model, 0, shared, p, t)
    place_shapes(b, model, many, shared, p, t)
    lower = upper = found = inf
    for i in range(many):
        kind_i = kind_of(a, model, i, p, t)
        for j in range(many, many + others):
            kind_j = kind_of(b, model, j - many, p, t)
            sway = t.sway[i, 0] + t.sway[j, 0] + SLACK
            apart = balls_apart(i, j, kind_i, kind_j, t)
            if apart - sway >= limit:
                lower = min(lower, apart - sway)
                continue
            measure_rows(i, j, kind_i, kind_j, t, seen)
            distance = seen[0]
            if not distance >= found:
                found = distance
                for k in range(WITNESS_WIDTH):
                    nearest[k] = seen[k]
            upper = min(upper, distance + t.sway[i, 1] + t.sway[j, 1] + SLACK)
            least = distance - sway
            if not least >= limit and distance > limit:
                n = (seen[7], seen[8], seen[9])
                gap = directed_gap(pair, i, j, kind_i, kind_j, n, p, t) - SLACK
                least = max(least, gap)
            lower = min(lower, least) if least == least else -inf
    return TileGap(lower, upper, found)


@kernel
def slope_of(pair: int, seen: Floats, p: Plan, t: Links) -> None:
    """Derivative of the distance of two witness points by each joint position."""
    t.slope[:] = 0.0
    normal = (seen[7], seen[8], seen[9])
    for side in range(2):
        body = t.body[t.pairs[pair, side]]
        sign, first = (-1.0, 1) if side == 0 else (1.0, 4)
        point = (seen[first], seen[first + 1], seen[first + 2])
        for k in range(t.pairs[pair, SHARED], 0 if body < 0 else t.length[body]):
            b = t.joints[body, k]
            axis = (t.axes[b, 0], t.axes[b, 1], t.axes[b, 2])
            rate = axis
            if p.joint_kind[b] != PRISMATIC:
                origin = (t.axes[b, 3], t.axes[b, 4], t.axes[b, 5])
                rate = cross(axis, sub(point, origin))
            t.slope[p.q_index[b]] += sign * p.gain[b, 0] * dot(normal, rate)


@kernel(inline=False)
def bound_pair(pair: int, limit: float, p: Plan, t: Links) -> TileGap:
    """Distance of a pair of links in the tile whose joints are written.

    Two links are as far apart as the larger of the distances of their primitives and
    of their exact shapes.

    Args:
        pair: The pair.
        limit: Distance from which on no more has to be known [m].
        p: The plan.
        t: The links.
    """
    near = numba.carray(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    size_joints(p, t)
    move_links(t.q, p, t)
    one = bound_model(pair, PRIMITIVES, limit, near, p, t)
    lower, upper, found = one.lower, one.upper, one.found
    a, b = t.pairs[pair, LINK_A], t.pairs[pair, LINK_B]
    exact = t.spans[a, 3] > t.spans[a, 2] or t.spans[b, 3] > t.spans[b, 2]
    if exact and not lower >= limit:
        two = bound_model(pair, EXACT, limit, near, p, t)
        lower, upper = max(lower, two.lower), max(upper, two.upper)
        found = max(found, two.found)
    if not t.wide.any() or lower >= limit or found == inf:
        return TileGap(lower, upper, found)
    # Where every joint deviates towards the other link, the distance is mostly least.
    slope_of(pair, near, p, t)
    for j in range(t.wide.shape[0]):
        t.away[j] = t.q[j] - (t.wide[j] if t.slope[j] >= 0.0 else -t.wide[j])
    move_links(t.away, p, t)
    one = bound_model(pair, PRIMITIVES, inf, near, p, t)
    there, worst = one.upper, one.found
    if exact:
        two = bound_model(pair, EXACT, inf, near, p, t)
        there, worst = max(there, two.upper), max(worst, two.found)
    return TileGap(lower, min(upper, there), min(found, worst))
