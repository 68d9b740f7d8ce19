"""Joint-space table: which static primitives a link may be near, by joint positions."""

from math import ceil

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.index.brute_force import BruteForce
from armguard.index.joint_bounds import MOST_JOINTS, JointLinks, Search
from armguard.index.joint_cells import (
    BITS,
    JointCells,
    locate_cells,
    table_candidates,
)
from armguard.index.joint_fill import Filling, fill_cells
from armguard.index.octree_state import ABSENT
from armguard.index.world import World
from armguard.table import Ledger

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Most memory of the bits [bytes], and cells of a link on average.
MEMORY = 64 << 20
CELLS = 7168

# Factor by which the displacement in a cell is lowered until the memory is used up.
FINER = 0.97


class JointTable(BruteForce):
    """Index of static primitives by the joint positions of the links.

    The positions of the first joints of a link's chain are divided into cells. A bit of
    a cell says that the link may be near a primitive somewhere in the cell. Primitives
    without a bit, such as those of other robots, are always candidates. A configuration
    that is in no cell has all primitives as candidates.

    Args:
        world: Primitives of the index.
        links: Links, with their chains and parts.
        columns: Static primitives, shape (c,). They may be inserted, moved and removed.
        reach: Distance up to which a primitive is near [m].
        memory: Most memory of the bits [bytes].
        cells: Most cells of a link on average.

    References:
        Yu and Khalil, as cited by the paper; see docs/paper.md.
    """

    def __init__(
        self,
        world: World,
        links: JointLinks,
        columns: Ints,
        *,
        reach: float,
        memory: int = MEMORY,
        cells: int = CELLS,
    ) -> None:
        super().__init__(world)
        self.links, self.reach = links, reach
        words = max(ceil(len(columns) / BITS), 1)
        most = min(memory // (8 * words), cells * len(links.joints))
        counts = cell_counts(links, most)
        rows = counts.astype(np.int64).prod(axis=1)
        span = np.where(counts > 1, links.upper - links.lower, np.inf)
        others = np.setdiff1d(np.arange(len(world.kinds)), columns)
        self.cells = JointCells(
            **{name: getattr(links, name) for name in links._fields[:5]},
            counts=counts,
            per_unit=counts / span,
            first_row=np.cumsum(rows) - rows,
            row=np.full(len(counts), -1, dtype=np.int64),
            bits=np.zeros((int(rows.sum()), words), dtype=np.int64),
            stale=np.zeros(words, dtype=np.int64),
            columns=columns,
            others=others.astype(np.int32),
        )
        self._search = search_of(links, counts, len(columns))
        self._column = np.full(len(world.kinds), -1, dtype=np.int32)
        self._column[columns] = range(len(columns))
        self._filled = np.full(world.rows.shape, np.nan)
        self.cells.stale[:] = (1 << BITS) - 1
        self.refresh()

    def insert(self, i: int) -> None:
        """Add primitive i, at its present row."""
        super().insert(i)
        self.update(i)

    def update(self, i: int) -> None:
        """Note that primitive i moved: it is a candidate of all links until `refresh`.

        Nothing happens for the primitives of links; `locate` has to follow these.
        """
        column = int(self._column[i])
        if column < 0:
            return
        moved = (self._filled[i] != self.world.rows[i]).any()
        mask = 1 << column % BITS
        word = int(self.cells.stale[column // BITS])
        self.cells.stale[column // BITS] = word | mask if moved else word & ~mask

    def refresh(self) -> None:
        """Write the bits of all primitives that moved since they were written."""
        moved = [k for k in range(len(self.cells.columns)) if self._is_stale(k)]
        self._fill(np.array(moved, dtype=np.int32), self.cells)
        ids = self.cells.columns[moved]
        self._filled[ids] = self.world.rows[ids]
        self.cells.stale[:] = 0

    def locate(self, q: Floats) -> None:
        """Take over a configuration, shape (n,) [rad or m]."""
        locate_cells(q, self.cells)

    def candidates(self, i: int) -> Ints:
        """Ids of primitives that may be near primitive i, ascending, without i."""
        found = table_candidates(i, self.cells, self.residency, self._out)
        return np.sort(self._out[:found])

    def check(self) -> None:
        """Check that a table which is filled anew has the same bits.

        Raises:
            OctreeError: The bits differ, or a status is invalid.
        """
        super().check()
        fresh = self.cells._replace(bits=np.zeros_like(self.cells.bits))
        present = self.residency["status"][self.cells.columns] != ABSENT
        known = [k for k in np.flatnonzero(present).tolist() if not self._is_stale(k)]
        masks = np.zeros_like(self.cells.stale)
        for k in known:
            masks[k // BITS] |= 1 << k % BITS
        self._fill(np.array(known, dtype=np.int32), fresh)
        if not np.array_equal(fresh.bits, self.cells.bits & masks):
            raise OctreeError("the table is not that of the present primitives")

    def statistics(self) -> dict[str, object]:
        """Numbers of primitives, links and cells, bits set, and bytes."""
        bits = self.cells.bits
        return {
            **super().statistics(),
            "kind": "joint_table",
            "links": len(self.cells.row),
            "cells": len(bits),
            "near_in_a_cell": float(np.bitwise_count(bits).sum() / max(len(bits), 1)),
            "bytes": bits.nbytes,
        }

    def _is_stale(self, column: int) -> bool:
        """Whether the bits of a column are those of another place."""
        return bool(int(self.cells.stale[column // BITS]) >> column % BITS & 1)

    def _fill(self, columns: Ints, cells: JointCells) -> None:
        """Write the bits of some columns for the present rows of their primitives."""
        filling = Filling(columns, self.world, self.links, cells, self._search)
        fill_cells(self.reach, Ledger(filling).lines)


def cell_counts(links: JointLinks, most: int) -> Ints:
    """Number of cells along each joint of each link, shape (l, j).

    The cells of all joints and links let a link move about equally far, as little as
    the number of cells allows.

    Args:
        links: The links.
        most: Most cells of all links together; at least one cell a link is made.
    """
    divided = (links.joints >= 0) & (np.arange(links.joints.shape[1]) < MOST_JOINTS)
    ways = np.where(divided, (links.upper - links.lower) * links.levers, 0.0)
    counts = np.ones(ways.shape, dtype=np.int32)
    way = ways.max(initial=0.0)
    while way > 0.0:
        finer = np.maximum(np.ceil(ways / way), 1.0)
        if finer.prod(axis=1).sum() > most:
            break
        counts, way = finer.astype(np.int32), way * FINER
    return counts


def search_of(links: JointLinks, counts: Ints, columns: int) -> Search:
    """Scratch of a search for some columns."""
    depth = int(np.ceil(np.log2(counts)).sum(axis=1).max(initial=0.0)) + 2
    joints, parts = links.joints.shape[1], len(links.kinds)
    bodies = int(np.diff(links.first_body).max(initial=0))
    return Search(
        stack=np.zeros((depth, 2 * MOST_JOINTS + 1), dtype=np.int32),
        near=np.zeros((depth, columns), dtype=np.int32),
        near_count=np.zeros(depth, dtype=np.int32),
        q=np.zeros(joints),
        half=np.zeros(joints),
        gain=np.zeros(joints),
        T=np.zeros((bodies, 12)),
        placed=np.zeros((parts, 16)),
        points=np.zeros((parts, 6)),
        motion=np.zeros(parts),
        rates=np.zeros((parts * bodies, 8)),
        coarse=np.zeros(parts),
        spare=np.zeros(parts),
        witness=np.zeros(WITNESS_WIDTH),
    )
