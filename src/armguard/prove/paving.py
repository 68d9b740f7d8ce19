"""When links are nearer than they may be in a tube, how near, and a proof of the rest.

The tube is cut into tiles. Lanes drop every pair of primitives that is surely apart in
eight tiles at once. A tile of two links that is left is halved until it is decided. So
every time of every checked pair is in a tile that is proven free, or in one that is
not, and touching is assumed wherever nothing is proven.
"""

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.batch.tiles import BoxSearch
from armguard.prove.scene_links import SceneLinks
from armguard.prove.tile_search import (
    COLUMNS,
    FREE,
    HIGH,
    LABEL,
    LOW,
    LOWER,
    PAIR,
    SEGMENT,
    UPPER,
    Leaves,
    decide_tiles,
    least_in_tiles,
)
from armguard.prove.tube import Tube
from armguard.prove.tube_tiles import TubeTable, tile_boxes
from armguard.table import Ledger

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# The joints turn at most this much in all in a tile that lanes judge [rad or m].
TURN = 0.2

# Distances are sought to within this, and with widths to within the other [m].
TOLERANCE = 1e-5
WIDE_TOLERANCE = 1e-4


@dataclass(frozen=True, slots=True)
class NearestPlace:
    """Where two links are nearest.

    Attributes:
        a: One link or object.
        b: The other.
        distance: Signed distance that they come down to [m].
        bound: Signed distance that they are proven never to be below [m].
        time: Time at which they come down to `distance` [s].
    """

    a: str
    b: str
    distance: float
    bound: float
    time: float


@dataclass(frozen=True, slots=True)
class NearInterval:
    """An interval of time in which two links may be nearer than their buffer.

    Before and after it they are proven not to be. Its ends are within the resolution.

    Attributes:
        start: Its start [s].
        end: Its end [s].
        buffer: What they have to keep [m].
        nearest: Where they are nearest.
        contact: First time at which they may touch; None if they are proven apart [s].
    """

    start: float
    end: float
    buffer: float
    nearest: NearestPlace
    contact: float | None


@dataclass(frozen=True, slots=True)
class Paving:
    """Tiles of a tube that hold all pairs.

    Attributes:
        tiles: Tiles that lanes judged, as in `Tube.tiles`, shape (k, 3).
        open: Tile and both links of each pair that they left open, shape (m, 3).
        pairs: The pairs of links that are open somewhere, shape (c, 2).
        leaves: Tiles of these that are decided, see `tile_search`; by pair, then in
            the order of time, shape (l, COLUMNS).
    """

    tiles: Floats
    open: Longs
    pairs: Longs
    leaves: Floats


class Paver:
    """Proofs over tubes in the world of a checker, as it is when they are asked.

    It writes to arrays of its own: one call at a time.

    Attributes:
        checker: The checker.
        links: The scene's links.
    """

    def __init__(self, checker: Checker) -> None:
        self.checker, self.links = checker, SceneLinks(checker)
        self._boxes, self._world = BoxSearch(checker.world), Ledger(checker.world)

    def pave(self, tube: Tube, resolution: float) -> Paving:
        """Decide for all times which pairs keep their buffer.

        Args:
            tube: The tube.
            resolution: Time that is not divided further [s].
        """
        tiles, middles, halves = boxes_of(tube)
        found, _ = self._boxes.pairs(middles, halves, 0.0, 1)
        code = self.links.pairs_of(found[:, 1:]) * len(tiles) + found[:, 0]
        number, tile = np.divmod(np.unique(code), len(tiles))
        known, pair = np.unique(number, return_inverse=True)
        pairs = self.links.ends_of(known)
        items: Floats = np.column_stack((pair, tiles[tile]))
        need = self.links.buffers(pairs)
        return Paving(
            tiles=tiles,
            open=np.column_stack((tile, pairs[pair])),
            pairs=pairs,
            leaves=self._decide(items, pairs, need, tube.table(resolution)),
        )

    def intervals(
        self, paving: Paving, tube: Tube, resolution: float
    ) -> list[NearInterval]:
        """Intervals of a paving in which a pair is not proven to keep its buffer.

        Args:
            paving: What `pave` found.
            tube: The same tube.
            resolution: The same resolution [s].
        """
        near = paving.leaves[paving.leaves[:, LABEL] != FREE]
        if not len(near):
            return []
        pairs, table = paving.pairs, tube.table(resolution)
        group, start, end = runs(near, tube)
        nearest = self._nearest(near, group, pairs, tube)
        touching = np.array([place.bound <= 0.0 for place in nearest])
        maybe = near[touching[group]]
        within = self._decide(
            maybe[:, [PAIR, SEGMENT, LOW, HIGH]], pairs, np.zeros(len(pairs)), table
        )
        within = within[within[:, LABEL] != FREE]
        begin = tube.time(within[:, SEGMENT].astype(np.intp), within[:, LOW])
        buffers = self.links.buffers(pairs)
        found = []
        for k, place in enumerate(nearest):
            pair = int(near[np.searchsorted(group, k), PAIR])
            own = begin[
                (within[:, PAIR] == pair) & (begin >= start[k]) & (begin < end[k])
            ]
            contact = float(own.min()) if len(own) else None
            found.append(
                NearInterval(start[k], end[k], float(buffers[pair]), place, contact)
            )
        return sorted(found, key=lambda one: (one.start, one.end))

    def least(self, tube: Tube) -> NearestPlace | None:
        """Where a checked pair is nearest in the whole tube; None if there is none."""
        rows = tube.at(tube.times)
        near = self.checker.distances(rows)
        if not (near.a >= 0).any():
            return None
        row = int(np.argmin(near.distance))
        # What primitives have there bounds no distance of exact shapes from above.
        first = np.array([[near.a[row], near.b[row]]], dtype=np.int64)
        segment, share = tube.place(tube.times[[row]])
        low = min(float(share[0]), 1.0 - 1e-6)
        tile = np.array([[0.0, segment[0], low, low + 1e-6, 0.0, -inf, inf]])
        pairs = self.links.ends_of(self.links.pairs_of(first))
        [place] = self._nearest(tile, np.zeros(1, dtype=np.intp), pairs, tube)
        tiles, middles, halves = boxes_of(tube)
        found, bound = self._boxes.pairs(middles, halves, place.distance, 0)
        if not len(found):
            return place
        order = np.argsort(bound, kind="stable")
        found, bound = found[order], bound[order]
        known, pair = np.unique(self.links.pairs_of(found[:, 1:]), return_inverse=True)
        leaves = np.zeros((len(found), COLUMNS))
        leaves[:, PAIR], leaves[:, SEGMENT:LABEL] = pair, tiles[found[:, 0]]
        leaves[:, LOWER], leaves[:, UPPER] = bound, inf
        one = np.zeros(len(leaves), dtype=np.intp)
        return self._nearest(leaves, one, self.links.ends_of(known), tube)[0]

    def _decide(
        self, items: Floats, pairs: Longs, need: Floats, table: TubeTable
    ) -> Floats:
        """Leaves of tiles of pairs, see `decide_tiles`."""
        found = [np.empty((0, COLUMNS))]
        if not len(items):
            return found[0]
        links, tube = self.links.ledger(pairs, need), Ledger(table)
        room, at = max(2 * len(items), 1024), 0
        items = np.ascontiguousarray(items, dtype=np.float64)
        while at < len(items):
            rows = np.empty((room, COLUMNS))
            leaves = Leaves(np.zeros(1, dtype=np.int64), rows)
            ledgers = self._world, links, tube, Ledger(leaves)
            at = decide_tiles(items, at, *(ledger.lines for ledger in ledgers))
            found.append(rows[: leaves.total[0]])
            room *= 2
        return np.concatenate(found)

    def _nearest(
        self, leaves: Floats, group: NDArray[np.intp], pairs: Longs, tube: Tube
    ) -> list[NearestPlace]:
        """Where links are nearest in each group of leaves."""
        # The most promising first: what they come down to rules out the others.
        order = np.lexsort((leaves[:, LOWER], leaves[:, UPPER], group))
        given = leaves[order]
        given[:, LABEL] = group[order]
        best = np.zeros((int(group.max()) + 1, 5))
        links = self.links.ledger(pairs, np.zeros(len(pairs)))
        tolerance = WIDE_TOLERANCE if tube.wide.any() else TOLERANCE
        world, table = self._world.lines, Ledger(tube.table(0.0))
        least_in_tiles(given, tolerance, world, links.lines, table.lines, best)
        times = tube.time(best[:, 3].astype(np.intp), best[:, 4])
        found = []
        for (distance, bound, pair, _, _), time in zip(best, times, strict=True):
            a, b = pairs[int(pair)]
            names = self.links.names[a], self.links.names[b]
            found.append(
                NearestPlace(*names, float(distance), float(bound), float(time))
            )
        return found


def boxes_of(tube: Tube) -> tuple[Floats, Floats, Floats]:
    """Tiles of a tube, and the boxes of joint positions that hold it in each.

    Returns:
        Tiles as in `Tube.tiles`, middles and half widths of the boxes, shape (k, n).
    """
    tiles = tube.tiles(TURN)
    middles, halves = np.empty((2, len(tiles), tube.control.shape[2]))
    bow = np.zeros(middles.shape[1])
    tile_boxes(tiles, Ledger(tube.table(0.0)).lines, middles, halves, bow)
    return tiles, middles, halves


def runs(
    leaves: Floats, tube: Tube
) -> tuple[NDArray[np.intp], list[float], list[float]]:
    """Leaves of one pair that follow one another without a gap.

    Returns:
        The run of each leaf, shape (k,), and the start and end of each run [s].
    """
    segment = leaves[:, SEGMENT].astype(np.intp)
    start = tube.time(segment, leaves[:, LOW])
    end = tube.time(segment, leaves[:, HIGH])
    goes_on = (leaves[1:, PAIR] == leaves[:-1, PAIR]) & (start[1:] == end[:-1])
    first = np.flatnonzero(np.concatenate(([True], ~goes_on)))
    group = np.zeros(len(leaves), dtype=np.intp)
    group[first[1:]] = 1
    last = np.concatenate((first[1:], [len(leaves)])) - 1
    return np.cumsum(group), start[first].tolist(), end[last].tolist()
