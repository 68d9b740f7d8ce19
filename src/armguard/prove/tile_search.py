"""Tiles of one to four parameters, halved until it is decided how near links are.

A tile has a list of the pairs of links that are not decided in it. Its halves inherit
those that it could not decide.
"""

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.batch.plan import Plan
from armguard.kernel import kernel
from armguard.prove.link_tiles import bound_pair, measure_ways
from armguard.prove.links import Links, TileGap, move_to_tile
from armguard.prove.tube_tiles import (
    HIGH,
    LOW,
    SPAN,
    TubeTable,
    open_tube,
    take_tile,
)
from armguard.table import LongMatrix, LongVector, Matrix, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# What is known of links in a tile.
FREE = 0  # they keep their distances
TOUCHING = 1  # two of them may be nearer at every place of the tile
UNKNOWN = 2  # too small to be halved, and not decided
OPEN = 3  # to be halved

# Columns of a leaf: the nearest pair of those that were left, what is known, and what
# the least distance of that pair is not below and not above [m]. SPAN columns for each
# parameter follow, see `take_tile`.
PAIR, LABEL, LOWER, UPPER = range(4)
PLACE = 4

# Levels of halving of each parameter.
LEVELS = 64

# Tiles that wait in the search for the least distance, and numbers that they take.
WAITING = 64
PLACES = 3 * WAITING

# Most parameters.
PARAMETERS = 4

# A tile of one parameter in whose middle two links keep their distance is halved so
# much further: only the bound is too weak. With a width that would not end.
FINER = 2.0**-10

# Differences of distances below this decide nothing [m].
ROUNDING = 2e-9

# Of an overlap, this share is added to a tolerance: where axes of capsules cross, the
# distance hardly changes while they move [-].
DEEP = 2e-3

# Share of a segment that is not halved for the least distance [-].
FINEST = 1e-9


@table
class Leaves(NamedTuple):
    """Tiles that are decided.

    Attributes:
        total: How many there are, and how many pairs are not decided, shape (2,).
        rows: See PAIR and what follows it, shape (k, PLACE + SPAN · d).
        open: Leaf and pair of each pair that is not decided, shape (m, 2).
    """

    total: LongVector
    rows: Matrix
    open: LongMatrix


@table
class Waiting(NamedTuple):
    """Tiles that wait to be judged.

    Attributes:
        size: How many there are, shape (1,).
        tiles: SPAN numbers for each parameter, shape (w, SPAN · d).
        lists: First of each tile's pairs in `pairs`, and how many, shape (w, 2).
        pairs: Pairs that are not decided, in lists one after another, shape (m,).
        tile: The tile that is judged, shape (SPAN · d,).
        ways: How far each parameter may carry two links, shape (d,); of one parameter
            any number above 0 [m].
    """

    size: LongVector
    tiles: Matrix
    lists: LongMatrix
    pairs: LongVector
    tile: Vector
    ways: Vector


open_plan = opener(Plan)
open_links = opener(Links)
open_leaves = opener(Leaves)
open_waiting = opener(Waiting)


@kernel
def place_tile(tile: Floats, tube: TubeTable, p: Plan, t: Links) -> None:
    """Put all bodies where they are in the middle of a tile."""
    take_tile(tile, tube, t.q, t.line, t.bow, t.wide)
    move_to_tile(p, t)


@kernel
def can_decide(gap: TileGap, t: Links) -> float:
    """Share of the smallest size to which halving may decide a tile of a pair.

    Args:
        gap: What is known of the pair's distance, less what it has to keep.
        t: The links.
    """
    if gap.upper - gap.lower < ROUNDING:
        return float(inf)
    if gap.found >= 0.0 and not t.wide.any():
        return FINER
    return 1.0


@kernel
def halved_parameter(
    pair: int, share: float, tube: TubeTable, p: Plan, t: Links, w: Waiting
) -> int:
    """Parameter along which a tile is halved: it moves a pair most; -1 for none.

    Args:
        pair: The pair.
        share: Of the smallest sizes, what is still halved [-].
        tube: The tube.
        p: The plan.
        t: The links, their bodies in the middle of the tile.
        w: The tile.
    """
    chosen, most, count = -1, 0.0, w.ways.shape[0]
    if count > 1:
        measure_ways(pair, tube.owner, p, t, w.ways)
        share = max(share, 1.0)
    for d in range(count):
        at = SPAN * d
        smallest = share * tube.smallest[int(w.tile[at])]
        if w.tile[at + HIGH] - w.tile[at + LOW] > smallest and w.ways[d] > most:
            chosen, most = d, w.ways[d]
    return chosen


@kernel
def copy_numbers(numbers: Floats | Longs, out: Floats | Longs) -> None:
    """Write numbers to the beginning of an array that is as long, or longer."""
    for k in range(numbers.shape[0]):
        out[k] = numbers[k]


@kernel
def put_halves(d: int, first: int, count: int, w: Waiting) -> None:
    """Let both halves of the tile that is judged wait, the lower one on top."""
    at = w.size[0]
    middle = 0.5 * (w.tile[SPAN * d + LOW] + w.tile[SPAN * d + HIGH])
    for k in range(2):
        copy_numbers(w.tile, w.tiles[at + k])
        w.tiles[at + k, SPAN * d + (LOW if k == 0 else HIGH)] = middle
        w.lists[at + k, 0], w.lists[at + k, 1] = first, count
    w.size[0] = at + 2


@kernel(inline=False)
def judge_pairs(row: Floats, p: Plan, t: Links, w: Waiting, tube: TubeTable) -> int:
    """Judge the pairs of the tile on top of those that wait; it is taken off.

    The pairs that are not decided are listed behind the tile's own list.

    Args:
        row: The leaf, but for its place, overwritten.
        p: The plan.
        t: The links.
        w: What waits; the halves of the tile are added.
        tube: The tube.

    Returns:
        How many pairs are not decided; -1 if the tile was halved.
    """
    at = w.size[0] - 1
    first, count, kept = w.lists[at, 0], w.lists[at, 1], 0
    w.size[0] = at
    copy_numbers(w.tiles[at], w.tile)
    place_tile(w.tile, tube, p, t)
    worst, share, label, place = inf, 1.0, FREE, 0
    for k in range(count):
        pair = w.pairs[first + k]
        need = t.need[pair]
        # The first pair is the worst one of the tile before.
        gap = bound_pair(pair, need, k == 0, p, t)
        if not gap.lower - need >= worst:
            worst, place = gap.lower - need, kept
            row[PAIR], row[LOWER], row[UPPER] = pair, gap.lower, gap.upper
            past = TileGap(worst, gap.upper - need, gap.found - need, 0.0)
            share = can_decide(past, t)
        if gap.lower >= need:
            continue
        w.pairs[first + count + kept] = pair
        kept += 1
        label = OPEN
        if gap.upper < need:
            row[PAIR], row[LOWER], row[UPPER] = pair, gap.lower, gap.upper
            label = TOUCHING
            break
    if label == OPEN:
        chosen = halved_parameter(int(row[PAIR]), share, tube, p, t, w)
        if chosen >= 0:
            # Where it touches, no other pair has to be judged.
            front = first + count
            w.pairs[front + place] = w.pairs[front]
            w.pairs[front] = int(row[PAIR])
            put_halves(chosen, first + count, kept, w)
            return -1
        label = UNKNOWN
    row[LABEL] = label
    return kept if label == UNKNOWN else 0


@kernel(inline=False, entry=True)
def decide_tiles(
    tiles: Floats,
    first: Longs,
    pairs: Longs,
    plan: Longs,
    links: Longs,
    tube: Longs,
    waiting: Longs,
    leaves: Longs,
) -> int:
    """Halve tiles until it is decided in each which links keep their distances.

    Args:
        tiles: SPAN numbers for each parameter, see `take_tile`, shape (k, SPAN · d).
        first: First of each tile's pairs in `pairs`, and the end, shape (k + 1,).
        pairs: Pairs that may be too near in each tile.
        plan: Ledger of the plan.
        links: Ledger of the links.
        tube: Ledger of the tube.
        waiting: Ledger of what waits.
        leaves: Ledger of the leaves; those of each tile are added in ascending order.

    Returns:
        The first tile whose leaves did not fit: `len(tiles)` where all did.
    """
    p, t, u = open_plan(plan), open_links(links), open_tube(tube)
    w, found = open_waiting(waiting), open_leaves(leaves)
    for k in range(tiles.shape[0]):
        before, undecided = found.total[0], found.total[1]
        count = first[k + 1] - first[k]
        copy_numbers(tiles[k], w.tiles[0])
        copy_numbers(pairs[first[k] : first[k + 1]], w.pairs)
        w.size[0], w.lists[0, 0], w.lists[0, 1] = 1, 0, count
        while w.size[0] > 0:
            at, left = found.total[0], found.total[1]
            if at == found.rows.shape[0]:
                found.total[0], found.total[1] = before, undecided
                return k
            list_end = w.lists[w.size[0] - 1, 0] + w.lists[w.size[0] - 1, 1]
            kept = judge_pairs(found.rows[at], p, t, w, u)
            if kept < 0:
                continue
            if left + kept > found.open.shape[0]:
                found.total[0], found.total[1] = before, undecided
                return k
            copy_numbers(w.tile, found.rows[at, PLACE:])
            for i in range(kept):
                found.open[left + i, 0] = at
                found.open[left + i, 1] = w.pairs[list_end + i]
            found.total[0], found.total[1] = at + 1, left + kept
    return len(tiles)


@kernel(inline=False, entry=True)
def least_in_tiles(
    tiles: Floats,
    tolerance: float,
    plan: Longs,
    links: Longs,
    tube: Longs,
    best: Floats,
) -> None:
    """Least distance of two links in each group of tiles.

    A tile that may hold less than what is found, by more than the tolerance, is halved
    while its joints' line counts for more than that.

    Args:
        tiles: Leaves of one parameter, with their group in the place of the label.
        tolerance: Difference that does not count; see DEEP [m].
        plan: Ledger of the plan.
        links: Ledger of the links.
        tube: Ledger of the tube.
        best: Overwritten: what the least distance is not above and not below, pair,
            segment, and share where it is not above; infinite distances where there is
            no tile; shape (g, 5).
    """
    p, t, u = open_plan(plan), open_links(links), open_tube(tube)
    waiting = array_at(stack(PLACES), (WAITING, 3), np.float64)
    tile = array_at(stack(SPAN), (SPAN,), np.float64)
    best[:, :2] = inf
    for k in range(tiles.shape[0]):
        row, own = tiles[k], best[int(tiles[k, LABEL])]
        if row[UPPER] < own[0]:
            own[0], own[2], own[3] = row[UPPER], row[PAIR], row[PLACE]
            own[4] = 0.5 * (row[PLACE + LOW] + row[PLACE + HIGH])
    for k in range(tiles.shape[0]):
        pair, segment = int(tiles[k, PAIR]), tiles[k, PLACE]
        own, left = best[int(tiles[k, LABEL])], 1
        waiting[0, 0] = tiles[k, PLACE + LOW]
        waiting[0, 1] = tiles[k, PLACE + HIGH]
        waiting[0, 2] = tiles[k, LOWER]
        while left > 0:
            left -= 1
            low, high, known = waiting[left, 0], waiting[left, 1], waiting[left, 2]
            slack = tolerance + DEEP * max(-own[0], 0.0)
            if known >= own[0] - slack:
                own[1] = min(own[1], known)
                continue
            tile[0], tile[LOW], tile[HIGH] = segment, low, high
            place_tile(tile, u, p, t)
            gap = bound_pair(pair, own[0] - slack, True, p, t)
            if gap.upper < own[0]:
                own[0], own[2], own[3] = gap.upper, pair, segment
                own[4] = 0.5 * (low + high)
            lower = max(known, gap.lower)
            split = high - low > FINEST and gap.upper - gap.found > 0.5 * slack
            if lower >= own[0] - slack or not split:
                own[1] = min(own[1], lower)
                continue
            middle = 0.5 * (low + high)
            for begin, end in ((middle, high), (low, middle)):
                waiting[left, 0], waiting[left, 1], waiting[left, 2] = begin, end, lower
                left += 1
