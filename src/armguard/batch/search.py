"""Pairs of eight configurations, or of eight spans: which may matter, and how near."""

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.batch.gaps import has_lanes, lane_gap
from armguard.batch.plan import SLACK, Plan
from armguard.batch.pose import MOTIONS, NEAR, SPANS, Place, place
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import (
    WIDTH,
    bits,
    either,
    load,
    lowest,
    most,
    size,
    some,
    splat,
    store,
)
from armguard.record import record
from armguard.table import IntMatrix, LongVector, Matrix, Vector, table

Floats = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)

# Pairs that are kept of one span at most; a span with more is searched row by row.
ROOM = 512

# A pair of primitives i < j is the number CODE · i + j, which a double holds.
SHIFT = 25
CODE = 1 << SHIFT

# `bits` of a mask that is true in every lane.
ALL = (1 << WIDTH) - 1


@record
class SearchSettings:
    """What a search looks for.

    Attributes:
        margin: Distances from this on are left out [m].
        strict: 1 if distances count above the pair's buffer.
        drop: Infinite where one pair decides a configuration, else 0 [m].
        limit: Greatest joint position [rad or m].
    """

    margin: float
    strict: int
    drop: float
    limit: float


@table
class Scratch(NamedTuple):
    """What one call writes beside its places.

    Attributes:
        settings: What is searched for.
        block: Joint positions of the rows of eight spans, and eight numbers more,
            shape (256 · n + 8,).
        sides: Middle, half width and sum of magnitudes, of eight joints, (24,).
        kept: Pairs that are kept of each span; -1: search its rows, shape (8,).
        pairs: Primitives of those pairs, shape (8 · room, 2).
        low: Least distance they may have in a row, and their buffer, (8 · room, 2) [m].
        single: Rows of a pair in one configuration, and its witness, shape (3, 16).
    """

    settings: SearchSettings
    block: Vector
    sides: Vector
    kept: LongVector
    pairs: IntMatrix
    low: Matrix
    single: Matrix


@kernel(inline=False)
def search(p: Plan, s: Scratch, w: Place) -> None:
    """Settle every pair that may matter: balls of parts, then their primitives.

    What a lane finds does not depend on the others: a pair is settled only in those
    lanes in which no ball has shown it apart.
    """
    if w.mode[0] != MOTIONS:
        try_leads(p, s, w)
    for a in range(p.own.shape[0]):
        if not some(load(w.best, 0) > -inf):
            return
        place(p.parts[a, 2], p, w)
        search_own(a, p, s, w)
        search_standing(a, p, s, w)


@kernel
def search_own(a: int, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs of a part with others that move."""
    slots, strict, ball = p.parent.shape[0] + 1, s.settings.strict, p.parts[a, 2]
    for k in range(p.own[a, 0], p.own[a, 1]):
        b, slot = p.pairs[k, 1], p.pairs[k, 2]
        other = p.parts[b, 2]
        place(other, p, w)
        reach = p.rows[ball, 0] + p.rows[other, 0] + (p.buffers[k] * strict + SLACK)
        reach = load(w.shift, (a * slots + slot) * WIDTH) + (
            load(w.shift, (b * slots + slot) * WIDTH) + (load(w.best, 0) + reach)
        )
        x = number(w.rows, ball, 1) - number(w.rows, other, 1)
        y = number(w.rows, ball, 2) - number(w.rows, other, 2)
        z = number(w.rows, ball, 3) - number(w.rows, other, 3)
        near = reach * size(reach) > x * x + y * y + z * z
        if some(near):
            compare_parts(k, near, p, s, w)


@kernel
def search_standing(a: int, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs of a part with what does not move."""
    slots, strict, ball = p.parent.shape[0] + 1, s.settings.strict, p.parts[a, 2]
    u, v = number(w.rows, ball, 1), number(w.rows, ball, 2)
    t = number(w.rows, ball, 3)
    own = p.rows[ball, 0] + p.loose[a] * strict + SLACK
    reach = load(w.shift, a * slots * WIDTH) + (load(w.best, 0) + own)
    at = 0
    while at < p.nodes.shape[0]:
        x, y, z = u - p.nodes[at, 0], v - p.nodes[at, 1], t - p.nodes[at, 2]
        far = reach + p.nodes[at, 3]
        near = far * size(far) > x * x + y * y + z * z
        if not some(near):
            at = p.links[at, 0]
            continue
        b = p.links[at, 1]
        at += 1
        if b >= 0 and p.pair_at[a, b] >= 0:
            compare_parts(p.pair_at[a, b], near, p, s, w)
            reach = load(w.shift, a * slots * WIDTH) + (load(w.best, 0) + own)


@kernel
def number(rows: Floats, i: int, k: int) -> Any:
    """Number k of row i, in lanes."""
    return load(rows, (i * ROW_WIDTH + k) * WIDTH)


@kernel(inline=False)
def try_leads(p: Plan, s: Scratch, w: Place) -> None:
    """Begin with the pairs that decided last."""
    slots = p.parent.shape[0] + 1
    last = -1.0
    for lane in range(WIDTH):
        code = w.lead[lane]
        if code < 0.0 or code == last:
            continue
        last = code
        i, j = int(code) >> SHIFT, int(code) & (CODE - 1)
        a, b = p.part[i], p.part[j]
        k = p.pair_at[a, b]
        growth = growth_of(a, i, p.pairs[k, 2], slots, p, w)
        if b < p.own.shape[0]:
            growth = growth + growth_of(b, j, p.pairs[k, 2], slots, p, w)
        settle(i, j, p.buffers[k] * s.settings.strict, growth, 0, p, s, w)


@kernel
def growth_of(part: int, i: int, slot: int, slots: int, p: Plan, w: Place) -> Any:
    """How far a span may carry a primitive, as seen from a carrier of its part [m]."""
    at = (part * slots + slot) * WIDTH
    return load(w.shift, at) + load(w.swing, at) * p.spread[i]


@kernel(inline=False)
def compare_parts(k: int, near: Any, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs of primitives of two parts, in the lanes that are near.

    A growth of minus infinity marks a lane in which a pair is known to be apart.
    """
    a, b, slot = p.pairs[k, 0], p.pairs[k, 1], p.pairs[k, 2]
    slots = p.parent.shape[0] + 1
    moves = b < p.own.shape[0]
    buffer = p.buffers[k] * s.settings.strict
    shift = either(near, splat(0.0), -inf)
    if moves:
        shift = shift + load(w.shift, (b * slots + slot) * WIDTH)
    hull, other = p.parts[b, 3], p.parts[b, 2]
    if hull != other:
        ball = p.parts[a, 2]
        growth = load(w.shift, (a * slots + slot) * WIDTH) + (shift + SLACK)
        low = gap_of(ball, hull, p, w) - (growth + buffer)
        if not some(low < load(w.best, 0)):
            return
        shift = either(low < load(w.best, 0), shift, -inf)
    several = p.parts[b, 1] - p.parts[b, 0] > 1
    for i in range(p.parts[a, 0], p.parts[a, 1]):
        growth = growth_of(a, i, slot, slots, p, w) + shift
        if several:
            close = near_ball(i, other, growth, buffer, p, w)
            if not some(close):
                continue
            growth = either(close, growth, -inf)
        for j in range(p.parts[b, 0], p.parts[b, 1]):
            both = growth
            if moves:
                swing = load(w.swing, (b * slots + slot) * WIDTH)
                both = growth + swing * p.spread[j]
            settle(i, j, buffer, both, 1, p, s, w)


@kernel
def near_ball(i: int, j: int, growth: Any, buffer: float, p: Plan, w: Place) -> Any:
    """In which lanes the ball of a primitive that moves may matter beside another."""
    i = p.ball[i]
    place(i, p, w)
    reach = growth + (p.rows[i, 0] + p.rows[j, 0] + buffer + SLACK) + load(w.best, 0)
    if p.bodies[j] < 0:
        u = number(w.rows, i, 1) - p.rows[j, 1]
        v = number(w.rows, i, 2) - p.rows[j, 2]
        t = number(w.rows, i, 3) - p.rows[j, 3]
    else:
        place(j, p, w)
        u = number(w.rows, i, 1) - number(w.rows, j, 1)
        v = number(w.rows, i, 2) - number(w.rows, j, 2)
        t = number(w.rows, i, 3) - number(w.rows, j, 3)
    return reach * size(reach) > u * u + v * v + t * t


@kernel(inline=False)
def gap_of(i: int, j: int, p: Plan, w: Place) -> Any:
    """Signed distances of two rows of kinds with `has_lanes`, in any order [m]."""
    if p.kinds[i] > p.kinds[j]:
        i, j = j, i
    kind_i, kind_j = p.kinds[i], p.kinds[j]
    place(i, p, w)
    place(j, p, w)
    if p.bodies[i] < 0:
        return lane_gap(kind_i, i, p.rows, kind_j, j, w.rows)
    if p.bodies[j] < 0:
        return lane_gap(kind_i, i, w.rows, kind_j, j, p.rows)
    return lane_gap(kind_i, i, w.rows, kind_j, j, w.rows)


@kernel(inline=False)
def settle(
    i: int, j: int, buffer: float, growth: Any, keep: int, p: Plan, s: Scratch, w: Place
) -> None:
    """Let a pair of primitives decide what it may.

    In rows it lowers the least distance. In spans of rows it lowers the number that no
    row's least distance exceeds, and the pair is kept for those spans in which it may
    lie below; not where `keep` is 0. In mode NEAR it is kept for the rows in which it
    may be nearer than the margin. A span of a motion is not proven if the pair may lie
    below.
    """
    if not has_lanes(min(p.kinds[i], p.kinds[j]), max(p.kinds[i], p.kinds[j])):
        settle_by_bound(i, j, buffer, growth, keep, p, s, w)
        return
    gap, best = gap_of(i, j, p, w) - buffer, load(w.best, 0)
    if w.mode[0] == MOTIONS:
        refuse(gap - (growth + SLACK) >= best, gap, w)
        return
    code = float(min(i, j) * CODE + max(i, j))
    if w.mode[0] == SPANS or w.mode[0] == NEAR:
        growth = growth + SLACK
        low = gap - growth
        if keep == 1:
            keep_pair(i, j, buffer, low, best, s, w)
        if w.mode[0] == NEAR:
            return
        gap = gap + growth
        nearer = (gap < best) & (low < best)
    else:
        pair = load(w.pair, 0)
        nearer = (gap < best) | ((gap == best) & (splat(code) < pair))
    if some(nearer):
        store(w.best, 0, either(nearer, gap - s.settings.drop, best))
        store(w.pair, 0, either(nearer, splat(code), load(w.pair, 0)))


@kernel
def refuse(proven: Any, gap: Any, w: Place) -> None:
    """Mark the spans of motions in which a pair is not proven."""
    if bits(proven) == ALL:
        return
    store(w.best, 0, either(proven, load(w.best, 0), -inf))
    failed = either(proven, splat(0.0), gap) < 0.0
    store(w.pair, 0, either(failed, splat(-2.0), load(w.pair, 0)))


@kernel
def keep_pair(
    i: int, j: int, buffer: float, low: Any, best: Any, s: Scratch, w: Place
) -> None:
    """Keep a pair for the spans in which it may matter."""
    left = bits(low < best)
    if left == 0:
        return
    store(w.bound, 0, low)
    while left != 0:
        lane = lowest(left)
        left &= left - 1
        count, room = s.kept[lane], s.low.shape[0] // WIDTH
        if count == room:
            s.kept[lane] = -1
            w.best[lane] = -inf
            continue
        at = lane * room + count
        s.pairs[at, 0], s.pairs[at, 1] = i, j
        s.low[at, 0], s.low[at, 1] = w.bound[lane], buffer
        s.kept[lane] = count + 1


@kernel(inline=False)
def settle_by_bound(
    i: int, j: int, buffer: float, growth: Any, keep: int, p: Plan, s: Scratch, w: Place
) -> None:
    """The same for a pair without a formula in lanes."""
    code = float(min(i, j) * CODE + max(i, j))
    low = most(gap_of(p.ball[i], p.hull[j], p, w), gap_of(p.ball[j], p.hull[i], p, w))
    low, best = low - (growth + (buffer + SLACK)), load(w.best, 0)
    if w.mode[0] == SPANS or w.mode[0] == NEAR:
        if keep == 1:
            keep_pair(i, j, buffer, low, best, s, w)
        return
    left = bits(low < best)
    if left == 0:
        return
    place(i, p, w)
    place(j, p, w)
    store(w.bound, 0, growth + SLACK)
    while left != 0:
        lane = lowest(left)
        left &= left - 1
        gap = gap_in_lane(i, j, lane, p, s, w) - buffer
        best_here, pair = w.best[lane], w.pair[lane]
        if w.mode[0] == MOTIONS:
            if not gap - w.bound[lane] >= best_here:
                w.best[lane] = -inf
                w.pair[lane] = -2.0 if gap < 0.0 else pair
        elif not (gap > best_here or (gap == best_here and pair <= code)):
            w.best[lane] = gap - s.settings.drop
            w.pair[lane] = code


@kernel
def gap_in_lane(i: int, j: int, lane: int, p: Plan, s: Scratch, w: Place) -> float:
    """Signed distance of two primitives in one configuration [m]."""
    if p.kinds[i] > p.kinds[j]:
        i, j = j, i
    for side, row in enumerate((i, j)):
        for k in range(ROW_WIDTH):
            s.single[side, k] = p.rows[row, k]
            if p.bodies[row] >= 0:
                s.single[side, k] = w.rows[(row * ROW_WIDTH + k) * WIDTH + lane]
    measure(p.kinds[i], s.single[0], p.kinds[j], s.single[1], s.single[2])
    return float(s.single[2, 0])
