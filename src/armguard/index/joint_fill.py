"""Search that fills a joint-space table, by boxes of cells that are divided."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.index.joint_bounds import (
    MOST_JOINTS,
    SLACK,
    JointLinks,
    Search,
    bracket,
    place_box,
)
from armguard.index.joint_cells import BITS, JointCells
from armguard.index.world import World
from armguard.kernel import kernel
from armguard.table import IntVector, opener, table

Longs = NDArray[np.int64]


@table
class Filling(NamedTuple):
    """What fills a table.

    Attributes:
        columns: The columns to fill, shape (c,).
        world: The primitives.
        links: The links.
        cells: The table.
        search: Scratch.
    """

    columns: IntVector
    world: World
    links: JointLinks
    cells: JointCells
    search: Search


open_filling = opener(Filling)


@kernel(inline=False, entry=True)
def fill_cells(reach: float, lines: Longs) -> None:
    """Write the bits of some columns in all cells.

    Args:
        reach: Distance up to which a primitive counts as near [m].
        lines: Ledger of a `Filling`.
    """
    f = open_filling(lines)
    columns, bits, counts, search = f.columns, f.cells.bits, f.cells.counts, f.search
    for k in range(columns.shape[0]):
        column = int(columns[k])
        w, mask = column // BITS, ~(1 << column % BITS)
        for row in range(bits.shape[0]):
            bits[row, w] &= mask
        search.near[0, k] = column
    search.near_count[0] = columns.shape[0]
    for link in range(counts.shape[0]):
        box = search.stack[0]
        for s in range(MOST_JOINTS):
            box[s] = 0
            box[MOST_JOINTS + s] = counts[link, s] if s < counts.shape[1] else 1
        box[2 * MOST_JOINTS] = 0
        height = 1
        while height > 0:
            height = search_box(link, height - 1, reach, f)


@kernel
def search_box(link: int, top: int, reach: float, f: Filling) -> int:
    """Decide the columns of the box on the stack's top, or divide it.

    A column is decided where no configuration of the box is near, or where a division
    would hardly show that for any of its cells, or where the box is one cell.

    Args:
        link: The link.
        top: Place of the box in the stack.
        reach: See `fill_cells`.
        f: The table is written.

    Returns:
        New height of the stack.
    """
    cells, search = f.cells, f.search
    stack, near = search.stack, search.near
    depth = stack[top, 2 * MOST_JOINTS]
    split = place_box(link, top, f.links, cells, search)
    left = 0
    for k in range(search.near_count[depth]):
        column = int(near[depth, k])
        i = cells.columns[column]
        least, best = bracket(link, i, reach, f.world, f.links, search)
        if least > reach + SLACK:
            continue
        if split < 0 or best <= reach:
            set_bits(link, top, column, search, cells)
        else:
            near[depth + 1, left] = column
            left += 1
    if left == 0:
        return top
    search.near_count[depth + 1] = left
    middle = (stack[top, split] + stack[top, MOST_JOINTS + split]) // 2
    for s in range(2 * MOST_JOINTS):
        stack[top + 1, s] = stack[top, s]
    stack[top, MOST_JOINTS + split] = middle
    stack[top + 1, split] = middle
    stack[top, 2 * MOST_JOINTS] = stack[top + 1, 2 * MOST_JOINTS] = depth + 1
    return top + 2


@kernel
def set_bits(
    link: int, top: int, column: int, search: Search, cells: JointCells
) -> None:
    """Set the bit of a column in all cells of the box on the stack's top."""
    box, counts = search.stack[top], cells.counts[link]
    w, mask = column // BITS, 1 << (column % BITS)
    n1 = counts[1] if counts.shape[0] > 1 else 1
    n2 = counts[2] if counts.shape[0] > 2 else 1
    n3 = counts[3] if counts.shape[0] > 3 else 1
    for a in range(box[0], box[4]):
        for b in range(box[1], box[5]):
            for c in range(box[2], box[6]):
                row = cells.first_row[link] + ((a * n1 + b) * n2 + c) * n3
                for d in range(box[3], box[7]):
                    cells.bits[row + d, w] |= mask
