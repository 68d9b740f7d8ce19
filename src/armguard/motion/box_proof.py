"""Last stage of a proof: bisection of an interval's box of joint positions.

In a short interval a pair mostly stays unproven because joints may deviate from their
lines: the guard does not know how hard stops will be. The box of these positions is
halved along its most important dimension, a joint's deviation or the line that all
joints share. In each half the pair is measured in the middle and where it is nearest.
All joints can be there at the same time; if the pair is too near there, the stop is
needed.
"""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, dot, scaled
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.gap_bound import line_reach
from armguard.motion.nearest import joint_way, middle_position, nearest_position
from armguard.motion.pair_state import (
    NEEDED,
    PROVEN,
    SPENT,
    UNSURE,
    Pair,
    lever_of,
)
from armguard.motion.state import (
    BOX_LEVELS,
    NODES,
    Motion,
)
from armguard.table import Matrix

Floats = NDArray[np.float64]

# Cost of a box in intervals, which share their kinematics [-].
BOX_COST = 3

# Greatest number of boxes for one interval of one pair [-].
MOST_BOXES = 48

# Dimension along which a box is halved, if it is not a body's joint.
NOTHING = -1
LINE = -2


@kernel(separate=True)
def prove_by_boxes(node: int, wanted: float, p: Pair, m: Motion) -> tuple[int, float]:
    """Prove that a pair keeps a distance for all joint positions of an interval.

    Args:
        node: The interval.
        wanted: Distance to keep [m].
        p: The pair.
        m: The prediction.

    Returns:
        PROVEN, NEEDED, UNSURE or SPENT, and the headroom or deficit [m].
    """
    effort, line = m.effort, m.box_line[0]
    line.middle, line.half = 0.0, 1.0
    for b in range(m.parent.shape[0]):
        m.box_place[0, b], m.box_part[0, b] = 0.0, 1.0
    left = 1
    boxes = 0
    least = inf
    while left > 0:
        left -= 1
        if effort.tests >= effort.budget:
            return (SPENT, -inf)
        effort.tests += BOX_COST
        boxes += 1
        distance, gap, along, nearer = box_gap(left, node, wanted, p, m)
        if not distance >= wanted:
            return (NEEDED, distance - wanted)
        if gap >= wanted:
            least = min(least, gap - wanted)
            continue
        if left + 2 > BOX_LEVELS or boxes >= MOST_BOXES or along == NOTHING:
            return (UNSURE, gap - wanted)
        halve(left, along, nearer, m)
        left += 2
    return (PROVEN, least)


@kernel
def halve(box: int, along: int, nearer: float, m: Motion) -> None:
    """Halve a box; the half in which the pair is nearer takes the next place."""
    line, other = m.box_line[box], m.box_line[box + 1]
    other.middle, other.half = line.middle, line.half
    for b in range(m.parent.shape[0]):
        m.box_place[box + 1, b] = m.box_place[box, b]
        m.box_part[box + 1, b] = m.box_part[box, b]
    if along == LINE:
        half = 0.5 * line.half
        line.half = other.half = half
        line.middle -= nearer * half
        other.middle += nearer * half
    else:
        half = 0.5 * m.box_part[box, along]
        m.box_part[box, along] = m.box_part[box + 1, along] = half
        m.box_place[box, along] -= nearer * half
        m.box_place[box + 1, along] += nearer * half


@kernel(separate=True)
def box_gap(
    box: int, node: int, wanted: float, p: Pair, m: Motion
) -> tuple[float, float, int, float]:
    """Bound a pair's distance over a box.

    Returns:
        Least measured distance, lower bound over the box [m], best dimension to halve:
        LINE, a body or NOTHING, and the direction of it in which the pair is nearer.
    """
    rows = array_at(stack(32), (2, ROW_WIDTH), np.float64)
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    middle_position(node, box, p, m, rows)
    measure(p.kind[0], rows[0], p.kind[1], rows[1], witness)
    distance = witness[0]
    if not distance >= 0.0:
        return (distance, distance, NOTHING, 1.0)
    n = (witness[7], witness[8], witness[9])
    second_order, bend, end = gap_along(node, box, rows, n, p, m)
    gap = second_order - bend
    if gap < wanted:
        there, n = nearest_position(node, box, rows, witness, p, m)
        distance = min(distance, there)
        if there >= wanted:
            second_order, bend, _ = gap_along(node, box, rows, n, p, m)
            gap = max(gap, second_order - bend)
    along, nearer = longest_way(node, box, witness, end, p, m)
    return (distance, gap, along, nearer)


@kernel(separate=True)
def gap_along(
    node: int, box: int, rows: Matrix, n: Vec3, p: Pair, m: Motion
) -> tuple[float, float, float]:
    """Least distance along a direction over a box of an interval, to second order.

    Args:
        node: The interval.
        box: Box of the interval.
        rows: Both rows in the middle of the box.
        n: Unit direction from A to B; any gives a lower bound of the distance.
        p: The pair.
        m: The prediction.

    Returns:
        The least distance, the bound on the terms of higher order [m], and the end of
        the line at which the distance is least, -1 or 1.
    """
    gap_one = gap_other = bend = 0.0
    for side in range(2):
        along = n if side == 0 else scaled(-1.0, n)
        one, other, curved = line_reach(side, node, box, rows, along, p, m)
        gap_one -= one
        gap_other -= other
        bend += curved
    # Both sides are at the same place of their lines. Between the two ends the gap is
    # a concave function of it except for the curvature along the line, which counts in
    # full wherever it reduces the gap.
    if gap_one < gap_other:
        return (gap_one, bend, -1.0)
    return (gap_other, bend, 1.0)


@kernel
def longest_way(
    node: int, box: int, witness: Floats, end: float, p: Pair, m: Motion
) -> tuple[int, float]:
    """Dimension of a box that moves a pair farthest, and its closing direction.

    Returns:
        LINE, the body of a joint, or NOTHING; and the direction in which the witness
        points approach each other.
    """
    u, half = m.box_line[box].middle, m.box_line[box].half
    most, which, nearer = 0.0, NOTHING, 1.0
    line = 0.0
    for side in range(2):
        body, span = p.body[side], p.plan[side] * NODES + node
        if body < 0:
            continue
        n = (witness[7], witness[8], witness[9])
        n = n if side == 0 else scaled(-1.0, n)
        first = 1 + 3 * side
        point = (witness[first], witness[first + 1], witness[first + 2])
        for k in range(p.shared, m.length[body]):
            b = m.joints[body, k]
            line += half * abs(m.node_way[span, b]) * lever_of(side, k, p, m)
            width = m.node_wide[span, b] + u * m.node_grow[span, b]
            way = m.box_part[box, b] * width * lever_of(side, k, p, m)
            if way > most:
                most, which = way, int(b)
                g = dot(n, joint_way(point, b, m.box_axes[b], m))
                nearer = 1.0 if g >= 0.0 else -1.0
    if line > most:
        return (LINE, end)
    return (which, nearer)
