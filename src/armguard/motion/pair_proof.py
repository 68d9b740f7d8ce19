"""Proof that two primitives keep a distance on the whole stop path.

First the whole path is bounded about the measured configuration, which needs only the
measured witness of the pair. If that does not suffice, the path is bisected in time: in
the middle of each interval the pair is placed and measured, and the interval is bounded
about that.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, scaled
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.box_proof import gap_along, prove_by_boxes
from armguard.motion.gap_bound import range_reach
from armguard.motion.pair_state import (
    NEEDED,
    PROVEN,
    SPENT,
    UNSURE,
    Pair,
    lever_of,
)
from armguard.motion.state import (
    NODES,
    WHOLE,
    Motion,
)
from armguard.motion.stop_path import make_node, span_of

Floats = NDArray[np.float64]

# An arm may use up the headroom that a proof returns. So an interval with less than
# LITTLE is bisected, down to a sixteenth of the path, if it may gain GAIN [m].
LITTLE = 2e-3
GAIN = 2e-4
SHORT = 16

# Interval that is the whole path.
WHOLE_PATH = 1

# Ratio of deviations and lines of its joints above which an interval is wide [-].
WIDE = 3.0


@kernel
def shared_joints(body_a: int, body_b: int, m: Motion) -> int:
    """Number of joints that move both sides alike."""
    if body_a < 0 or body_b < 0:
        return 0
    return int(m.shared[body_a, body_b])


@kernel(separate=True)
def path_gap(n: Vec3, p: Pair, m: Motion) -> float:
    """Lower bound of a pair's distance on the stop path, about its measured pose [m].

    Args:
        n: Unit normal from A to B as measured.
        p: The pair.
        m: The prediction.
    """
    gap = 0.0
    for side in range(2):
        along = n if side == 0 else scaled(-1.0, n)
        gap -= range_reach(side, along, p, m)
    return gap


@kernel(separate=True)
def prove_by_spans(known: float, p: Pair, m: Motion) -> tuple[int, float]:
    """Prove that a pair keeps a distance on the stop path, interval by interval.

    Args:
        known: Headroom that is proven already; minus infinity for none [m].
        p: The pair.
        m: The prediction.

    Returns:
        PROVEN, NEEDED, UNSURE or SPENT, and the least of distance minus requirement:
        a lower bound of the headroom if proven, else an estimate of the deficit [m].
    """
    # Intervals that wait, one on each level and one more, and their proven headroom.
    waiting = array_at(stack(16), (8, 2), np.float64)
    waiting[0, 0], waiting[0, 1] = WHOLE_PATH, known
    effort, left, least, tries_end = m.effort, 1, np.inf, True
    while left > 0:
        left -= 1
        node, before = int(waiting[left, 0]), waiting[left, 1]
        if effort.tests >= effort.budget:
            return (SPENT, -np.inf)
        effort.tests += 1
        wanted = need_until(node, p, m)
        distance, second_order, bend = span_gap(node, p, m)
        spare = second_order - bend - wanted
        # The headroom of the whole interval holds for its halves.
        spare = before if before > spare else spare
        # Only an interval with less than all others so far is worth it.
        if spare >= 0.0 and not (
            spare < min(LITTLE, least)
            and distance - wanted > spare + GAIN
            and node < SHORT
            and m.span.segment == 0
            and not is_wide(node, p, m)
        ):
            least = min(least, spare)
            continue
        shortest = not 2 * node < NODES
        if shortest and (spare != spare or m.span.segment != 0):
            return (NEEDED if not second_order >= wanted else UNSURE, spare)
        too_near = distance < wanted and not spare >= 0.0
        if shortest or (not spare >= 0.0 and is_wide(node, p, m)):
            # Halving time would leave as many problems as halves.
            proof, proven = prove_by_boxes(node, wanted, p, m)
            if proof == PROVEN:
                least = min(least, proven)
                continue
            too_near = proof == NEEDED
            if shortest or proof == SPENT:
                return (proof, proven)
        # The later half first: where a proof fails, it mostly fails there.
        for half in range(2):
            waiting[left + half, 0] = 2.0 * node + half
            waiting[left + half, 1] = spare if spare >= 0.0 else -np.inf
        left += 2
        if too_near and tries_end:
            tries_end = False
            proof, deficit = prove_end(node, p, m)
            if proof == NEEDED:
                return (proof, deficit)
    return (PROVEN, least)


@kernel
def need_until(node: int, p: Pair, m: Motion) -> float:
    """Distance that a pair has to keep until the end of an interval [m]."""
    _, end = span_of(node, m.span.horizon)
    if end >= m.span.horizon:
        # Until their swings have ended, moving bodies may still meet the arms.
        end = m.span.settled
    return float(p.need + p.drift * end)


@kernel
def prove_end(node: int, p: Pair, m: Motion) -> tuple[int, float]:
    """Prove that a pair keeps its distance in the last of the shortest intervals.

    A position of a long interval need not be admissible, one of a short interval is.
    Pairs that are too near are mostly so at the end.

    Args:
        node: A longer interval.
        p: The pair.
        m: The prediction.

    Returns:
        PROVEN, NEEDED, UNSURE or SPENT, and the headroom or deficit [m].
    """
    while 2 * node < NODES:
        node = 2 * node + 1
    wanted = need_until(node, p, m)
    m.effort.tests += 1
    _, second_order, bend = span_gap(node, p, m)
    if second_order - bend >= wanted:
        return (PROVEN, second_order - bend - wanted)
    return prove_by_boxes(node, wanted, p, m)


@kernel
def is_wide(node: int, p: Pair, m: Motion) -> bool:
    """Whether joint deviations move a pair over WIDE times as far as the lines do."""
    line = wide = 0.0
    for side in range(2):
        body, span = p.body[side], p.plan[side] * NODES + node
        for k in range(p.shared, m.length[body] if body >= 0 else 0):
            b = m.joints[body, k]
            line += abs(m.node_way[span, b]) * lever_of(side, k, p, m)
            wide += m.node_wide[span, b] * lever_of(side, k, p, m)
    return wide > WIDE * line


@kernel(separate=True)
def span_gap(node: int, p: Pair, m: Motion) -> Vec3:
    """Distance of a pair in the middle of an interval, and its least value over it.

    Args:
        node: The interval.
        p: The pair.
        m: The prediction.

    Returns:
        The distance in the middle, its least value to second order, and the bound on
        the terms of higher order [m].
    """
    rows = array_at(stack(32), (2, ROW_WIDTH), np.float64)
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    for side in range(2):
        plan, body = p.plan[side], p.body[side]
        if body < 0:
            for k in range(ROW_WIDTH):
                rows[side, k] = p.local[side, k]
            continue
        make_node(plan, node, m)
        T = m.node_T[(plan * NODES + node) * m.parent.shape[0] + body]
        place_row(p.kind[side], p.local[side], T, rows[side])
    measure(p.kind[0], rows[0], p.kind[1], rows[1], witness)
    if not witness[0] >= 0.0:
        return (witness[0], witness[0], 0.0)
    n = (witness[7], witness[8], witness[9])
    gap, bend, _ = gap_along(node, WHOLE, rows, n, p, m)
    return (witness[0], gap, bend)
