"""How far a tube is proven from some time on, by a bounded part at each call."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.batch.pose import NEAR
from armguard.batch.room import limit_of, place_of, scratch_of, sizes_of
from armguard.batch.scratch import ROOM
from armguard.batch.tiles import OpenPairs, list_boxes
from armguard.lanes import WIDTH
from armguard.prove.paving import TURN, boxes_of, waiting_of
from armguard.prove.scene_links import SceneLinks
from armguard.prove.tile_search import FREE, LABEL, PAIR, PLACE, Leaves, decide_tiles
from armguard.prove.tube import Tube, tube_table
from armguard.prove.tube_tiles import HIGH, LOW, SPAN
from armguard.table import Ledger

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# A call judges at most so many tiles, and halves them into at most so many leaves.
TILES = 64
LEAVES = 128

# Pairs of links that may be open in a tile, and undecided in all leaves of a call.
MOST_PAIRS = 128
MOST_OPEN = 4096


class Frontier:
    """The time until which a tube is proven, from the time of the last restart on.

    Attributes:
        until: That time; infinite where all the rest is proven [s].
        pair: Names of two links that may be too near from then on; empty if none are.
        crowded: Whether more pairs are near then than a call can judge.

    Args:
        checker: A checker of the world; objects may be placed and removed in it, and
            the frontier be restarted then.
        tube: The tube.
        resolution: Time that is not divided further [s].
    """

    def __init__(self, checker: Checker, tube: Tube, resolution: float) -> None:
        self.until, self.pair, self.crowded = float(tube.times[0]), ("", ""), False
        self._tube, self._tiles = tube, tube.tiles(TURN)
        self._share, self._at = 0.0, 0
        segments = self._tiles[:, 0].astype(np.intp)
        self._begins = tube.time(segments, self._tiles[:, LOW])
        table, world = tube_table([tube], resolution), checker.world
        self._boxes = boxes_of(self._tiles, table)
        self._links = links = SceneLinks(checker)
        self._pairs = pairs = pairs_that_move(links, checker.tables.bodies)
        self._pair_of = np.zeros((len(links.names),) * 2, dtype=np.int64)
        self._pair_of[pairs[:, 0], pairs[:, 1]] = np.arange(len(pairs))
        self._pair_of[pairs[:, 1], pairs[:, 0]] = np.arange(len(pairs))
        sizes, limit = sizes_of(world), limit_of(world)
        place, scratch = place_of(NEAR, sizes), scratch_of(ROOM, sizes)
        scratch.arrays[0][...] = 0.0, 1, 0.0, limit
        self._found = OpenPairs(
            total=np.zeros(1, dtype=np.int64),
            pairs=np.zeros((WIDTH * ROOM, 3), dtype=np.int64),
            low=np.zeros(WIDTH * ROOM),
        )
        self._leaves = Leaves(
            total=np.zeros(2, dtype=np.int64),
            rows=np.full((LEAVES, PLACE + SPAN), np.nan),
            open=np.zeros((MOST_OPEN, 2), dtype=np.int64),
        )
        plan = Ledger(world)
        self._of_boxes = plan, place, scratch, Ledger(self._found)
        self._of_tiles = (
            plan,
            links.ledger(pairs, links.buffers(pairs), table.owner),
            Ledger(table),
            Ledger(waiting_of(SPAN, MOST_PAIRS)),
            Ledger(self._leaves),
        )
        # Loads the kernels: no tile has an open pair here.
        self._decide(np.zeros((0, SPAN)), np.zeros(1, dtype=np.int64), pairs[:0, 0])

    def restart(self, time: float) -> None:
        """Begin at a time: nothing after it counts as proven.

        Args:
            time: The time; one outside the tube counts as its nearest end [s].
        """
        time = min(max(time, float(self._tube.times[0])), float(self._tube.times[-1]))
        _, [share] = self._tube.place(np.array([time]))
        at = int(np.searchsorted(self._begins, time, side="right")) - 1
        self.pair, self.crowded = ("", ""), False
        self._begin(at, float(np.clip(share, *self._tiles[at, [LOW, HIGH]])))

    def advance(self) -> None:
        """Prove the next tiles, and stop at the first place that is not proven."""
        if self.until == inf or self.crowded or self.pair[0]:
            return
        start = self._at
        end = self._list_open(start, min(start + TILES, len(self._tiles)))
        tile, pair = self._open_pairs()
        first = np.flatnonzero(np.concatenate(([True], np.diff(tile) > 0)))
        own = tile[first] if len(tile) else tile
        counts = np.diff(np.append(first, len(tile)))
        if len(tile) and counts.max() > MOST_PAIRS:
            full = int(np.argmax(counts > MOST_PAIRS))
            end, own, pair = start + int(own[full]), own[:full], pair[: first[full]]
            first = first[:full]
        if end == start:
            self.crowded = True
        elif len(own):
            self._judge(start + own, np.append(first, len(pair)), pair, end)
        else:
            self._begin(end)

    def _begin(self, at: int, share: float | None = None) -> None:
        """Go on from a tile, or from a share of its segment."""
        if at == len(self._tiles):
            self._at, self.until = at, inf
            return
        segment, low, _ = self._tiles[at]
        self._at, self._share = at, low if share is None else share
        places = np.array([segment], dtype=np.intp), np.array([self._share])
        self.until = float(self._tube.time(*places)[0])

    def _list_open(self, start: int, end: int) -> int:
        """List the pairs that lanes leave open in some tiles; the first not listed."""
        middles, halves = self._boxes
        self._found.total[0] = 0
        given = middles[start:end], halves[start:end]
        ledgers = (ledger.lines for ledger in self._of_boxes)
        return start + int(list_boxes(*given, 0, *ledgers))

    def _open_pairs(self) -> tuple[Longs, Longs]:
        """Tile, counted from the first, and pair of links of what is listed."""
        found = self._found.pairs[: self._found.total[0]]
        one, other = self._links.of_primitive[found[:, 1:]].T
        code = found[:, 0] * len(self._pairs) + self._pair_of[one, other]
        tile, pair = np.divmod(np.unique(code), max(len(self._pairs), 1))
        return tile, pair

    def _judge(self, own: Longs, first: Longs, pair: Longs, end: int) -> None:
        """Judge tiles with open pairs; those up to `end` without one are proven.

        Args:
            own: The tiles, ascending, shape (k,).
            first: First of each tile's pairs, and the end, shape (k + 1,).
            pair: The pairs.
            end: Tile to go on with if all are proven.
        """
        tiles = self._tiles[own]
        if own[0] == self._at:
            tiles[0, LOW] = self._share
        done = self._decide(tiles, first, pair)
        rows = self._leaves.rows
        rows = rows[: np.count_nonzero(rows[:, PLACE + HIGH] >= 0.0)]
        near = np.flatnonzero(rows[:, LABEL] != FREE)
        if len(near):
            row = rows[near[0]]
            segment = int(row[PLACE])
            inside = (self._tiles[own, 0] == segment) & (
                self._tiles[own, HIGH] >= row[PLACE + HIGH]
            )
            self._begin(int(own[np.argmax(inside)]), float(row[PLACE + LOW]))
            a, b = self._pairs[int(row[PAIR])]
            self.pair = self._links.names[a], self._links.names[b]
        elif done == len(own):
            self._begin(end)
        else:
            before, at = (self._at, self._share), int(own[done])
            segment, low, high = tiles[done]
            # The last leaf may be of the tile before, or there is none.
            [last] = rows[-1:, PLACE:] if len(rows) else [tiles[done, [0, LOW, LOW]]]
            goes_on = last[0] == segment and low < last[HIGH] <= high
            self._begin(at, float(last[HIGH] if goes_on else low))
            self.crowded = (self._at, self._share) == before

    def _decide(self, tiles: Floats, first: Longs, pairs: Longs) -> int:
        """Halve tiles as far as there is room; the first that is not decided."""
        self._leaves.total[:] = 0
        self._leaves.rows.fill(np.nan)
        ledgers = (ledger.lines for ledger in self._of_tiles)
        given = np.ascontiguousarray(tiles), first, np.ascontiguousarray(pairs)
        return int(decide_tiles(*given, *ledgers))


def pairs_that_move(links: SceneLinks, bodies: NDArray[np.integer]) -> Longs:
    """Every two links of which one at least is on a body, shape (k, 2).

    Args:
        links: The links.
        bodies: Body of each primitive, -1 for the world.
    """
    moves = np.zeros(len(links.names), dtype=np.bool_)
    moves[links.of_primitive[bodies >= 0]] = True
    one, other = np.triu_indices(len(moves), 1)
    chosen = moves[one] | moves[other]
    return np.column_stack((one[chosen], other[chosen])).astype(np.int64)
