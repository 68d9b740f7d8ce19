"""Tiles of a tube: parts of its segments, each a chord and what may be beside it."""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.kernel import kernel
from armguard.table import Matrix, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Most control points of a segment.
MOST_CONTROL = 6


@table
class TubeTable(NamedTuple):
    """Where every joint may be in each segment: a polynomial, plus or minus a width.

    Attributes:
        control: Bernstein control points of the segments one after another, shape
            (s · (degree + 1), n) [rad or m].
        wide: How far each joint may leave its curve in each segment, shape (s, n).
        smallest: Shares of each segment below which a tile is not split, shape (s,).
    """

    control: Matrix
    wide: Matrix
    smallest: Vector


open_tube = opener(TubeTable)


@kernel(inline=False)
def take_tile(
    segment: int,
    low: float,
    high: float,
    tube: TubeTable,
    q: Floats,
    line: Floats,
    bow: Floats,
) -> None:
    """Write the chord of a part of a segment, and how far its curve may leave that.

    The control points of the part are found by de Casteljau's rule. The curve differs
    from its chord by a polynomial whose control points are the differences to points
    of the chord in equal steps, and is within their hull.

    Args:
        segment: The segment.
        low: Share of the segment where the part begins, in [0, 1].
        high: Share where it ends, above `low`.
        tube: The tube.
        q: Middle of the chord, overwritten, shape (n,) [rad or m].
        line: Half of the chord, signed, overwritten, shape (n,).
        bow: Largest difference, overwritten, shape (n,).
    """
    c = numba.carray(stack(MOST_CONTROL), (MOST_CONTROL,), np.float64)
    degree = tube.control.shape[0] // tube.wide.shape[0] - 1
    first, share = segment * (degree + 1), low / high
    for j in range(q.shape[0]):
        for k in range(degree + 1):
            c[k] = tube.control[first + k, j]
        for r in range(1, degree + 1):
            for k in range(degree, r - 1, -1):
                c[k] = (1.0 - high) * c[k - 1] + high * c[k]
        if low > 0.0:
            for r in range(1, degree + 1):
                for k in range(degree + 1 - r):
                    c[k] = (1.0 - share) * c[k] + share * c[k + 1]
        q[j], line[j] = 0.5 * (c[0] + c[degree]), 0.5 * (c[degree] - c[0])
        most = 0.0
        for k in range(1, degree):
            chord = c[0] + (c[degree] - c[0]) * k / degree
            most = max(most, abs(c[k] - chord))
        bow[j] = most


@kernel(inline=False, entry=True)
def tile_boxes(
    tiles: Floats, tube: Longs, middles: Floats, halves: Floats, bow: Floats
) -> None:
    """Boxes that hold the joints of a tube in each tile.

    Args:
        tiles: Segment, and shares of it where each tile begins and ends, shape (k, 3).
        tube: Ledger of the tube.
        middles: Overwritten, shape (k, n) [rad or m].
        halves: Half widths, overwritten, of that shape.
        bow: Scratch, shape (n,).
    """
    t = open_tube(tube)
    for k in range(tiles.shape[0]):
        segment = int(tiles[k, 0])
        take_tile(segment, tiles[k, 1], tiles[k, 2], t, middles[k], halves[k], bow)
        for j in range(bow.shape[0]):
            halves[k, j] = abs(halves[k, j]) + bow[j] + t.wide[segment, j]
