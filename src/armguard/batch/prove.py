"""Straight motions of a batch, proven to keep every buffer: spans, halved where needed.

A motion is cut into spans. The bound of `widen` says how far a span may carry each
part from where its middle has it. A span in which no pair may come below its buffer is
proven; another is halved, down to a smallest span.
"""

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.batch.check import open_place, open_plan, open_scratch
from armguard.batch.pose import Place, move_bodies, spread, widen
from armguard.batch.scratch import Scratch
from armguard.batch.search import search
from armguard.kernel import kernel
from armguard.lanes import WIDTH
from armguard.table import LongMatrix, LongVector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Units into which a motion is divided; a power of 2, so that shares are exact.
WHOLE = 1 << 30

# First spans of a motion, at most.
FIRST_SPANS = 64

# The joints turn at most this much in all in a first span, where there are not too many
# of them, and about this much in the smallest [rad or m].
COARSE = 0.4
FINE = 1e-4

# Spans that wait. The stack holds those that follow the ones in work: at most eight of
# each width, and the first spans of one motion.
WAITING = 1024


@table
class Walk(NamedTuple):
    """Spans of motions: motion, first unit, units, and units of the smallest.

    Attributes:
        waiting: Spans that wait; the last is the next, shape (WAITING, 4).
        now: Spans in work, motion -1 in a lane without one, shape (8, 4).
        size: How many spans wait, shape (1,).
        reached: First unit of each motion that is not proven, as far as is known, and
            -1 for a motion that cannot be judged, shape (n,).
    """

    waiting: LongMatrix
    now: LongMatrix
    size: LongVector
    reached: LongVector


open_walk = opener(Walk)


@kernel(inline=False, entry=True)
def prove_motions(
    starts: Floats,
    ends: Floats,
    plan: Longs,
    place: Longs,
    scratch: Longs,
    walk: Longs,
) -> None:
    """How far each motion is proven.

    Args:
        starts: Joint positions at the start, shape (n, joints) [rad or m].
        ends: Joint positions at the end, of that shape.
        plan: Ledger of the plan.
        place: Ledger of a place for motions.
        scratch: Ledger of the scratch, with settings.
        walk: Ledger of the walk; its `reached` is overwritten.
    """
    p, s = open_plan(plan), open_scratch(scratch)
    w, t = open_place(place), open_walk(walk)
    spread(p, w)
    spread(p, s.cells)
    t.size[0] = motion = 0
    while True:
        while t.size[0] < WIDTH and motion < starts.shape[0]:
            begin_motion(motion, starts, ends, s, t)
            motion += 1
        if t.size[0] == 0:
            return
        take_spans(starts, ends, t, w)
        move_bodies(0, p, w)
        widen(p, w)
        search(p, s, w)
        for lane in range(WIDTH - 1, -1, -1):
            if t.now[lane, 0] >= 0 and w.best[lane] < 0.0:
                halve(lane, t, w)


@kernel
def begin_motion(
    motion: int, starts: Floats, ends: Floats, s: Scratch, t: Walk
) -> None:
    """Let the first spans of a motion wait, the very first on top."""
    good, turn = True, 0.0
    for k in range(starts.shape[1]):
        a, b = starts[motion, k], ends[motion, k]
        good = good and abs(a) <= s.settings.limit and abs(b) <= s.settings.limit
        turn += abs(b - a)
    t.reached[motion] = WHOLE if good else -1
    if not good:
        return
    units = smallest = WHOLE
    while units * FIRST_SPANS > WHOLE and turn * units > COARSE * WHOLE:
        units //= 2
    while smallest > 1 and turn * smallest > FINE * WHOLE:
        smallest //= 2
    for first in range(WHOLE - units, -1, -units):
        push(motion, first, units, smallest, t)


@kernel
def push(motion: int, first: int, units: int, smallest: int, t: Walk) -> None:
    """Let a span wait; a motion for which there is no room is proven up to there."""
    at = t.size[0]
    if at == t.waiting.shape[0]:
        t.reached[motion] = min(t.reached[motion], first)
        return
    t.waiting[at, 0], t.waiting[at, 1] = motion, first
    t.waiting[at, 2], t.waiting[at, 3] = units, smallest
    t.size[0] = at + 1


@kernel
def take_spans(starts: Floats, ends: Floats, t: Walk, w: Place) -> None:
    """Take up to eight spans of those that wait and still matter."""
    for lane in range(WIDTH):
        t.now[lane, 0] = -1
        w.best[lane], w.pair[lane] = -inf, -1.0
        while t.size[0] > 0 and t.now[lane, 0] < 0:
            t.size[0] -= 1
            at = t.size[0]
            motion, first, units = t.waiting[at, 0], t.waiting[at, 1], t.waiting[at, 2]
            if first >= t.reached[motion]:
                continue
            for k in range(t.now.shape[1]):
                t.now[lane, k] = t.waiting[at, k]
            w.best[lane] = 0.0
            share, half = (first + 0.5 * units) / WHOLE, 0.5 * units / WHOLE
            for k in range(starts.shape[1]):
                way = ends[motion, k] - starts[motion, k]
                w.q[k * WIDTH + lane] = starts[motion, k] + share * way
                w.half[k * WIDTH + lane] = half * abs(way)


@kernel
def halve(lane: int, t: Walk, w: Place) -> None:
    """Let the halves of a span wait; the smallest ends what is proven."""
    motion, first = t.now[lane, 0], t.now[lane, 1]
    units, smallest = t.now[lane, 2], t.now[lane, 3]
    if units <= smallest:
        t.reached[motion] = min(t.reached[motion], first)
        return
    middle = first + units // 2
    if w.pair[lane] == -2.0:
        t.reached[motion] = min(t.reached[motion], middle)
    if middle < t.reached[motion]:
        push(motion, middle, units // 2, smallest, t)
    if first < t.reached[motion]:
        push(motion, first, units // 2, smallest, t)
