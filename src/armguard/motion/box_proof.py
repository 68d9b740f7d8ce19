"""Last resort of a proof: a span's box of joint positions, divided until it is clear.

Over a short span of time what keeps a pair unproven is not the way but how far each
joint may be off it: the guard does not know how hard stops will be. That box is halved
along the joint that matters most, and each half is measured in its own middle. A middle
nearer than it may be is a position the joints can really take, so the stop is needed.
"""

from math import inf

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer, stack
from armguard.geometry.pairs import measure_by
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, dot, scaled
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.gap_bound import curvature, joint_rows, side_reach
from armguard.motion.nearest import joint_way, nearest_position
from armguard.motion.pair_state import (
    BODY,
    KIND,
    LEVERS,
    LOCAL,
    NEEDED,
    PAIR,
    PLAN,
    PROVEN,
    SHARED,
    SIDE,
    SPENT,
    UNSURE,
)
from armguard.motion.state import (
    BOX_LEVELS,
    BUDGET,
    MEASURE,
    NODES,
    TESTS,
    Motion,
    open_motion,
)
from armguard.motion.stop_path import write_axis
from armguard.robot.kinematics import FIXED as NO_JOINT
from armguard.robot.kinematics import forward_kinematics

Floats = NDArray[np.float64]

# A box costs about as much as this many spans, which share their kinematics [-].
BOX_COST = 3

# Boxes one span of one pair may take before it is given up [-].
MOST_BOXES = 32


@kernel(inline=False)
def prove_by_boxes(
    node: int, pair: int, wanted: float, motion: int
) -> tuple[int, float]:
    """Prove that a pair keeps a distance for all positions of a span.

    Args:
        node: The span.
        pair: Address of the pair's description.
        wanted: Distance to keep [m].
        motion: Address of the ledger of the prediction.

    Returns:
        PROVEN, NEEDED, UNSURE or SPENT, and what is left or lacks [m].
    """
    m = open_motion(motion)
    begin(node, pair, m)
    left = 1
    boxes = 0
    least = inf
    while left > 0:
        left -= 1
        if m.effort[TESTS] >= m.effort[BUDGET]:
            return (SPENT, -inf)
        m.effort[TESTS] += BOX_COST
        boxes += 1
        distance, gap, widest, nearer = box_gap(left, node, pair, wanted, motion)
        if not distance >= wanted:
            return (NEEDED, distance - wanted)
        if gap >= wanted:
            least = min(least, gap - wanted)
            continue
        if left + 2 > BOX_LEVELS or boxes >= MOST_BOXES or widest < 0:
            return (UNSURE, gap - wanted)
        for b in range(m.parent.shape[0]):
            m.box_middle[left + 1, b] = m.box_middle[left, b]
            m.box_width[left + 1, b] = m.box_width[left, b]
        half = 0.5 * m.box_width[left, widest]
        m.box_width[left, widest] = m.box_width[left + 1, widest] = half
        # The half in which the sides come nearer goes first.
        m.box_middle[left, widest] -= nearer * half
        m.box_middle[left + 1, widest] += nearer * half
        left += 2
    return (PROVEN, least)


@kernel
def begin(node: int, pair: int, m: Motion) -> None:
    """Write the box of a span; the way along its line is a part of the widths."""
    p = numba.carray(pointer(pair), (PAIR,), np.float64)
    for b in range(m.parent.shape[0]):
        m.box_middle[0, b] = m.box_width[0, b] = 0.0
    for j in range(m.q.shape[0]):
        m.q_box[j] = m.q[j]
    for side in range(2):
        body = int(p[side * SIDE + BODY])
        if body < 0:
            continue
        at = int(p[side * SIDE + PLAN]) * NODES + node
        for k in range(m.length[body]):
            b = m.joints[body, k]
            m.q_box[m.q_index[b]] = m.node_q[at, m.q_index[b]]
            if k >= int(p[SHARED]):
                m.box_width[0, b] = m.node_size[at, b]


@kernel(inline=False)
def box_gap(
    box: int, node: int, pair: int, wanted: float, motion: int
) -> tuple[float, float, int, float]:
    """Bound a pair's distance over a box from its middle.

    Returns:
        Least distance that was measured, least distance over the box [m], the body
        whose joint it is worth most to halve, -1 if there is none, and the sign of the
        Δ of that joint which brings the sides together.
    """
    m = open_motion(motion)
    p = numba.carray(pointer(pair), (PAIR,), np.float64)
    rows = numba.carray(stack(32), (2, ROW_WIDTH), np.float64)
    witness = numba.carray(stack(10), (WITNESS_WIDTH,), np.float64)
    bodies = m.parent.shape[0]
    for j in range(m.q.shape[0]):
        m.q_node[j] = m.q_box[j]
    for b in range(bodies):
        if m.joint_kind[b] != NO_JOINT and m.gain[b, 0] != 0.0:
            m.q_node[m.q_index[b]] += m.box_middle[box, b] / m.gain[b, 0]
    forward_kinematics(
        m.q_node,
        m.parent,
        m.joint_kind,
        m.q_index,
        m.gain,
        m.T_parent_joint,
        m.axis,
        m.corner_T,
    )
    for b in range(bodies):
        write_axis(m.corner_T[b], m.axis[b], m.box_axes[b])
    for side in range(2):
        at = side * SIDE
        body = int(p[at + BODY])
        local = numba.carray(pointer(int(p[at + LOCAL])), (ROW_WIDTH,), np.float64)
        if body < 0:
            for k in range(ROW_WIDTH):
                rows[side, k] = local[k]
        else:
            place_row(int(p[at + KIND]), local, m.corner_T[body], rows[side])
    measure_by(
        m.calls[MEASURE], int(p[KIND]), rows[0], int(p[SIDE + KIND]), rows[1], witness
    )
    distance = witness[0]
    if not distance >= 0.0:
        return (distance, distance, -1, 1.0)
    n = (witness[7], witness[8], witness[9])
    gap = gap_over_box(box, pair, rows, n, m)
    if gap < wanted:
        there, n = nearest_position(
            node, box, pair, rows.ctypes.data, witness.ctypes.data, motion
        )
        distance = min(distance, there)
        if there >= wanted:
            gap = max(gap, gap_over_box(box, pair, rows, n, m))
    widest, nearer = widest_joint(box, pair, witness, m)
    return (distance, gap, widest, nearer)


@kernel
def gap_over_box(box: int, pair: int, rows: Floats, n: Vec3, m: Motion) -> float:
    """Least distance along a direction over a box [m]."""
    gap = 0.0
    for side in range(2):
        along = n if side == 0 else scaled(-1.0, n)
        gap -= box_side(box, side, pair, rows[side], along, m)
    return gap


@kernel(inline=False)
def box_side(box: int, side: int, pair: int, row: Floats, n: Vec3, m: Motion) -> float:
    """Greatest `n·p` of a side over a box [m]."""
    p = numba.carray(pointer(pair), (PAIR,), np.float64)
    at = side * SIDE
    body, first = int(p[at + BODY]), int(p[SHARED])
    count = 0 if body < 0 else int(m.length[body])
    kind = int(p[at + KIND])
    if count <= first:
        return float(side_reach(kind, row, n, 0.0, first, first, m.lever_rows))
    chain = m.joints[body]
    # The Δ of each joint is its width alone; the middles are in the poses.
    joint_rows(
        n,
        chain,
        first,
        count,
        m.box_axes,
        m.joint_kind,
        m.no_way,
        m.box_width[box],
        m.lever_rows,
    )
    reach = side_reach(kind, row, n, 0.0, first, count, m.lever_rows)
    own = numba.carray(pointer(int(p[at + LEVERS])), (m.joints.shape[1],), np.float64)
    return float(
        reach + curvature(chain, first, count, own, m.joint_kind, m.box_width[box])
    )


@kernel
def widest_joint(box: int, pair: int, witness: Floats, m: Motion) -> tuple[int, float]:
    """The joint that moves its side farthest within a box, and which way is nearer.

    Returns:
        Its body, -1 if no joint moves, and the sign of the Δ that brings the witness
        points together.
    """
    p = numba.carray(pointer(pair), (PAIR,), np.float64)
    most, which, nearer = 0.0, -1, 1.0
    for side in range(2):
        at = side * SIDE
        body = int(p[at + BODY])
        if body < 0:
            continue
        levers = numba.carray(
            pointer(int(p[at + LEVERS])), (m.joints.shape[1],), np.float64
        )
        n = (witness[7], witness[8], witness[9])
        n = n if side == 0 else scaled(-1.0, n)
        first = 1 + 3 * side
        point = (witness[first], witness[first + 1], witness[first + 2])
        for k in range(int(p[SHARED]), m.length[body]):
            b = m.joints[body, k]
            way = m.box_width[box, b] * levers[k]
            if way > most:
                most, which = way, int(b)
                g = dot(n, joint_way(point, b, m.box_axes[b], m))
                nearer = 1.0 if g >= 0.0 else -1.0
    return (which, nearer)
