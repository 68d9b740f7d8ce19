"""Cells of joint positions, with a bit for each primitive that a link may be near.

A cell belongs to a link. The cell of a link is found by its joint positions alone.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.index.octree_query import present_primitives
from armguard.index.octree_state import ABSENT, Residency
from armguard.kernel import kernel
from armguard.lanes import lowest
from armguard.record import Records
from armguard.table import IntMatrix, IntVector, LongMatrix, LongVector, Matrix, Vector

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Primitives in a word; its sign is not used.
BITS = 63

# Position of a joint without limits beyond which rounding is no longer small [rad].
FARTHEST = 1e6


class JointCells(NamedTuple):
    """The table, and the cell of each link at the present configuration.

    Attributes:
        link_of: See `JointLinks`, to `period`.
        joints: Places in q.
        lower: Least positions.
        upper: Greatest positions.
        period: Turns.
        counts: Number of cells along each joint, shape (l, j).
        per_unit: Cells in a unit of each joint, shape (l, j) [1/rad or 1/m].
        first_row: First row of each link in `bits`, shape (l,).
        row: Row of each link at the present configuration; -1 if that is in no cell,
            shape (l,).
        bits: Primitives that a link may be near, a bit each, shape (cells, words).
        stale: Primitives whose bits are those of another place, shape (words,).
        columns: Primitive of each bit, shape (c,).
        others: Primitives without a bit, which are always candidates.
    """

    link_of: IntVector
    joints: IntMatrix
    lower: Matrix
    upper: Matrix
    period: Matrix
    counts: IntMatrix
    per_unit: Matrix
    first_row: LongVector
    row: LongVector
    bits: LongMatrix
    stale: LongVector
    columns: IntVector
    others: IntVector


@kernel(inline=False, entry=True)
def locate_cells(q: Vector, cells: JointCells) -> None:
    """Write the row of each link at a configuration, -1 where it is in no cell.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        cells: The table; `row` is overwritten.
    """
    joints, lower, upper = cells.joints, cells.lower, cells.upper
    for link in range(joints.shape[0]):
        row = 0
        for s in range(joints.shape[1]):
            j = joints[link, s]
            if j < 0:
                break
            x = q[j]
            period = cells.period[link, s]
            if period > 0.0 and abs(x) <= FARTHEST:
                x -= period * np.floor((x - lower[link, s]) / period)
            if not lower[link, s] <= x <= upper[link, s]:
                row = -1
                break
            count = cells.counts[link, s]
            if count > 1:
                k = int((x - lower[link, s]) * cells.per_unit[link, s])
                row = row * count + min(k, count - 1)
        cells.row[link] = row + cells.first_row[link] if row >= 0 else -1


@kernel(entry=True)
def table_candidates(
    i: int, cells: JointCells, residency: Records[Residency], out: Ints
) -> int:
    """Present primitives that primitive i may be near, each once.

    Args:
        i: The primitive.
        cells: The table, with the rows of the present configuration.
        residency: Which primitives are present, shape (p,).
        out: Ids, overwritten, shape (p,).

    Returns:
        Number of ids in `out`.
    """
    link = cells.link_of[i]
    row = cells.row[link] if link >= 0 else -1
    if row < 0:
        return int(present_primitives(i, residency, out))
    count = 0
    for w in range(cells.bits.shape[1]):
        word = cells.bits[row, w] | cells.stale[w]
        while word != 0:
            j = cells.columns[BITS * w + lowest(word)]
            word &= word - 1
            if residency[j].status != ABSENT:
                out[count] = j
                count += 1
    for k in range(cells.others.shape[0]):
        j = cells.others[k]
        if j != i and residency[j].status != ABSENT:
            out[count] = j
            count += 1
    return count


def no_cells() -> JointCells:
    """Table of no links, for a cycle with another index."""
    pairs = np.zeros((0, 1))
    return JointCells(
        link_of=np.zeros(0, dtype=np.int32),
        joints=np.zeros((0, 1), dtype=np.int32),
        lower=pairs,
        upper=pairs,
        period=pairs,
        counts=np.zeros((0, 1), dtype=np.int32),
        per_unit=pairs,
        first_row=np.zeros(0, dtype=np.int64),
        row=np.zeros(0, dtype=np.int64),
        bits=np.zeros((0, 1), dtype=np.int64),
        stale=np.zeros(1, dtype=np.int64),
        columns=np.zeros(0, dtype=np.int32),
        others=np.zeros(0, dtype=np.int32),
    )
