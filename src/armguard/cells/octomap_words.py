"""Cells of a map that the leaves of a tree of OctoMap fill."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.cells.grid import packed
from armguard.cells.octomap import add_boxes, read_leaves
from armguard.cells.state import Words

# Sums of shares of cells are rounded [-].
ROUND_OFF = 1e-4


def tree_words(
    path: Path, centre: NDArray[np.float64], cell: float, size: int
) -> tuple[Words, Words]:
    """Cells that an occupied leaf meets, and other ones that free leaves fill.

    Args:
        path: A `.bt` file; its frame is the world.
        centre: Middle of the map, shape (3,) [m].
        cell: Edge of a cell [m].
        size: Cells along an edge of the map.

    Raises:
        CellMapError: It cannot be read, or is no such tree.
    """
    boxes, occupied = read_leaves(path)
    boxes[:, :3] -= centre - 0.5 * size * cell
    boxes /= cell
    # Faces on those of cells must not fill the neighbours by rounding.
    filled = [np.zeros(size**3, dtype=np.float32) for _ in range(2)]
    for chosen, out in zip((occupied, ~occupied), filled, strict=True):
        add_boxes(np.ascontiguousarray(boxes[chosen]), out)
    hit, free = (out.reshape((size,) * 3).transpose() for out in filled)
    hits = hit > ROUND_OFF
    return packed(hits), packed((free > 1.0 - ROUND_OFF) & ~hits)
