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

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3
from armguard.kernel import kernel
from armguard.motion.joint_rows import SideMotion, joint_ranges, joint_rows
from armguard.motion.pair_state import Pair
from armguard.motion.side_reach import side_reach
from armguard.motion.state import NODES, WHOLE, Motion
from armguard.robot.kinematics import PRISMATIC
from armguard.table import Matrix

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


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
    chain, own, sizes = m.joints[body], m.levers[p.primitive[side]], m.spread[plan]
    if p.exact[side] >= 0:
        own = m.exact_levers[p.exact[side]]
    joint_rows(n, chain, first, count, m.axes, 0, m.joint_kind, m.lever_rows)
    joint_ranges(chain, first, count, m.middle[plan], m.width[plan], m.lever_rows)
    way = most_way(chain, first, count, own, sizes)
    s = SideMotion(n, False, way, first, count, m.lever_rows, m.hessian)
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
    chain, own = m.joints[body], m.levers[p.primitive[side]]
    if p.exact[side] >= 0:
        own = m.exact_levers[p.exact[side]]
    axes, origin = m.box_axes, 0
    if box == WHOLE:
        axes, origin = m.node_axes, at * m.parent.shape[0]
    joint_rows(n, chain, first, count, axes, origin, m.joint_kind, m.lever_rows)
    line_ranges(chain, first, count, at, box, m)
    way = most_way(chain, first, count, own, m.sizes)
    s = SideMotion(n, True, way, first, count, m.lever_rows, m.hessian)
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
