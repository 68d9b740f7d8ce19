"""Bounds of the distance of two links in a tile of a tube.

In a tile all joints are at the same place of one straight line, and each may deviate
from there by a width of its own. Joints that follow different parameters are at
different places. Two lower bounds of the distance are known; the larger counts:

- The distance in the middle less how far both sides may be carried, see `carry`. The
  signed distance changes by no more than that, overlapping as well as apart.
- The gap along the normal in the middle, by the first two derivatives of both sides'
  reach, see `armguard.motion.gap_bound`.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
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
from armguard.motion.joint_rows import SideMotion, joint_rows
from armguard.motion.side_reach import side_reach
from armguard.prove.links import (
    ANYHOW,
    APART,
    EXACT,
    FOLLOWS,
    LINK_A,
    LINK_B,
    PRIMITIVES,
    SHARED,
    Links,
    TileGap,
    has_exact,
    kind_of,
    move_links,
)
from armguard.robot.kinematics import PRISMATIC

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
CYLINDER = int(ShapeKind.CYLINDER)
CONE = int(ShapeKind.CONE)
ELLIPSOID = int(ShapeKind.ELLIPSOID)
HALF_SPACE = int(ShapeKind.HALF_SPACE)


@kernel(inline=False)
def place_shapes(link: int, model: int, shared: int, p: Plan, t: Links) -> None:
    """Place the shapes of a link in a model, and find how far the tile carries them.

    Args:
        link: The link.
        model: PRIMITIVES or EXACT.
        shared: How many joints do not count.
        p: The plan.
        t: The links.
    """
    if t.placed[link, 2 * model] == t.turn[0] and (
        t.placed[link, 2 * model + 1] == shared
    ):
        return
    t.placed[link, 2 * model], t.placed[link, 2 * model + 1] = t.turn[0], shared
    body, primitives = t.body[link], p.ball.shape[0]
    for i in range(t.spans[link, 2 * model], t.spans[link, 2 * model + 1]):
        kind, row = kind_of(i, p), t.rows[i]
        local = p.rows[i] if i < primitives else p.exact_rows[i - primitives]
        if body < 0:
            for c in range(ROW_WIDTH):
                row[c] = local[c]
            t.sway[i, 0] = t.sway[i, 1] = 0.0
        else:
            place_row(kind, local, t.T[body], row)
            carry(kind, body, i, shared, p, t)


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
    first, follows = t.pairs[pair, SHARED], t.pairs[pair, FOLLOWS]
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
                if follows == ANYHOW:
                    row.width += abs(row.half_line)
                    row.half_line = 0.0
            reaches = t.reaches[at]
            bend += curvature(chain, first, count, reaches, p.joint_kind, t.size)
        motion = SideMotion(
            along, True, t.sway[at, 0], first, count, t.lever_rows, t.hessian
        )
        one, other = side_reach(kind, t.rows[at], motion)
        if follows == APART:
            one = other = max(one, other)
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
    seen = array_at(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    a, b, shared = t.pairs[pair, LINK_A], t.pairs[pair, LINK_B], t.pairs[pair, SHARED]
    place_shapes(a, model, shared, p, t)
    place_shapes(b, model, shared, p, t)
    lower = upper = found = deepest = inf
    for i in range(t.spans[a, 2 * model], t.spans[a, 2 * model + 1]):
        kind_i = kind_of(i, p)
        for j in range(t.spans[b, 2 * model], t.spans[b, 2 * model + 1]):
            kind_j = kind_of(j, p)
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
            drift = t.sway[i, 1] + t.sway[j, 1] + SLACK
            upper = min(upper, distance + drift)
            deepest = min(deepest, distance - sway + 2.0 * drift)
            least = distance - sway
            # Where a pair of shapes leaves the tile undecided, the others need not do.
            if lower >= limit and not least >= limit and distance > limit:
                n = (seen[7], seen[8], seen[9])
                gap = directed_gap(pair, i, j, kind_i, kind_j, n, p, t) - SLACK
                least = max(least, gap)
            lower = min(lower, least) if least == least else -inf
    return TileGap(lower, upper, found, deepest)


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
def bound_pair(pair: int, limit: float, off: bool, p: Plan, t: Links) -> TileGap:
    """Distance of a pair of links in the tile in whose middle all bodies are.

    Two links are as far apart as the larger of the distances of their primitives and
    of their exact shapes.

    Args:
        pair: The pair.
        limit: Distance from which on no more has to be known [m].
        off: Whether `upper` counts positions off the curves as well.
        p: The plan.
        t: The links.
    """
    near = array_at(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    one = bound_model(pair, PRIMITIVES, limit, near, p, t)
    lower, upper, found, deepest = one.lower, one.upper, one.found, one.deepest
    a, b = t.pairs[pair, LINK_A], t.pairs[pair, LINK_B]
    exact = has_exact(a, t) or has_exact(b, t)
    if exact and not lower >= limit:
        two = bound_model(pair, EXACT, limit, near, p, t)
        lower, upper = max(lower, two.lower), max(upper, two.upper)
        found, deepest = max(found, two.found), max(deepest, two.deepest)
    if not off or not t.wide.any() or lower >= limit or not deepest < limit:
        return TileGap(lower, upper, found, deepest)
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
    move_links(t.q, p, t)
    return TileGap(lower, min(upper, there), min(found, worst), deepest)


@kernel(inline=False)
def measure_ways(pair: int, owner: Ints, p: Plan, t: Links, ways: Floats) -> None:
    """Write how far each parameter of a tile may carry points of two links.

    Args:
        pair: The pair of links.
        owner: Parameter of each joint, shape (n,).
        p: The plan.
        t: The links, their bodies in the middle of the tile.
        ways: Overwritten, one for each parameter [m].
    """
    ways[:] = 0.0
    for side in range(2):
        link, shared = t.pairs[pair, side], t.pairs[pair, SHARED]
        body = t.body[link]
        place_shapes(link, PRIMITIVES, shared, p, t)
        for k in range(shared, 0 if body < 0 else t.length[body]):
            b, far = t.joints[body, k], 0.0
            for i in range(t.spans[link, 0], t.spans[link, 1]):
                far = max(far, t.reaches[i, k])
            ways[owner[p.q_index[b]]] += far * t.drift[b]
