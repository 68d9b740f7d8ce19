"""Tiles of a tube, halved until it is decided in each how near two links are."""

from math import inf
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.batch.plan import Plan
from armguard.kernel import kernel
from armguard.prove.link_tiles import Links, TileGap, bound_pair
from armguard.prove.tube_tiles import TubeTable, open_tube, take_tile
from armguard.table import LongVector, Matrix, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# What is known of two links in a tile.
FREE = 0  # they keep their distance
TOUCHING = 1  # at every time they may be nearer
UNKNOWN = 2  # too small to be halved, and not decided

# Columns of a leaf: the pair, its segment, the shares of it where the tile begins and
# ends, what is known, and what the least distance is not below and not above [m].
PAIR, SEGMENT, LOW, HIGH, LABEL, LOWER, UPPER = range(7)
COLUMNS = 7

# Tiles that wait: one on each level and one more.
WAITING = 64

# Numbers that they take.
PLACES = 3 * WAITING

# A tile in whose middle two links keep their distance is halved so much further: only
# the bound is too weak. With a width that would not end.
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
        total: How many there are, shape (1,).
        rows: See PAIR and what follows it, shape (k, COLUMNS).
    """

    total: LongVector
    rows: Matrix


open_plan = opener(Plan)
open_links = opener(Links)
open_leaves = opener(Leaves)


@kernel
def bound_tile(
    pair: int,
    segment: int,
    low: float,
    high: float,
    limit: float,
    tube: TubeTable,
    p: Plan,
    t: Links,
) -> TileGap:
    """Distance of two links in a tile, see `bound_pair`."""
    take_tile(segment, low, high, tube, t.q, t.line, t.bow)
    for j in range(t.wide.shape[0]):
        t.wide[j] = tube.wide[segment, j]
    return bound_pair(pair, limit, p, t)


@kernel
def is_halved(
    share: float, smallest: float, need: float, gap: TileGap, t: Links
) -> bool:
    """Whether a tile that is not decided is halved.

    Args:
        share: Its share of the segment [-].
        smallest: Share that is small enough [-].
        need: Distance to keep [m].
        gap: What is known of the distance.
        t: The links.
    """
    if gap.upper - gap.lower < ROUNDING:
        return False
    if gap.found >= need and not t.wide.any():
        smallest *= FINER
    return bool(share > smallest)


@kernel(inline=False, entry=True)
def decide_tiles(
    tiles: Floats, start: int, plan: Longs, links: Longs, tube: Longs, leaves: Longs
) -> int:
    """Halve tiles until it is decided in each whether two links keep their distance.

    Args:
        tiles: Pair, segment, and shares where each tile begins and ends, shape (k, 4).
        start: Tile to begin with.
        plan: Ledger of the plan.
        links: Ledger of the links.
        tube: Ledger of the tube.
        leaves: Ledger of the leaves; those of each tile are added in ascending order.

    Returns:
        The first tile whose leaves did not fit: `len(tiles)` where all did.
    """
    p, t = open_plan(plan), open_links(links)
    u, found = open_tube(tube), open_leaves(leaves)
    waiting = numba.carray(stack(PLACES), (WAITING, 3), np.float64)
    for k in range(start, tiles.shape[0]):
        pair, segment = int(tiles[k, 0]), int(tiles[k, 1])
        need, smallest = t.need[pair], u.smallest[segment]
        before, left = found.total[0], 1
        waiting[0, 0], waiting[0, 1] = tiles[k, 2], tiles[k, 3]
        while left > 0:
            left -= 1
            low, high = waiting[left, 0], waiting[left, 1]
            gap = bound_tile(pair, segment, low, high, need, u, p, t)
            label = UNKNOWN
            if gap.lower >= need:
                label = FREE
            elif gap.upper < need:
                label = TOUCHING
            elif is_halved(high - low, smallest, need, gap, t):
                middle = 0.5 * (low + high)
                waiting[left, 0], waiting[left, 1] = middle, high
                waiting[left + 1, 0], waiting[left + 1, 1] = low, middle
                left += 2
                continue
            at = found.total[0]
            if at == found.rows.shape[0]:
                found.total[0] = before
                return k
            row = found.rows[at]
            row[PAIR], row[SEGMENT], row[LOW], row[HIGH] = pair, segment, low, high
            row[LABEL], row[LOWER], row[UPPER] = label, gap.lower, gap.upper
            found.total[0] = at + 1
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
        tiles: Leaves, with their group in the place of the label, shape (k, COLUMNS).
        tolerance: Difference that does not count; see DEEP [m].
        plan: Ledger of the plan.
        links: Ledger of the links.
        tube: Ledger of the tube.
        best: Overwritten: what the least distance is not above and not below, pair,
            segment, and share where it is not above; infinite distances where there is
            no tile; shape (g, 5).
    """
    p, t, u = open_plan(plan), open_links(links), open_tube(tube)
    waiting = numba.carray(stack(PLACES), (WAITING, 3), np.float64)
    for k in range(best.shape[0]):
        best[k, 0] = best[k, 1] = inf
    for k in range(tiles.shape[0]):
        row, own = tiles[k], best[int(tiles[k, LABEL])]
        if row[UPPER] < own[0]:
            own[0], own[2], own[3] = row[UPPER], row[PAIR], row[SEGMENT]
            own[4] = 0.5 * (row[LOW] + row[HIGH])
    for k in range(tiles.shape[0]):
        pair, segment = int(tiles[k, PAIR]), int(tiles[k, SEGMENT])
        own, left = best[int(tiles[k, LABEL])], 1
        waiting[0, 0], waiting[0, 1] = tiles[k, LOW], tiles[k, HIGH]
        waiting[0, 2] = tiles[k, LOWER]
        while left > 0:
            left -= 1
            low, high, known = waiting[left, 0], waiting[left, 1], waiting[left, 2]
            slack = tolerance + DEEP * max(-own[0], 0.0)
            if known >= own[0] - slack:
                own[1] = min(own[1], known)
                continue
            gap = bound_tile(pair, segment, low, high, own[0] - slack, u, p, t)
            if gap.upper < own[0]:
                own[0], own[2], own[3] = gap.upper, pair, segment
                own[4] = 0.5 * (low + high)
            lower = max(known, gap.lower)
            split = high - low > FINEST and gap.upper - gap.found > 0.5 * slack
            if lower >= own[0] - slack or not split:
                own[1] = min(own[1], lower)
                continue
            middle = 0.5 * (low + high)
            waiting[left, 0], waiting[left, 1], waiting[left, 2] = middle, high, lower
            left += 1
            waiting[left, 0], waiting[left, 1], waiting[left, 2] = low, middle, lower
            left += 1
