"""Words of cells as arrays of booleans, and back."""

import numpy as np
from numpy.typing import NDArray

from armguard.cells.state import BLOCK_SIDE

Bools = NDArray[np.bool_]

# Order of the axes of a grid, among those of bits in words: block, group, word and cell
# each have z, y, x.
AXES = (2, 5, 8, 11, 1, 4, 7, 10, 0, 3, 6, 9)


def unpacked(words: NDArray[np.uint64], side: int) -> Bools:
    """Cells of words as booleans, shape (side, side, side), by x, y, z."""
    blocks = side // BLOCK_SIDE
    bits = np.unpackbits(words.view(np.uint8), bitorder="little")
    parts = bits.reshape(blocks, blocks, blocks, *(4,) * 9).transpose(AXES)
    return parts.reshape(side, side, side).view(np.bool_)


def packed(cells: Bools) -> NDArray[np.uint64]:
    """Words of a grid of cells; see `unpacked`."""
    blocks = len(cells) // BLOCK_SIDE
    parts = cells.reshape(*((blocks, 4, 4, 4) * 3)).transpose(np.argsort(AXES))
    return np.packbits(parts.reshape(-1), bitorder="little").view(np.uint64)
