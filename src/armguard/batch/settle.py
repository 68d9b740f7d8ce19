"""Pairs of parts in eight configurations or spans: what their primitives decide."""

from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.batch.balls import SLACK
from armguard.batch.exact import exact_gap, is_refined, refined
from armguard.batch.gaps import has_lanes, lane_gap
from armguard.batch.plan import Plan
from armguard.batch.pose import CELLS, MOTIONS, NEAR, SPANS, Place, place
from armguard.batch.scratch import Scratch
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import (
    WIDTH,
    bits,
    either,
    item,
    least,
    load,
    lowest,
    most,
    size,
    some,
    splat,
    store,
)

Floats = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)

# A pair of primitives i < j is the number CODE · i + j, which a double holds.
SHIFT = 25
CODE = 1 << SHIFT

# `bits` of a mask that is true in every lane.
ALL = (1 << WIDTH) - 1


@kernel
def number(rows: Floats, i: int, k: int) -> Any:
    """Number k of row i, in lanes."""
    return load(rows, (i * ROW_WIDTH + k) * WIDTH)


@kernel
def growth_of(body: int, reach: float, slot: int, p: Plan, w: Place) -> Any:
    """How far a span may carry a point of a body, as seen from one of its carriers [m].

    Args:
        body: The body.
        reach: The point's distance from the body's middle [m].
        slot: Slot of the carrier.
        p: The plan.
        w: Where the spans are.
    """
    at = (body * (p.parent.shape[0] + 1) + slot) * WIDTH
    return load(w.shift, at) + load(w.swing, at) * reach


@kernel
def strict_buffer(k: int, p: Plan, s: Scratch, w: Place) -> float:
    """What distances of a pair of parts are compared with [m]."""
    return 0.0 if w.mode[0] == CELLS else p.buffers[k] * s.settings.strict


@kernel(inline=False)
def compare_parts(k: int, apart: Any, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs of primitives of two parts, in the lanes that are near.

    Args:
        k: The pair of parts.
        apart: 0, or minus infinity in lanes in which they are known to be apart: a
            growth of minus infinity.
        p: The plan.
        s: The scratch.
        w: Where the parts are.
    """
    a, b, slot = p.pairs[k, 0], p.pairs[k, 1], p.pairs[k, 2]
    moves = b < p.loose.shape[0]
    buffer = strict_buffer(k, p, s, w)
    first, end, ball = p.parts[a, 0], p.parts[a, 1], p.parts[a, 2]
    start, stop, other = p.parts[b, 0], p.parts[b, 1], p.parts[b, 2]
    hull, body_a, body_b = p.parts[b, 3], p.bodies[ball], p.bodies[other]
    if hull != other:
        growth = growth_of(body_a, p.sways[a, 0], slot, p, w) + (apart + SLACK)
        if moves:
            growth = growth + growth_of(body_b, p.sways[b, 1], slot, p, w)
        low = gap_of(ball, hull, p, w) - (growth + buffer)
        if not some(low < load(w.best, 0)):
            return
        apart = either(low < load(w.best, 0), apart, -inf)
    single = stop - start == 1
    near = item(p.ball, start) if single else other
    x, y, z = middle(near, 0, p, w), middle(near, 1, p, w), middle(near, 2, p, w)
    radius = item(p.rows, near * ROW_WIDTH) + (buffer + SLACK)
    if moves:
        apart = apart + growth_of(body_b, p.sways[b, int(single)], slot, p, w)
    count = 0
    for i in range(first, end):
        growth = growth_of(body_a, item(p.spread, i), slot, p, w) + apart
        close = near_point(item(p.ball, i), x, y, z, growth + radius, p, w)
        w.close[count] = i
        store(w.growth, count * WIDTH, either(close, growth, -inf))
        count += int(some(close))
    for at in range(count):
        growth = load(w.growth, at * WIDTH)
        if single:
            settle(w.close[at], start, buffer, growth, 1, p, s, w)
        else:
            compare_one(w.close[at], k, growth, p, s, w)


@kernel(inline=False)
def compare_one(i: int, k: int, growth: Any, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs of a primitive with those of a part.

    Args:
        i: The primitive.
        k: The pair of parts; the second has several primitives.
        growth: How far a span may carry both the primitive and the part's ball [m].
        p: The plan.
        s: The scratch.
        w: Where they are.
    """
    b, slot, buffer = p.pairs[k, 1], p.pairs[k, 2], strict_buffer(k, p, s, w)
    one, other = item(p.ball, i), p.parts[b, 2]
    x, y, z = middle(one, 0, p, w), middle(one, 1, p, w), middle(one, 2, p, w)
    radius = item(p.rows, one * ROW_WIDTH) + (buffer + SLACK)
    swing = splat(0.0)
    if b < p.loose.shape[0]:
        at = (p.bodies[other] * (p.parent.shape[0] + 1) + slot) * WIDTH
        swing = load(w.swing, at)
    known = p.sways[b, 0] if b < p.loose.shape[0] else 0.0
    for j in range(p.parts[b, 0], p.parts[b, 1]):
        both = growth + swing * (item(p.spread, j) - known)
        close = near_point(item(p.ball, j), x, y, z, both + radius, p, w)
        if some(close):
            settle(i, j, buffer, either(close, both, -inf), 1, p, s, w)


@kernel
def middle(i: int, r: int, p: Plan, w: Place) -> Any:
    """One coordinate of a ball's middle in the world [m]."""
    body, at = item(p.bodies, i), i * ROW_WIDTH + 1
    if body < 0:
        return splat(item(p.rows, at + r))
    T = (body * 12 + 4 * r) * WIDTH
    return (
        load(w.T, T) * item(p.rows, at)
        + load(w.T, T + WIDTH) * item(p.rows, at + 1)
        + load(w.T, T + 2 * WIDTH) * item(p.rows, at + 2)
        + load(w.T, T + 3 * WIDTH)
    )


@kernel
def near_point(i: int, x: Any, y: Any, z: Any, reach: Any, p: Plan, w: Place) -> Any:
    """In which lanes a ball, grown by a reach, may matter beside a point."""
    u = middle(i, 0, p, w) - x
    v = middle(i, 1, p, w) - y
    t = middle(i, 2, p, w) - z
    far = reach + item(p.rows, i * ROW_WIDTH) + load(w.best, 0)
    return far * size(far) > u * u + v * v + t * t


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
    below. In cells the least distance becomes one that it may not lie below.

    Where distances count above buffers, the exact shapes of two links decide if their
    primitives are too near.
    """
    if not has_lanes(min(p.kinds[i], p.kinds[j]), max(p.kinds[i], p.kinds[j])):
        settle_by_bound(i, j, buffer, growth, keep, p, s, w)
        return
    gap, best = gap_of(i, j, p, w) - buffer, load(w.best, 0)
    exact = s.settings.strict == 1 and is_refined(i, j, p)
    if w.mode[0] == MOTIONS:
        if exact:
            gap = refined(i, j, buffer, gap, growth + SLACK, p, s, w)
        refuse(gap - (growth + SLACK) >= best, gap, w)
        return
    if w.mode[0] == CELLS:
        store(w.best, 0, least(gap - (growth + SLACK), best))
        return
    code = float(min(i, j) * CODE + max(i, j))
    if w.mode[0] == SPANS or w.mode[0] == NEAR:
        growth = growth + SLACK
        low = gap - growth
        if keep == 1:
            keep_pair(i, j, buffer, low, best, s, w)
        # Exact shapes may be farther apart: no upper bound of the distance is known.
        if w.mode[0] == NEAR or exact:
            return
        gap = gap + growth
        nearer = (gap < best) & (low < best)
    else:
        if exact:
            gap = refined(i, j, buffer, gap, growth, p, s, w)
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
    if w.mode[0] == CELLS:
        store(w.best, 0, least(low, best))
        return
    left = bits(low < best)
    if left == 0:
        return
    exact = s.settings.strict == 1 and is_refined(i, j, p)
    place(i, p, w)
    place(j, p, w)
    store(w.bound, 0, growth + SLACK)
    while left != 0:
        lane = lowest(left)
        left &= left - 1
        gap = gap_in_lane(i, j, lane, p, s, w) - buffer
        best_here, pair = w.best[lane], w.pair[lane]
        margin = w.bound[lane] if w.mode[0] == MOTIONS else 0.0
        if exact and not gap - margin >= min(best_here, 0.0):
            gap = max(gap, exact_gap(i, j, lane, p, s, w) - buffer)
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
