"""Extremes of a depth image over tiles.

Level k has tiles of 2ᵏ × 2ᵏ pixels. A window is 3 × 3 tiles: a rectangle of the image
that is at most two tiles wide and high lies in the window about the tile of its middle,
and one look-up bounds its depths.
"""

from typing import NamedTuple

import numpy as np

from armguard.cells.state import Singles
from armguard.kernel import kernel
from armguard.table import IntVector, LongMatrix, LongVector, opener, table


@table
class Pyramid(NamedTuple):
    """A depth image, and its extremes over tiles and windows; 0 where it is invalid.

    Attributes:
        levels: Of each level: place of its first number in the arrays below, rows and
            columns of tiles, shape (levels, 3).
        least: Least depth of each tile; level 0 is the image [m].
        most: Greatest depth of each tile, from level 1 on [m].
        least_near: Least depth of the window about each tile [m].
        most_near: Greatest depth of it, from level 2 on [m].
        row: Scratch for a row of tiles.
        codes: Scratch for the cells of a row of pixels.
    """

    levels: LongMatrix
    least: Singles
    most: Singles
    least_near: Singles
    most_near: Singles
    row: Singles
    codes: IntVector


def empty_pyramid(rows: int, columns: int) -> Pyramid:
    """Room for an image of this size, up to a level of one tile, and two at least."""
    levels = []
    first = 0
    while True:
        levels.append((first, rows, columns))
        first += rows * columns
        if len(levels) > 2 and rows == columns == 1:
            break
        rows, columns = (rows + 1) // 2, (columns + 1) // 2
    least, most, least_near, most_near = (
        np.zeros(first, dtype=np.float32) for _ in range(4)
    )
    wide = levels[0][2]
    return Pyramid(
        np.array(levels, dtype=np.int64), least, most, least_near, most_near,
        np.zeros(wide, dtype=np.float32), np.zeros(wide, dtype=np.int32),
    )  # fmt: skip


pyramid_of = opener(Pyramid)


@kernel
def less(a: np.float32, b: np.float32) -> np.float32:
    """The smaller one; an invalid depth is 0, and so the smallest."""
    return a if a < b else b


@kernel
def more(a: np.float32, b: np.float32) -> np.float32:
    """The larger one."""
    return a if a > b else b


@kernel
def copy_valid(image: Singles, out: Singles) -> None:
    """Copy depths; what is not a positive finite number becomes 0."""
    for k in range(image.shape[0]):
        depth = image[k]
        out[k] = depth if np.float32(0.0) < depth < np.float32(np.inf) else 0.0


@kernel
def halve(k: int, largest: bool, fine: Singles, out: Pyramid) -> None:
    """Extremes over the tiles of level k, from those of the level below."""
    first, rows, columns = out.levels[k, 0], out.levels[k, 1], out.levels[k, 2]
    below, high, wide = out.levels[k - 1, 0], out.levels[k - 1, 1], out.levels[k - 1, 2]
    all_tiles = out.most if largest else out.least
    tiles = all_tiles[first : first + rows * columns]
    for i in range(rows):
        upper = fine[below + 2 * i * wide : below + (2 * i + 1) * wide]
        at = below + min(2 * i + 1, high - 1) * wide
        lower = fine[at : at + wide]
        into = tiles[i * columns : (i + 1) * columns]
        for j in range(wide // 2):
            a, b, c, d = upper[2 * j], upper[2 * j + 1], lower[2 * j], lower[2 * j + 1]
            if largest:
                into[j] = more(more(a, b), more(c, d))
            else:
                into[j] = less(less(a, b), less(c, d))
        if wide % 2 == 1:
            a, b = upper[wide - 1], lower[wide - 1]
            into[columns - 1] = more(a, b) if largest else less(a, b)


@kernel
def widen(k: int, largest: bool, out: Pyramid) -> None:
    """Extremes over the windows of level k."""
    first, rows, columns = out.levels[k, 0], out.levels[k, 1], out.levels[k, 2]
    tiles = out.most if largest else out.least
    windows = out.most_near if largest else out.least_near
    row = out.row[:columns]
    for i in range(rows):
        before = tiles[first + max(i - 1, 0) * columns :][:columns]
        here = tiles[first + i * columns :][:columns]
        after = tiles[first + min(i + 1, rows - 1) * columns :][:columns]
        into = windows[first + i * columns :][:columns]
        for j in range(columns):
            if largest:
                row[j] = more(here[j], more(before[j], after[j]))
            else:
                row[j] = less(here[j], less(before[j], after[j]))
        into[0], into[columns - 1] = row[0], row[columns - 1]
        for j in range(columns - 1):
            into[j] = more(row[j], row[j + 1]) if largest else less(row[j], row[j + 1])
        for j in range(1, columns):
            a, b = into[j], row[j - 1]
            into[j] = more(a, b) if largest else less(a, b)


@kernel(inline=False, entry=True)
def fill_pyramid(image: Singles, lines: LongVector) -> None:
    """Extremes of an image over tiles and windows.

    Args:
        image: Depths by rows, shape (rows · columns,) [m].
        lines: Lines of `Pyramid`, overwritten.
    """
    p = pyramid_of(lines)
    copy_valid(image, p.least)
    for k in range(p.levels.shape[0]):
        if k > 0:
            halve(k, False, p.least, p)
            halve(k, True, p.least if k == 1 else p.most, p)
        widen(k, False, p)
        if k > 1:
            widen(k, True, p)
