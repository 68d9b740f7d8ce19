"""Proof that two primitives keep a distance on the whole stop path.

First the path as a whole is bounded about the measured configuration, which needs
nothing but the witness the pair was measured by. Where that does not suffice, time is
halved again and again: in the middle of each span the pair is placed and measured, and
the span is bounded about that.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, scaled
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.gap_bound import curvature, joint_rows, side_reach
from armguard.motion.state import (
    BUDGET,
    HORIZON,
    NODE_LEVELS,
    NODES,
    TESTS,
    Motion,
)
from armguard.motion.stop_path import make_node, span_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# How a proof ends.
PROVEN = 0
NEEDED = 1  # to the first order some admissible motion breaks the distance
UNSURE = 2  # the bound is too coarse to tell
SPENT = 3  # the cycle's budget of tests is used up

# Spans that wait to be tested: one a level, and one more.
WAITING = NODE_LEVELS + 2


@kernel
def path_gap(
    kind_a: int,
    a: Floats,
    body_a: int,
    plan_a: int,
    levers_a: Floats,
    kind_b: int,
    b: Floats,
    body_b: int,
    plan_b: int,
    levers_b: Floats,
    n: Vec3,
    m: Motion,
) -> float:
    """Least distance of a pair on the whole stop path, bounded from where it is [m].

    Args:
        kind_a: ShapeKind of A.
        a: Its row in the world as measured, shape (16,).
        body_a: Its body, -1 if it stands still.
        plan_a: NEXT or NOW, the stop of its robot.
        levers_a: Its levers, shape (depth,).
        kind_b: ShapeKind of B.
        b: Its row.
        body_b: Its body.
        plan_b: The stop of its robot.
        levers_b: Its levers.
        n: Unit normal from A to B as measured.
        m: Planned stops.
    """
    first = shared_joints(body_a, body_b, m)
    count_a, count_b = chain_length(body_a, m), chain_length(body_b, m)
    depth = m.joints.shape[1]
    gap = 0.0
    for side in range(2):
        kind, row = (kind_a, a) if side == 0 else (kind_b, b)
        body, count = (body_a, count_a) if side == 0 else (body_b, count_b)
        plan, levers = (plan_a, levers_a) if side == 0 else (plan_b, levers_b)
        along = n if side == 0 else scaled(-1.0, n)
        rows = m.lever_rows[side * depth : (side + 1) * depth]
        chain = m.joints[max(body, 0)]
        low, high = m.low[plan], m.high[plan]
        joint_rows(along, chain, first, count, m.axes, m.joint_kind, low, high, rows)
        gap -= side_reach(kind, row, along, 0.0, first, count, rows)
        gap -= curvature(chain, first, count, levers, m.joint_kind, m.spread[plan])
    return gap


@kernel
def shared_joints(body_a: int, body_b: int, m: Motion) -> int:
    """Joints that move both sides alike."""
    if body_a < 0 or body_b < 0:
        return 0
    return int(m.shared[body_a, body_b])


@kernel
def chain_length(body: int, m: Motion) -> int:
    """Joints above a body; none above what stands still."""
    return 0 if body < 0 else int(m.length[body])


@kernel(inline=False)
def prove_by_spans(
    kind_a: int,
    local_a: Floats,
    body_a: int,
    plan_a: int,
    levers_a: Floats,
    kind_b: int,
    local_b: Floats,
    body_b: int,
    plan_b: int,
    levers_b: Floats,
    required: float,
    drift: float,
    m: Motion,
) -> tuple[int, float]:
    """Prove that a pair keeps a distance on the stop path, span by span.

    Args:
        kind_a: ShapeKind of A.
        local_a: Its row in the frame of its body, or in the world if that is -1.
        body_a: Its body.
        plan_a: NEXT or NOW, the stop of its robot.
        levers_a: Its levers.
        kind_b: ShapeKind of B.
        local_b: Its row.
        body_b: Its body.
        plan_b: The stop of its robot.
        levers_b: Its levers.
        required: Distance to keep now [m].
        drift: Speed at which that grows [m/s].
        m: Planned stops.

    Returns:
        PROVEN, NEEDED, UNSURE or SPENT, and the least of distance minus requirement:
        a bound of what is left if proven, an estimate of what lacks if not [m].
    """
    waiting = numba.carray(stack(8), (WAITING,), np.float64)
    waiting[0] = 1.0
    left = 1
    least = np.inf
    while left > 0:
        left -= 1
        node = int(waiting[left])
        if m.effort[TESTS] >= m.effort[BUDGET]:
            return (SPENT, -np.inf)
        m.effort[TESTS] += 1
        make_node(plan_a, node, m)
        make_node(plan_b, node, m)
        _, end = span_of(node, m.span[HORIZON])
        wanted = required + drift * end
        first_order, bend = span_gap(
            node,
            kind_a,
            local_a,
            body_a,
            plan_a,
            levers_a,
            kind_b,
            local_b,
            body_b,
            plan_b,
            levers_b,
            m,
        )
        spare = first_order - bend - wanted
        if spare >= 0.0:
            least = min(least, spare)
            continue
        if not 2 * node < (1 << NODE_LEVELS):
            return (NEEDED if not first_order >= wanted else UNSURE, spare)
        # The later half first: where a proof fails, it mostly fails there.
        waiting[left] = 2.0 * node
        waiting[left + 1] = 2.0 * node + 1.0
        left += 2
    return (PROVEN, least)


@kernel(inline=False)
def span_gap(
    node: int,
    kind_a: int,
    local_a: Floats,
    body_a: int,
    plan_a: int,
    levers_a: Floats,
    kind_b: int,
    local_b: Floats,
    body_b: int,
    plan_b: int,
    levers_b: Floats,
    m: Motion,
) -> tuple[float, float]:
    """Least distance over a span to the first order, and what it may leave out [m]."""
    a = numba.carray(stack(16), (ROW_WIDTH,), np.float64)
    b = numba.carray(stack(16), (ROW_WIDTH,), np.float64)
    witness = numba.carray(stack(10), (WITNESS_WIDTH,), np.float64)
    at_a, at_b = plan_a * NODES + node, plan_b * NODES + node
    place_at_node(at_a, kind_a, local_a, body_a, m, a)
    place_at_node(at_b, kind_b, local_b, body_b, m, b)
    measure(kind_a, a, kind_b, b, witness)
    if not witness[0] >= 0.0:
        return (witness[0], 0.0)
    n = (witness[7], witness[8], witness[9])
    first = shared_joints(body_a, body_b, m)
    count_a, count_b = chain_length(body_a, m), chain_length(body_b, m)
    depth = m.joints.shape[1]
    rows_a, rows_b = m.lever_rows[:depth], m.lever_rows[depth : 2 * depth]
    chain_a, chain_b = m.joints[max(body_a, 0)], m.joints[max(body_b, 0)]
    back = scaled(-1.0, n)
    node_rows(at_a, n, chain_a, first, count_a, m, rows_a)
    node_rows(at_b, back, chain_b, first, count_b, m, rows_b)
    gap = np.inf
    for end in range(2):
        # Both sides are at the same place of their lines; between the two ends the
        # gap is a concave function of it.
        u = 2.0 * end - 1.0
        reach = side_reach(kind_a, a, n, u, first, count_a, rows_a)
        reach += side_reach(kind_b, b, back, u, first, count_b, rows_b)
        gap = min(gap, -reach)
    bend = curvature(chain_a, first, count_a, levers_a, m.joint_kind, m.node_size[at_a])
    bend += curvature(
        chain_b, first, count_b, levers_b, m.joint_kind, m.node_size[at_b]
    )
    return (gap, bend)


@kernel
def node_rows(
    at: int, n: Vec3, chain: Ints, first: int, count: int, m: Motion, rows: Floats
) -> None:
    """Write how each joint of a chain moves points along n within a span."""
    bodies = m.parent.shape[0]
    axes = m.node_axes[at * bodies : (at + 1) * bodies]
    way, width = m.node_way[at], m.node_width[at]
    joint_rows(n, chain, first, count, axes, m.joint_kind, way, width, rows)


@kernel
def place_at_node(
    at: int, kind: int, local: Floats, body: int, m: Motion, out: Floats
) -> None:
    """Row of a primitive in the world in the middle of a span."""
    if body < 0:
        for k in range(ROW_WIDTH):
            out[k] = local[k]
    else:
        place_row(kind, local, m.node_T[at * m.parent.shape[0] + body], out)
