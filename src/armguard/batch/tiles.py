"""Boxes of joint positions in lanes: which pairs of primitives may be too near."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.batch.plan import Plan
from armguard.batch.pose import NEAR, Place, move_bodies, spread, widen
from armguard.batch.room import limit_of, place_of, scratch_of, sizes_of
from armguard.batch.scratch import ROOM, Scratch
from armguard.batch.search import search
from armguard.kernel import kernel
from armguard.lanes import WIDTH
from armguard.table import Ledger, LongMatrix, LongVector, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


@table
class OpenPairs(NamedTuple):
    """Pairs of primitives that may be too near somewhere in a box.

    Attributes:
        total: How many there are, shape (1,).
        pairs: Box and the two primitives, the lower one first, shape (k, 3).
        low: Distance above what is required that they are not below, shape (k,) [m].
    """

    total: LongVector
    pairs: LongMatrix
    low: Vector


open_plan = opener(Plan)
open_place = opener(Place)
open_scratch = opener(Scratch)
open_pairs = opener(OpenPairs)


@kernel(inline=False, entry=True)
def list_boxes(
    middles: Floats,
    halves: Floats,
    start: int,
    plan: Longs,
    place: Longs,
    scratch: Longs,
    listing: Longs,
) -> int:
    """List the pairs that may be too near in each box, for as many boxes as fit.

    Args:
        middles: Joint positions in the middle of each box, shape (k, n) [rad or m].
        halves: Largest distance of a box's joint positions from them, of that shape.
        start: Box to begin with.
        plan: Ledger of the plan.
        place: Ledger of a place of mode NEAR.
        scratch: Ledger of the scratch, with settings.
        listing: Ledger of the listing; pairs are added to it.

    Returns:
        The first box that did not fit: `len(middles)` where all did.
    """
    p, w = open_plan(plan), open_place(place)
    s, found = open_scratch(scratch), open_pairs(listing)
    spread(p, w)
    spread(p, s.cells)
    count = middles.shape[0]
    for first in range(start, count, WIDTH):
        for lane in range(WIDTH):
            row = min(first + lane, count - 1)
            w.best[lane], w.pair[lane] = s.settings.margin, -1.0
            for k in range(middles.shape[1]):
                w.q[k * WIDTH + lane] = middles[row, k]
                w.half[k * WIDTH + lane] = halves[row, k]
        s.kept[:] = 0
        move_bodies(0, p, w)
        widen(p, w)
        search(p, s, w)
        before = found.total[0]
        for lane in range(min(WIDTH, count - first)):
            if not take_pairs(first + lane, lane, s, found):
                found.total[0] = before
                return first
    return len(middles)


@kernel
def take_pairs(box: int, lane: int, s: Scratch, found: OpenPairs) -> bool:
    """Add the pairs of one box to the listing; returns False if they do not fit."""
    count, room, at = s.kept[lane], s.low.shape[0] // WIDTH, found.total[0]
    if count < 0 or at + count > found.pairs.shape[0]:
        return False
    for k in range(count):
        i, j = s.pairs[lane * room + k, 0], s.pairs[lane * room + k, 1]
        found.pairs[at + k, 0] = box
        found.pairs[at + k, 1], found.pairs[at + k, 2] = min(i, j), max(i, j)
        found.low[at + k] = s.low[lane * room + k, 0]
    found.total[0] = at + count
    return True


class BoxSearch:
    """Lists pairs in boxes; what it writes to is kept from call to call.

    Args:
        plan: The plan; its objects may be placed and removed between calls.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan, self._sizes = Ledger(plan), sizes_of(plan)
        self._limit = limit_of(plan)
        self._place = place_of(NEAR, self._sizes)
        self._make_room(WIDTH * ROOM, ROOM)

    def _make_room(self, room: int, pairs: int) -> None:
        """Room for so many pairs in all, and in each of eight boxes."""
        self._room, self._pairs = room, pairs
        self._scratch = scratch_of(pairs, self._sizes)
        self._found = OpenPairs(
            total=np.zeros(1, dtype=np.int64),
            pairs=np.zeros((room, 3), dtype=np.int64),
            low=np.zeros(room),
        )
        self._listing = Ledger(self._found)

    def pairs(
        self, middles: Floats, halves: Floats, margin: float, strict: int
    ) -> tuple[Longs, Floats]:
        """Every pair of primitives that may be nearer than a margin in a box.

        Args:
            middles: Joint positions in the middle of each box, shape (k, n) [rad or m].
            halves: Half widths of the boxes, of that shape.
            margin: Distance below which a pair is listed [m].
            strict: 1 if distances count above the pair's buffer.

        Returns:
            Box and the two primitives of each pair, shape (m, 3), and the distance,
            above the buffer or not, that it is nowhere below, shape (m,) [m].
        """
        found, at = [], 0
        while True:
            self._scratch.arrays[0][...] = margin, strict, 0.0, self._limit
            self._found.total[0] = 0
            at = list_boxes(
                middles,
                halves,
                at,
                self._plan.lines,
                self._place.lines,
                self._scratch.lines,
                self._listing.lines,
            )
            count = int(self._found.total[0])
            part = self._found.pairs[:count].copy(), self._found.low[:count].copy()
            found.append(part)
            if at == len(middles):
                break
            self._make_room(2 * self._room, 2 * self._pairs)
        listed, low = map(np.concatenate, zip(*found, strict=True))
        return listed, low
