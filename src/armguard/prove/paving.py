"""Where links are nearer than they may be in tubes, how near, and a proof of the rest.

A box of one to four parameters, each with a tube of the joints that follow it, is cut
into tiles. Lanes drop every pair of primitives that is surely apart in
eight tiles at once. A tile of two links that is left is halved until it is decided. So
every time of every checked pair is in a tile that is proven free, or in one that is
not, and touching is assumed wherever nothing is proven.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.batch.tiles import BoxSearch
from armguard.prove.scene_links import SceneLinks
from armguard.prove.tile_search import (
    FREE,
    LABEL,
    LEVELS,
    LOWER,
    PAIR,
    PARAMETERS,
    PLACE,
    UPPER,
    Leaves,
    Waiting,
    decide_tiles,
    least_in_tiles,
)
from armguard.prove.tube import Tube, tube_table
from armguard.prove.tube_tiles import HIGH, LOW, SPAN, TubeTable, tile_boxes
from armguard.table import Ledger

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# The joints turn at most this much in all in a tile that lanes judge [rad or m].
TURN = 0.2

# Of a box of several parameters, more tiles than this are not judged at first.
MOST_TILES = 100_000

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
            the order of time, shape (l, PLACE + SPAN).
    """

    tiles: Floats
    open: Longs
    pairs: Longs
    leaves: Floats


@dataclass(frozen=True, slots=True)
class BoxPaving:
    """Tiles of a box of parameters that hold all of it.

    Attributes:
        leaves: Decided tiles, see `tile_search`; segments are those of each
            parameter's own tube, shape (l, PLACE + SPAN · d).
        open: Leaf and pair of each pair that is not decided in it, shape (m, 2).
        pairs: The pairs of links that may be too near somewhere, shape (c, 2).
    """

    leaves: Floats
    open: Longs
    pairs: Longs


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
        tiles, table = tube.tiles(TURN), tube_table([tube], resolution)
        tile, pair, pairs = self._open(tiles, table)
        order = np.lexsort((tile, pair))
        tile, pair = tile[order], pair[order]
        need = self.links.buffers(pairs)
        return Paving(
            tiles=tiles,
            open=np.column_stack((tile, pairs[pair])),
            pairs=pairs,
            leaves=self._decide(tiles[tile], pair, pairs, need, table),
        )

    def pave_box(
        self,
        tubes: Sequence[Tube],
        owner: NDArray[np.intp],
        resolution: float,
        *,
        turn: float = TURN,
    ) -> BoxPaving:
        """Decide for all values of some parameters which pairs keep their buffer.

        Args:
            tubes: One for each parameter, one to four.
            owner: The parameter that each joint follows, shape (n,).
            resolution: Of each parameter, what is not divided further.
            turn: The joints of a parameter turn at most this much in all in a tile that
                lanes judge, unless that makes too many [rad or m].
        """
        assert 1 <= len(tubes) <= PARAMETERS
        table = tube_table(tubes, resolution, owner)
        tiles = tiles_of(tubes, turn)
        tile, pair, pairs = self._open(tiles, table)
        first = np.searchsorted(tile, np.arange(len(tiles) + 1))
        need = self.links.buffers(pairs)
        leaves, undecided = self._decided(tiles, first, pair, pairs, need, table)
        begin = 0
        for d, tube in enumerate(tubes):
            leaves[:, PLACE + SPAN * d] -= begin
            begin += len(tube.control)
        return BoxPaving(leaves, undecided, pairs)

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
        pairs, table = paving.pairs, tube_table([tube], resolution)
        group, start, end = runs(near, tube)
        nearest = self._nearest(near, group, pairs, tube)
        touching = np.array([place.bound <= 0.0 for place in nearest])
        maybe = near[touching[group]]
        own_pair = maybe[:, PAIR].astype(np.int64)
        none = np.zeros(len(pairs))
        within = self._decide(maybe[:, PLACE:], own_pair, pairs, none, table)
        within = within[within[:, LABEL] != FREE]
        begin = tube.time(within[:, PLACE].astype(np.intp), within[:, PLACE + LOW])
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
        tile = np.array([[0.0, 0.0, -inf, inf, segment[0], low, low + 1e-6]])
        pairs = self.links.ends_of(self.links.pairs_of(first))
        [place] = self._nearest(tile, np.zeros(1, dtype=np.intp), pairs, tube)
        tiles = tube.tiles(TURN)
        boxes = boxes_of(tiles, tube_table([tube], 0.0))
        found, bound = self._boxes.pairs(*boxes, place.distance, 0)
        if not len(found):
            return place
        order = np.argsort(bound, kind="stable")
        found, bound = found[order], bound[order]
        known, pair = np.unique(self.links.pairs_of(found[:, 1:]), return_inverse=True)
        leaves = np.zeros((len(found), PLACE + SPAN))
        leaves[:, PAIR], leaves[:, PLACE:] = pair, tiles[found[:, 0]]
        leaves[:, LOWER], leaves[:, UPPER] = bound, inf
        one = np.zeros(len(leaves), dtype=np.intp)
        return self._nearest(leaves, one, self.links.ends_of(known), tube)[0]

    def _open(
        self, tiles: Floats, table: TubeTable
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Longs]:
        """Tile and pair of what lanes leave open, by tile; the links of all pairs."""
        found, _ = self._boxes.pairs(*boxes_of(tiles, table), 0.0, 1)
        number = self.links.pairs_of(found[:, 1:])
        known, pair = np.unique(number, return_inverse=True)
        code = np.unique(found[:, 0] * max(len(known), 1) + pair)
        return *np.divmod(code, max(len(known), 1)), self.links.ends_of(known)

    def _decide(
        self, tiles: Floats, pair: Longs, pairs: Longs, need: Floats, table: TubeTable
    ) -> Floats:
        """Leaves of tiles of one pair each, see `decide_tiles`."""
        first = np.arange(len(tiles) + 1)
        return self._decided(tiles, first, pair, pairs, need, table)[0]

    def _decided(
        self,
        tiles: Floats,
        first: Longs,
        open_pairs: Longs,
        pairs: Longs,
        need: Floats,
        table: TubeTable,
    ) -> tuple[Floats, Longs]:
        """Leaves of tiles, and what is not decided, see `decide_tiles`."""
        count = int(np.diff(first).max(initial=1))
        waiting = Ledger(waiting_of(tiles.shape[1], count))
        links, tube = self.links.ledger(pairs, need, table.owner), Ledger(table)
        room, at, total = max(2 * len(tiles), 1024), 0, 0
        rows = [np.empty((0, PLACE + tiles.shape[1]))]
        undecided = [np.empty((0, 2), dtype=np.int64)]
        tiles = np.ascontiguousarray(tiles)
        open_pairs = np.ascontiguousarray(open_pairs)
        while at < len(tiles):
            leaves = Leaves(
                total=np.zeros(2, dtype=np.int64),
                rows=np.empty((room, rows[0].shape[1])),
                open=np.empty((room, 2), dtype=np.int64),
            )
            ledgers = self._world, links, tube, waiting, Ledger(leaves)
            lines = (ledger.lines for ledger in ledgers)
            at += decide_tiles(tiles[at:], first[at:], open_pairs, *lines)
            leaf_count, open_count = leaves.total
            rows.append(leaves.rows[:leaf_count])
            undecided.append(leaves.open[:open_count] + np.array([total, 0]))
            total, room = total + leaf_count, 2 * room
        return np.concatenate(rows), np.concatenate(undecided)

    def _nearest(
        self, leaves: Floats, group: NDArray[np.intp], pairs: Longs, tube: Tube
    ) -> list[NearestPlace]:
        """Where links are nearest in each group of leaves."""
        # The most promising first: what they come down to rules out the others.
        order = np.lexsort((leaves[:, LOWER], leaves[:, UPPER], group))
        given = leaves[order]
        given[:, LABEL] = group[order]
        best = np.zeros((int(group.max()) + 1, 5))
        table = tube_table([tube], 0.0)
        links = self.links.ledger(pairs, np.zeros(len(pairs)), table.owner)
        tolerance = WIDE_TOLERANCE if tube.wide.any() else TOLERANCE
        world, place = self._world.lines, Ledger(table)
        least_in_tiles(given, tolerance, world, links.lines, place.lines, best)
        times = tube.time(best[:, 3].astype(np.intp), best[:, 4])
        found = []
        for (distance, bound, pair, _, _), time in zip(best, times, strict=True):
            a, b = pairs[int(pair)]
            names = self.links.names[a], self.links.names[b]
            found.append(
                NearestPlace(*names, float(distance), float(bound), float(time))
            )
        return found


def tiles_of(tubes: Sequence[Tube], turn: float) -> Floats:
    """First tiles of a box of parameters, shape (k, SPAN · d).

    Args:
        tubes: One for each parameter.
        turn: See `Tube.tiles`; it is doubled while there are more than MOST_TILES.
    """
    while True:
        each = [tube.tiles(turn) for tube in tubes]
        count = np.prod([len(tiles) for tiles in each], dtype=float)
        if count <= MOST_TILES or all(
            len(tiles) == len(tube.control)
            for tiles, tube in zip(each, tubes, strict=True)
        ):
            break
        turn *= 2.0
    begin = 0
    for tiles, tube in zip(each, tubes, strict=True):
        tiles[:, 0] += begin
        begin += len(tube.control)
    places = np.indices([len(tiles) for tiles in each]).reshape(len(each), -1)
    return np.hstack([tiles[k] for tiles, k in zip(each, places, strict=True)])


def waiting_of(width: int, count: int) -> Waiting:
    """Room for tiles that wait, of so many numbers and with at most `count` pairs."""
    parameters = width // SPAN
    room = LEVELS * parameters + 2
    return Waiting(
        size=np.zeros(1, dtype=np.int64),
        tiles=np.zeros((room, width)),
        lists=np.zeros((room, 2), dtype=np.int64),
        pairs=np.zeros((room + 1) * count, dtype=np.int64),
        tile=np.zeros(width),
        ways=np.ones(parameters),
    )


def boxes_of(tiles: Floats, table: TubeTable) -> tuple[Floats, Floats]:
    """Boxes of joint positions that hold tubes in each tile.

    Returns:
        Middles and half widths of the boxes, shape (k, n).
    """
    middles, halves = np.empty((2, len(tiles), table.wide.shape[1]))
    scratch = np.zeros((2, middles.shape[1]))
    tile_boxes(tiles, Ledger(table).lines, middles, halves, scratch)
    return middles, halves


def runs(
    leaves: Floats, tube: Tube
) -> tuple[NDArray[np.intp], list[float], list[float]]:
    """Leaves of one pair that follow one another without a gap.

    Returns:
        The run of each leaf, shape (k,), and the start and end of each run [s].
    """
    segment = leaves[:, PLACE].astype(np.intp)
    start = tube.time(segment, leaves[:, PLACE + LOW])
    end = tube.time(segment, leaves[:, PLACE + HIGH])
    goes_on = (leaves[1:, PAIR] == leaves[:-1, PAIR]) & (start[1:] == end[:-1])
    first = np.flatnonzero(np.concatenate(([True], ~goes_on)))
    group = np.zeros(len(leaves), dtype=np.intp)
    group[first[1:]] = 1
    last = np.concatenate((first[1:], [len(leaves)])) - 1
    return np.cumsum(group), start[first].tolist(), end[last].tolist()
