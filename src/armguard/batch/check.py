"""Least signed distances of the rows of a batch: spans first, then rows."""

from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from armguard.batch.lanes import WIDTH, load, some, splat, store
from armguard.batch.plan import Plan
from armguard.batch.pose import Place, move_bodies, spread, widen
from armguard.batch.search import (
    DROP,
    LIMIT,
    MARGIN,
    ROOM,
    Scratch,
    search,
    settle,
)
from armguard.kernel import kernel
from armguard.table import opener

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Rows of a span: they fill the lanes when it is searched row by row.
SPAN = WIDTH

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
    for start in range(0, q.shape[0], SPAN * WIDTH):
        search_spans(q, start, p, s, above)
        for lane in range(WIDTH):
            first = start + lane * SPAN
            if first >= q.shape[0]:
                break
            take_rows(q, first, s, w)
            if s.count[lane] < 0:
                move_bodies(p, w)
                search(p, s, w)
            elif above.best[lane] == -inf:
                store(w.best, 0, splat(-inf))
            elif s.count[lane] > 0:
                move_bodies(p, w)
                settle_kept(lane, p, s, w)
            write_rows(first, p, w, found)


@kernel
def search_spans(q: Floats, start: int, p: Plan, s: Scratch, w: Place) -> None:
    """Keep the pairs that may matter in eight spans."""
    narrow = False
    for lane in range(WIDTH):
        total = take_span(q, start + lane * SPAN, lane, s, w)
        s.count[lane] = 0 if total <= WIDE else -1
        w.best[lane] = s.settings[MARGIN] if total <= WIDE else -inf
        w.who[lane] = -1.0
        narrow = narrow or total <= WIDE
    if narrow:
        move_bodies(p, w)
        widen(p, w)
        search(p, s, w)
        keep_leads(w)


@kernel
def take_span(q: Floats, first: int, lane: int, s: Scratch, w: Place) -> float:
    """Middle and half widths of a span; returns their sum, infinite for a bad one."""
    total = 0.0
    limit, joints = s.settings[LIMIT], q.shape[1]
    end = min(first + SPAN, q.shape[0])
    for k in range(joints):
        low, high, good = inf, -inf, end > first
        for row in range(first, end):
            value = q[row, k]
            good = good and abs(value) <= limit
            low, high = min(low, value), max(high, value)
        middle = 0.5 * (low + high) if good else 0.0
        half = max(high - middle, middle - low) if good else inf
        total += half
        w.q[k * WIDTH + lane] = middle
        w.half[k * WIDTH + lane] = half if good else 0.0
    return total


@kernel
def take_rows(q: Floats, first: int, s: Scratch, w: Place) -> None:
    """Turn eight configurations to lanes; one that cannot be judged is left at 0."""
    limit = s.settings[LIMIT]
    for lane in range(WIDTH):
        row = first + lane
        good = row < q.shape[0]
        if good:
            for k in range(q.shape[1]):
                good = good and abs(q[row, k]) <= limit
        for k in range(q.shape[1]):
            w.q[k * WIDTH + lane] = q[row, k] if good else 0.0
        w.best[lane] = s.settings[MARGIN] if good else -inf
        w.who[lane] = -1.0 if good else -2.0


@kernel
def settle_kept(lane: int, p: Plan, s: Scratch, w: Place) -> None:
    """Settle the pairs that a span has kept, in its rows."""
    growth = splat(0.0)
    for at in range(lane * ROOM, lane * ROOM + s.count[lane]):
        if some(splat(s.low[at, 0]) < load(w.best, 0)):
            settle(s.pairs[at, 0], s.pairs[at, 1], s.low[at, 1], growth, 0, p, s, w)


@kernel
def keep_leads(w: Place) -> None:
    """Remember the pairs that decided."""
    for lane in range(WIDTH):
        if w.who[lane] >= 0.0:
            w.lead[lane] = w.who[lane]


@kernel
def write_rows(first: int, p: Plan, w: Place, found: Floats) -> None:
    """Write what eight rows have found."""
    keep_leads(w)
    count = p.kinds.shape[0]
    for lane in range(min(WIDTH, found.shape[0] - first)):
        out = found[first + lane]
        out[0], who = w.best[lane], w.who[lane]
        if who == -2.0:
            out[0] = nan
        out[1] = who // count if who >= 0.0 else -1.0
        out[2] = who - out[1] * count if who >= 0.0 else -1.0
