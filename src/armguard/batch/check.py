"""Least signed distances of the rows of a batch: spans first, then rows."""

from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from armguard.batch.plan import Plan
from armguard.batch.pose import Place, move_bodies, spread, widen
from armguard.batch.search import (
    CODE,
    SHIFT,
    Scratch,
    search,
    settle,
)
from armguard.kernel import kernel
from armguard.lanes import WIDTH, least, load, most, size, some, splat, store
from armguard.table import opener

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Fewest and most rows of a span; the fewest fill the lanes when it is searched row by
# row.
SHORTEST = WIDTH
LONGEST = 32

# What the joints of a span should turn in all; half of that is enough [rad or m].
TURN = 0.4

# Spans whose joints may turn more than this in all are searched row by row [rad or m].
WIDE = 1.0

open_plan = opener(Plan)
open_place = opener(Place)
open_scratch = opener(Scratch)


@kernel(inline=False, entry=True)
def check_rows(
    q: Floats, plan: Longs, spans: Longs, rows: Longs, scratch: Longs, found: Floats
) -> None:
    """Least signed distance and its pair, of each configuration.

    Args:
        q: Joint positions, shape (rows, n) [rad or m].
        plan: Ledger of the plan.
        spans: Ledger of a place for spans.
        rows: Ledger of a place for rows.
        scratch: Ledger of the scratch, with settings.
        found: Overwritten: distance, NaN for a row that cannot be judged, and the two
            primitives, -1 for none, shape (rows, 3).
    """
    p, s = open_plan(plan), open_scratch(scratch)
    above, w = open_place(spans), open_place(rows)
    spread(p, above)
    spread(p, w)
    start, length = 0, SHORTEST
    while start < q.shape[0]:
        take_block(q, start, length, s)
        widest = search_spans(q.shape[1], length, p, s, above)
        for lane in range(WIDTH):
            first = start + lane * length
            if s.kept[lane] == 0 or (s.kept[lane] > 0 and above.best[lane] == -inf):
                store(w.best, 0, splat(above.best[lane]))
                store(w.pair, 0, splat(-1.0))
                for at in range(first, min(first + length, q.shape[0]), WIDTH):
                    write_rows(at, w, found)
                continue
            for at in range(first, min(first + length, q.shape[0]), WIDTH):
                take_rows(q.shape[1], at - start, s.kept[lane] < 0, s, w)
                move_bodies(p, w)
                if s.kept[lane] < 0:
                    search(p, s, w)
                else:
                    settle_kept(lane, p, s, w)
                write_rows(at, w, found)
        start += length * WIDTH
        if widest > TURN:
            length = max(length // 2, SHORTEST)
        elif widest <= 0.5 * TURN:
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
def search_spans(joints: int, length: int, p: Plan, s: Scratch, w: Place) -> float:
    """Keep the pairs that may matter in eight spans; returns the widest one's turn."""
    narrow, widest = False, 0.0
    for lane in range(WIDTH):
        turn = take_span(joints, lane, length, s, w)
        widest = max(widest, turn)
        good = turn <= WIDE
        s.kept[lane] = 0 if good else -1
        w.best[lane] = s.settings.margin if good else -inf
        w.pair[lane] = -1.0
        narrow = narrow or good
    if narrow:
        move_bodies(p, w)
        widen(p, w)
        search(p, s, w)
        keep_leads(w)
    return widest


@kernel
def take_span(joints: int, lane: int, length: int, s: Scratch, w: Place) -> float:
    """Middle and half widths of a span; returns their sum, infinite for a bad one."""
    total, begin = 0.0, lane * length * joints
    for first in range(0, joints, WIDTH):
        low = high = load(s.block, begin + first)
        farthest = size(low)
        for row in range(1, length):
            value = load(s.block, begin + row * joints + first)
            low, high = least(low, value), most(high, value)
            farthest = farthest + size(value)
        middle = 0.5 * (low + high)
        store(s.sides, 0, middle)
        store(s.sides, WIDTH, most(high - middle, middle - low))
        store(s.sides, 2 * WIDTH, farthest)
        for k in range(first, min(first + WIDTH, joints)):
            good = s.sides[2 * WIDTH + k - first] <= s.settings.limit
            w.q[k * WIDTH + lane] = s.sides[k - first] if good else 0.0
            half = s.sides[WIDTH + k - first] if good else inf
            w.half[k * WIDTH + lane] = half if good else 0.0
            total += half
    return total


@kernel
def take_rows(joints: int, first: int, doubtful: bool, s: Scratch, w: Place) -> None:
    """Turn eight rows of the block to lanes; one that cannot be judged is left at 0.

    Args:
        joints: Joints of a row.
        first: Place of the first row in the block.
        doubtful: Whether there may be such rows.
        s: The block.
        w: Gets the rows.
    """
    begin = first * joints
    for k in range(joints):
        for row in range(WIDTH):
            w.q[k * WIDTH + row] = s.block[begin + row * joints + k]
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
def settle_kept(lane: int, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs that a span has kept, in its rows."""
    growth, first = splat(0.0), lane * (s.low.shape[0] // WIDTH)
    for at in range(first, first + s.kept[lane]):
        if some(splat(s.low[at, 0]) < load(w.best, 0)):
            settle(s.pairs[at, 0], s.pairs[at, 1], s.low[at, 1], growth, 0, p, s, w)


@kernel
def keep_leads(w: Place) -> None:
    """Remember the pairs that decided."""
    for lane in range(WIDTH):
        if w.pair[lane] >= 0.0:
            w.lead[lane] = w.pair[lane]


@kernel
def write_rows(first: int, w: Place, found: Floats) -> None:
    """Write what eight rows have found."""
    keep_leads(w)
    for lane in range(min(WIDTH, found.shape[0] - first)):
        pair = int(w.pair[lane])
        row = first + lane
        found[row, 0] = nan if pair == -2 else w.best[lane]
        found[row, 1] = float(pair >> SHIFT) if pair >= 0 else -1.0
        found[row, 2] = float(pair & (CODE - 1)) if pair >= 0 else -1.0
