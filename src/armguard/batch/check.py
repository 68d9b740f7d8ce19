"""Least signed distances of the rows of a batch: spans first, then rows."""

from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from armguard.batch.balls import SLACK
from armguard.batch.plan import Plan
from armguard.batch.pose import Place, move_bodies, spread, widen
from armguard.batch.scratch import Scratch
from armguard.batch.search import search
from armguard.batch.settle import middle, near_point, settle
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import (
    WIDTH,
    either,
    item,
    least,
    load,
    most,
    size,
    some,
    splat,
    store,
)
from armguard.table import opener

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Fewest and most rows of a span; the fewest fill the lanes when it is searched row by
# row.
SHORTEST = WIDTH
LONGEST = 64

# What the joints of a span should turn in all, in the mean of eight; half of that is
# enough [rad or m].
TURN = 0.4

# Spans whose joints may turn more than this in all are searched row by row [rad or m].
WIDE = 1.0

open_plan = opener(Plan)
open_place = opener(Place)
open_scratch = opener(Scratch)


@kernel(inline=False, entry=True)
def check_rows(
    q: Floats,
    plan: Longs,
    spans: Longs,
    rows: Longs,
    scratch: Longs,
    nearest: Floats,
    pairs: Floats,
) -> None:
    """Least signed distance and its pair, of each configuration.

    Args:
        q: Joint positions, shape (rows, n) [rad or m].
        plan: Ledger of the plan.
        spans: Ledger of a place for spans.
        rows: Ledger of a place for rows.
        scratch: Ledger of the scratch, with settings.
        nearest: Overwritten: the distance, NaN for a row that cannot be judged, shape
            (rows + 8,); the last eight numbers are of no meaning.
        pairs: Overwritten: the pair as in `Place.pair`, of that shape.
    """
    p, s = open_plan(plan), open_scratch(scratch)
    above, w = open_place(spans), open_place(rows)
    spread(p, above)
    spread(p, w)
    spread(p, s.cells)
    start, length, count, whole = 0, SHORTEST, q.shape[0], q.reshape(-1)
    while start < count:
        given, begin = whole, start * q.shape[1]
        if start + length * WIDTH >= count:
            take_block(q, start, length, s)
            given, begin = s.block, 0
        turn = search_spans(given, begin, q.shape[1], length, p, s, above)
        for lane in range(WIDTH):
            first = start + lane * length
            end = min(first + length, count)
            if s.kept[lane] == 0 or (s.kept[lane] > 0 and above.best[lane] == -inf):
                for at in range(first, end, WIDTH):
                    store(nearest, at, splat(above.best[lane]))
                    store(pairs, at, splat(-1.0))
                continue
            if s.kept[lane] > 0:
                put_nearest_first(lane, s)
            for at in range(first, end, WIDTH):
                row = begin + (at - start) * q.shape[1]
                take_rows(given, row, q.shape[1], s.kept[lane] < 0, s, w)
                move_bodies(0, p, w)
                if s.kept[lane] < 0:
                    search(p, s, w)
                else:
                    settle_kept(lane, p, s, w)
                keep_leads(w)
                pair, best = load(w.pair, 0), load(w.best, 0)
                store(nearest, at, either(pair == -2.0, splat(nan), best))
                store(pairs, at, pair)
        start += length * WIDTH
        if turn > TURN:
            length = max(length // 2, SHORTEST)
        elif turn <= 0.5 * TURN:
            length = min(2 * length, LONGEST)


@kernel
def take_block(q: Floats, start: int, length: int, s: Scratch) -> None:
    """Copy the rows of eight spans; the last one again where there are fewer."""
    joints = q.shape[1]
    count = min(length * WIDTH, q.shape[0] - start)
    for row in range(count):
        for k in range(joints):
            s.block[row * joints + k] = q[start + row, k]
    for at in range(count * joints, length * WIDTH * joints):
        s.block[at] = s.block[at - joints]


@kernel
def search_spans(
    given: Floats,
    begin: int,
    joints: int,
    length: int,
    p: Plan,
    s: Scratch,
    w: Place,
) -> float:
    """Keep the pairs that may matter in eight spans; returns their mean turn.

    Args:
        given: Joint positions of rows one after another.
        begin: Place of the first.
        joints: Joints of a row.
        length: Rows of a span.
        p: The plan.
        s: The scratch.
        w: Gets the middles.
    """
    narrow, total = False, 0.0
    for lane in range(WIDTH):
        first = begin + lane * length * joints
        turn = take_span(given, first, joints, length, lane, s, w)
        total += min(turn, WIDE)
        good = turn <= WIDE
        s.kept[lane] = 0 if good else -1
        w.best[lane] = s.settings.margin if good else -inf
        w.pair[lane] = -1.0
        narrow = narrow or good
    if narrow:
        move_bodies(0, p, w)
        widen(p, w)
        search(p, s, w)
        keep_leads(w)
    return total / WIDTH


@kernel
def take_span(
    given: Floats,
    begin: int,
    joints: int,
    length: int,
    lane: int,
    s: Scratch,
    w: Place,
) -> float:
    """Middle and half widths of a span; returns their sum, infinite for a bad one.

    Args:
        given: Joint positions of rows one after another.
        begin: Place of the span's first.
        joints: Joints of a row.
        length: Rows of the span.
        lane: Its lane.
        s: Gets a copy.
        w: Gets the middle and the half widths.
    """
    total = 0.0
    for first in range(0, joints, WIDTH):
        low = high = load(given, begin + first)
        farthest = size(low)
        for row in range(1, length):
            value = load(given, begin + row * joints + first)
            low, high = least(low, value), most(high, value)
            farthest = farthest + size(value)
        middle = 0.5 * (low + high)
        good = farthest <= s.settings.limit
        store(s.sides, 0, either(good, middle, 0.0))
        half = most(high - middle, middle - low)
        store(s.sides, WIDTH, either(good, half, inf))
        for k in range(min(joints - first, WIDTH)):
            w.q[(first + k) * WIDTH + lane] = item(s.sides, k)
            half_k = item(s.sides, WIDTH + k)
            w.half[(first + k) * WIDTH + lane] = half_k if half_k < inf else 0.0
            total += half_k
    return total


@kernel
def take_rows(
    given: Floats, begin: int, joints: int, doubtful: bool, s: Scratch, w: Place
) -> None:
    """Turn eight rows to lanes; one that cannot be judged is left at 0.

    Args:
        given: Joint positions of rows one after another.
        begin: Place of the first.
        joints: Joints of a row.
        doubtful: Whether there may be such rows.
        s: The scratch, with settings.
        w: Gets the rows.
    """
    for k in range(joints):
        for row in range(WIDTH):
            w.q[k * WIDTH + row] = item(given, begin + row * joints + k)
    store(w.best, 0, splat(s.settings.margin))
    store(w.pair, 0, splat(-1.0))
    if doubtful:
        for row in range(WIDTH):
            good = True
            for k in range(joints):
                good = good and abs(w.q[k * WIDTH + row]) <= s.settings.limit
            if not good:
                w.best[row], w.pair[row] = -inf, -2.0
                for k in range(joints):
                    w.q[k * WIDTH + row] = 0.0


@kernel
def put_nearest_first(lane: int, s: Scratch) -> None:
    """Exchange the first pair that a span has kept with the one of the lowest bound."""
    first = lane * (s.low.shape[0] // WIDTH)
    best = first
    for at in range(first + 1, first + s.kept[lane]):
        if s.low[at, 0] < s.low[best, 0]:
            best = at
    for side in range(2):
        s.low[first, side], s.low[best, side] = s.low[best, side], s.low[first, side]
        pair = s.pairs[first, side]
        s.pairs[first, side] = s.pairs[best, side]
        s.pairs[best, side] = pair


@kernel
def settle_kept(lane: int, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs that a span has kept, in its rows."""
    growth, first = splat(0.0), lane * (s.low.shape[0] // WIDTH)
    for at in range(first, first + s.kept[lane]):
        if not some(splat(item(s.low, 2 * at)) < load(w.best, 0)):
            continue
        i, j = item(s.pairs, 2 * at), item(s.pairs, 2 * at + 1)
        buffer = item(s.low, 2 * at + 1)
        ball, other = item(p.ball, i), item(p.ball, j)
        x, y, z = (
            middle(other, 0, p, w),
            middle(other, 1, p, w),
            middle(other, 2, p, w),
        )
        reach = growth + (item(p.rows, other * ROW_WIDTH) + (buffer + SLACK))
        if some(near_point(ball, x, y, z, reach, p, w)):
            settle(i, j, buffer, growth, 0, p, s, w)


@kernel
def keep_leads(w: Place) -> None:
    """Remember the pairs that decided."""
    pair = load(w.pair, 0)
    store(w.lead, 0, either(pair >= 0.0, pair, load(w.lead, 0)))
