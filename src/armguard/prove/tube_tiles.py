"""Tiles of a tube: parts of its segments, each a chord and how far joints leave it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.kernel import kernel
from armguard.table import IntVector, Matrix, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Most control points of a segment.
MOST_CONTROL = 6


# Numbers of a tile for each of its parameters: its segment, and the shares of that
# where it begins and ends.
SEGMENT, LOW, HIGH = range(3)
SPAN = 3


@table
class TubeTable(NamedTuple):
    """Where every joint may be in each segment: a polynomial, plus or minus a width.

    Each joint follows one of one to four parameters. Segments of all parameters follow
    one another.

    Attributes:
        control: Bernstein control points of the segments one after another, shape
            (s · (degree + 1), n) [rad or m].
        bow: How far each joint's curve may leave its polynomial, shape (s, n).
        wide: How far each joint may leave its curve in each segment, shape (s, n).
        smallest: Shares of each segment below which a tile is not split, shape (s,).
        owner: Parameter that each joint follows, shape (n,).
    """

    control: Matrix
    bow: Matrix
    wide: Matrix
    smallest: Vector
    owner: IntVector


open_tube = opener(TubeTable)


@kernel(inline=False)
def take_tile(
    tile: Floats, tube: TubeTable, q: Floats, line: Floats, bow: Floats, wide: Floats
) -> None:
    """Write the chord of each joint in a tile, and how far the joint may leave that.

    The control points of a part of a segment are found by de Casteljau's rule. The
    curve differs from its chord by a polynomial whose control points are the
    differences to points of the chord in equal steps, and is within their hull.

    Args:
        tile: SPAN numbers for each parameter: the segment, and shares of it in [0, 1]
            where the part begins and ends.
        tube: The tube.
        q: Middle of the chord, overwritten, shape (n,) [rad or m].
        line: Half of the chord, signed, overwritten, shape (n,).
        bow: How far the curve may leave the chord, overwritten, shape (n,).
        wide: How far the joint may leave the curve, overwritten, shape (n,).
    """
    for d in range(tile.shape[0] // SPAN):
        take_part(d, tile, tube, q, line, bow, wide)


@kernel
def take_part(
    d: int,
    tile: Floats,
    tube: TubeTable,
    q: Floats,
    line: Floats,
    bow: Floats,
    wide: Floats,
) -> None:
    """Write the chords of the joints that follow parameter d, see `take_tile`."""
    c = array_at(stack(MOST_CONTROL), (MOST_CONTROL,), np.float64)
    degree = tube.control.shape[0] // tube.wide.shape[0] - 1
    segment, low, high = (
        int(tile[SPAN * d]),
        tile[SPAN * d + LOW],
        tile[SPAN * d + HIGH],
    )
    first, share = segment * (degree + 1), low / high
    for j in range(q.shape[0]):
        if tube.owner[j] != d:
            continue
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
        bow[j] = most + tube.bow[segment, j]
        wide[j] = tube.wide[segment, j]


@kernel(inline=False, entry=True)
def tile_boxes(
    tiles: Floats, tube: Longs, middles: Floats, halves: Floats, scratch: Floats
) -> None:
    """Boxes that hold the joints of a tube in each tile.

    Args:
        tiles: SPAN numbers for each parameter, see `take_tile`, shape (k, SPAN · d).
        tube: Ledger of the tube.
        middles: Overwritten, shape (k, n) [rad or m].
        halves: Half widths, overwritten, of that shape.
        scratch: Scratch, shape (2, n).
    """
    t, bow, wide = open_tube(tube), scratch[0], scratch[1]
    for k in range(tiles.shape[0]):
        take_tile(tiles[k], t, middles[k], halves[k], bow, wide)
        for j in range(bow.shape[0]):
            halves[k, j] = abs(halves[k, j]) + bow[j] + wide[j]
