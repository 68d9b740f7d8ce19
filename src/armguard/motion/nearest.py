"""Estimate of the joint positions in an interval at which two primitives are nearest.

The pair's witness points are fixed, their motion is linearised in the joints, and the
length of their difference is minimised by coordinate descent. The pair is measured at
the result. If it is too near, the stop is needed: all joints can be there at the same
time. If not, its normal is the best direction for a bound over the whole interval: the
distance of convex shapes over a box of shifts is bounded exactly by the plane where it
is least, and by no other.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, add, cross, dot, scaled, sub
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.pair_state import Pair
from armguard.motion.state import NODES, WHOLE, Motion
from armguard.motion.stop_path import write_axis
from armguard.robot.kinematics import PRISMATIC, place_body
from armguard.table import Matrix, Vector

Floats = NDArray[np.float64]

# Sweeps of the coordinate descent.
SWEEPS = 6

# Squared motion below which a variable keeps its value [m²].
NO_MOVE = 1e-18


@kernel(separate=True)
def nearest_position(
    node: int, box: int, rows: Matrix, witness: Vector, p: Pair, m: Motion
) -> tuple[float, Vec3]:
    """Measure a pair at the estimated nearest joint positions of a box.

    Args:
        node: The interval.
        box: Box of the interval.
        rows: Both rows in the middle of the box.
        witness: Witness of the pair in the middle of the box; not overlapping.
        p: The pair.
        m: The prediction.

    Returns:
        The pair's distance there [m], and its normal from A to B.
    """
    there = array_at(stack(32), (2, ROW_WIDTH), np.float64)
    found = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    count = write_columns(node, box, witness, p, m)
    u = bring_together(box, count, rows, witness, m)
    start_positions(node, p, m)
    count = 0
    for side in range(2):
        body, span = p.body[side], p.plan[side]
        span = span * NODES + node
        for k in range(p.shared, m.length[body] if body >= 0 else 0):
            b = m.joints[body, k]
            move_joint(b, span, u, m.columns[count].place, m)
            count += 1
    place_pair(p, m, there)
    measure(p.kind[0], there[0], p.kind[1], there[1], found)
    return (found[0], (found[7], found[8], found[9]))


@kernel(separate=True)
def middle_position(node: int, box: int, p: Pair, m: Motion, rows: Matrix) -> None:
    """Place a pair in the middle of a box, and write its joints' axes there.

    Args:
        node: The interval.
        box: Box of the interval.
        p: The pair.
        m: The prediction.
        rows: Both rows in the world, overwritten.
    """
    start_positions(node, p, m)
    for side in range(2):
        body, span = p.body[side], p.plan[side]
        span = span * NODES + node
        for k in range(p.shared, m.length[body] if body >= 0 else 0):
            b = m.joints[body, k]
            move_joint(b, span, m.box_line[box].middle, m.box_place[box, b], m)
    place_pair(p, m, rows)
    for side in range(2):
        body = p.body[side]
        for k in range(p.shared, m.length[body] if body >= 0 else 0):
            b = m.joints[body, k]
            write_axis(m.corner_T[b], m.axis[b], m.box_axes[b])


@kernel
def start_positions(node: int, p: Pair, m: Motion) -> None:
    """Write the joint positions in the middle of a pair's interval into `q_node`."""
    for side in range(2):
        body, span = p.body[side], p.plan[side]
        for k in range(m.length[body] if body >= 0 else 0):
            j = m.q_index[m.joints[body, k]]
            m.q_node[j] = m.node_q[span * NODES + node, j]


@kernel
def move_joint(b: int, span: int, u: float, s: float, m: Motion) -> None:
    """Move a body's joint in `q_node` along its line and by its deviation."""
    if m.gain[b, 0] != 0.0:
        width = m.node_wide[span, b] + u * m.node_grow[span, b]
        m.q_node[m.q_index[b]] += (u * m.node_way[span, b] + s * width) / m.gain[b, 0]


@kernel
def place_pair(p: Pair, m: Motion, rows: Matrix) -> None:
    """Place both sides of a pair at the joint positions in `q_node`."""
    for side in range(2):
        body = p.body[side]
        if body < 0:
            for k in range(ROW_WIDTH):
                rows[side, k] = p.local[side, k]
        else:
            place_chain(body, 0 if side == 0 else p.shared, m)
            place_row(p.kind[side], p.local[side], m.corner_T[body], rows[side])


@kernel
def place_chain(body: int, first: int, m: Motion) -> None:
    """Place the bodies of a chain at the joint positions in `q_node`.

    Args:
        body: The last body of the chain.
        first: First joint whose body is not placed yet; 0 if the root is not either.
        m: The prediction; its `corner_T` is written.
    """
    count = int(m.length[body])
    if first == 0:
        lowest = m.joints[body, 0] if count > 0 else body
        place_at(int(m.parent[lowest]), 0.0, m)
    for k in range(first, count):
        b = int(m.joints[body, k])
        place_at(b, m.gain[b, 0] * m.q_node[m.q_index[b]] + m.gain[b, 1], m)
    if count == 0 or m.joints[body, count - 1] != body:
        # A root, or an object that a gripper holds: no joint moves it on its parent.
        place_at(body, 0.0, m)


@kernel
def place_at(body: int, position: float, m: Motion) -> None:
    """Place a body, whose parent is placed, at a position of its joint; -1 is none."""
    if body >= 0:
        place_body(
            body, position, m.parent, m.joint_kind, m.T_parent_joint, m.axis, m.corner_T
        )


@kernel
def write_columns(node: int, box: int, seen: Vector, p: Pair, m: Motion) -> int:
    """Write the derivative of the witness points' difference by each joint.

    Returns:
        Number of joints.
    """
    bodies = m.parent.shape[0]
    count = 0
    for side in range(2):
        body, span = p.body[side], p.plan[side]
        span = span * NODES + node
        first = 1 + 3 * side
        point = (seen[first], seen[first + 1], seen[first + 2])
        for k in range(p.shared, m.length[body] if body >= 0 else 0):
            b = m.joints[body, k]
            own = m.columns[count]
            axis = m.node_axes[span * bodies + b] if box == WHOLE else m.box_axes[b]
            way = joint_way(point, b, axis, m)
            d = own.derivative
            d[0], d[1], d[2] = way if side == 1 else scaled(-1.0, way)
            own.half_line = m.node_way[span, b]
            own.width, own.growth = m.node_wide[span, b], m.node_grow[span, b]
            own.place = m.box_place[box, b]
            own.least = own.place - m.box_part[box, b]
            own.most = own.place + m.box_part[box, b]
            count += 1
    return count


@kernel
def bring_together(
    box: int, count: int, rows: Matrix, seen: Vector, m: Motion
) -> float:
    """Minimise the difference of the witness points over the joints of a box.

    Returns:
        Place on the interval's line; the place of each joint is in its column.
    """
    # A radius moves with its centre: only the distance of the cores shrinks.
    apart = seen[0] + rows[0, 0] + rows[1, 0]
    r = scaled(apart, (seen[7], seen[8], seen[9]))
    u, half = m.box_line[box].middle, m.box_line[box].half
    first, last = u - half, u + half
    for _ in range(SWEEPS):
        line = (0.0, 0.0, 0.0)
        for c in range(count):
            own = m.columns[c]
            step, d = own.half_line + own.place * own.growth, own.derivative
            line = add(line, scaled(step, (d[0], d[1], d[2])))
        square = dot(line, line)
        if square > NO_MOVE:
            to = min(max(u - dot(line, r) / square, first), last)
            r = add(r, scaled(to - u, line))
            u = to
        for c in range(count):
            own, d = m.columns[c], m.columns[c].derivative
            way = scaled(own.width + u * own.growth, (d[0], d[1], d[2]))
            square = dot(way, way)
            if square > NO_MOVE:
                before = own.place
                to = min(max(before - dot(way, r) / square, own.least), own.most)
                own.place = to
                r = add(r, scaled(to - before, way))
    return float(u)


@kernel
def joint_way(point: Vec3, b: int, axis: Floats, m: Motion) -> Vec3:
    """Derivative of a point's position by a body's joint, in the world [m/rad]."""
    direction = (axis[0], axis[1], axis[2])
    if m.joint_kind[b] == PRISMATIC:
        return direction
    return cross(direction, sub(point, (axis[3], axis[4], axis[5])))
