"""Where the joints of a span, or of a box, bring two primitives nearest.

A guess: the pair's witness points are held, their way is taken for linear in the
joints, and the length of their difference is made least, one joint after the other.
What is measured there is worth knowing either way. If it is nearer than it may be, the
stop is needed. If not, its normal is the direction along which a bound of the distance
over the whole span loses least: the distance of convex shapes over a box of shifts is
bounded exactly by the plane where it is least, and by no other.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer, stack
from armguard.geometry.pairs import measure_by
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, add, cross, dot, scaled, sub
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.pair_state import BODY, KIND, LOCAL, PAIR, PLAN, SHARED, SIDE
from armguard.motion.state import MEASURE, NODES, Motion, open_motion
from armguard.robot.kinematics import PRISMATIC, forward_kinematics

Floats = NDArray[np.float64]

# Places in a row of `Motion.columns`: how a variable moves the difference.
COLUMN_BOUND = 3  # it lies between minus and plus this
COLUMN_VALUE = 4
COLUMN_BODY = 5  # the body whose joint it is, -1 for the place on the span's line
COLUMN = 6

# How often each variable is set anew.
SWEEPS = 6

# A variable that moves nothing has no best value [m²].
NO_MOVE = 1e-18


@kernel(inline=False)
def nearest_position(
    node: int, box: int, pair: int, rows: int, witness: int, motion: int
) -> tuple[float, Vec3]:
    """Measure a pair where the joints of a span or a box bring it nearest.

    Args:
        node: The span.
        box: A box of it, or -1 for the span itself.
        pair: Address of the pair's description.
        rows: Address of both rows in the middle.
        witness: Address of the pair's witness there; apart.
        motion: Address of the ledger of the prediction.

    Returns:
        The pair's distance there [m], and its normal from A to B.
    """
    m = open_motion(motion)
    p = numba.carray(pointer(pair), (PAIR,), np.float64)
    count = write_columns(node, box, pair, rows, witness, m)
    middles_of(node, box, p, m)
    for c in range(count):
        move_joint(node, c, p, m)
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
    there = numba.carray(stack(32), (2, ROW_WIDTH), np.float64)
    found = numba.carray(stack(10), (WITNESS_WIDTH,), np.float64)
    for side in range(2):
        at = side * SIDE
        body = int(p[at + BODY])
        local = numba.carray(pointer(int(p[at + LOCAL])), (ROW_WIDTH,), np.float64)
        if body < 0:
            for k in range(ROW_WIDTH):
                there[side, k] = local[k]
        else:
            place_row(int(p[at + KIND]), local, m.corner_T[body], there[side])
    measure_by(
        m.calls[MEASURE], int(p[KIND]), there[0], int(p[SIDE + KIND]), there[1], found
    )
    return (found[0], (found[7], found[8], found[9]))


@kernel
def write_columns(
    node: int, box: int, pair: int, rows: int, witness: int, m: Motion
) -> int:
    """Write how each variable moves the difference of the witness points, and its best.

    Returns:
        How many variables there are.
    """
    p = numba.carray(pointer(pair), (PAIR,), np.float64)
    both = numba.carray(pointer(rows), (2, ROW_WIDTH), np.float64)
    seen = numba.carray(pointer(witness), (WITNESS_WIDTH,), np.float64)
    # A radius moves with its centre: only cores come together.
    least = seen[0] + both[0, 0] + both[1, 0]
    r = scaled(least, (seen[7], seen[8], seen[9]))
    line = (0.0, 0.0, 0.0)
    bodies = m.parent.shape[0]
    count = 0
    for side in range(2):
        at = side * SIDE
        body, span = int(p[at + BODY]), int(p[at + PLAN]) * NODES + node
        if body < 0:
            continue
        first = 1 + 3 * side
        point = (seen[first], seen[first + 1], seen[first + 2])
        for k in range(int(p[SHARED]), m.length[body]):
            b = m.joints[body, k]
            axis = m.box_axes[b] if box >= 0 else m.node_axes[span * bodies + b]
            way = joint_way(point, b, axis, m)
            if side == 0:
                way = scaled(-1.0, way)
            width = m.box_width[box, b] if box >= 0 else m.node_width[span, b]
            write_column(way, width, b, m.columns[count])
            count += 1
            if box < 0:
                line = add(line, scaled(m.node_way[span, b], way))
    if box < 0:
        write_column(line, 1.0, -1, m.columns[count])
        count += 1
    bring_together(r, count, m.columns)
    return count


@kernel
def write_column(way: Vec3, bound: float, body: int, column: Floats) -> None:
    """Write one variable."""
    column[0], column[1], column[2] = way
    column[COLUMN_BOUND] = bound
    column[COLUMN_VALUE] = 0.0
    column[COLUMN_BODY] = body


@kernel
def bring_together(r: Vec3, count: int, columns: Floats) -> None:
    """Make |r + Σ value · column| small, each value within its bound."""
    for _ in range(SWEEPS):
        for c in range(count):
            own = columns[c]
            way = (own[0], own[1], own[2])
            square = dot(way, way)
            if not square > NO_MOVE:
                continue
            bound, before = own[COLUMN_BOUND], own[COLUMN_VALUE]
            value = min(max(before - dot(way, r) / square, -bound), bound)
            own[COLUMN_VALUE] = value
            r = add(r, scaled(value - before, way))


@kernel
def middles_of(node: int, box: int, p: Floats, m: Motion) -> None:
    """Write the joint positions in the middle of a span or a box into `q_node`."""
    if box >= 0:
        for j in range(m.q.shape[0]):
            m.q_node[j] = m.q_box[j]
        for b in range(m.parent.shape[0]):
            if m.gain[b, 0] != 0.0 and m.box_middle[box, b] != 0.0:
                m.q_node[m.q_index[b]] += m.box_middle[box, b] / m.gain[b, 0]
        return
    for side in range(2):
        body = int(p[side * SIDE + BODY])
        if body < 0:
            continue
        span = int(p[side * SIDE + PLAN]) * NODES + node
        for k in range(m.length[body]):
            j = m.q_index[m.joints[body, k]]
            m.q_node[j] = m.node_q[span, j]


@kernel
def move_joint(node: int, c: int, p: Floats, m: Motion) -> None:
    """Move a joint in `q_node`, or for the place on the line all of them."""
    value, b = m.columns[c, COLUMN_VALUE], int(m.columns[c, COLUMN_BODY])
    if b >= 0:
        if m.gain[b, 0] != 0.0:
            m.q_node[m.q_index[b]] += value / m.gain[b, 0]
        return
    for side in range(2):
        body = int(p[side * SIDE + BODY])
        if body < 0:
            continue
        span = int(p[side * SIDE + PLAN]) * NODES + node
        for k in range(int(p[SHARED]), m.length[body]):
            b = m.joints[body, k]
            if m.gain[b, 0] != 0.0:
                m.q_node[m.q_index[b]] += value * m.node_way[span, b] / m.gain[b, 0]


@kernel
def joint_way(point: Vec3, b: int, axis: Floats, m: Motion) -> Vec3:
    """How a body's joint moves a point, by its own unit [m]."""
    direction = (axis[0], axis[1], axis[2])
    if m.joint_kind[b] == PRISMATIC:
        return direction
    return cross(direction, sub(point, (axis[3], axis[4], axis[5])))
