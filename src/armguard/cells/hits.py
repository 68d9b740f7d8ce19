"""Cells with measured points."""

import numpy as np

from armguard.cells.carve import look_of
from armguard.cells.pyramid import pyramid_of
from armguard.cells.state import Camera, Lattice, Look, Singles
from armguard.cells.words import bit, touch, word_at
from armguard.kernel import kernel
from armguard.table import LongVector

# Most parts of an edge of a pixel's area [-].
MOST_PARTS = 64


@kernel
def hit(cell: int, sure: bool, lattice: Lattice, out: Look) -> None:
    """Note points in a cell.

    Args:
        cell: x + side · (y + side · z) for the cell (x, y, z); none if it is negative.
        sure: Whether these points are enough.
        lattice: Place of the cells.
        out: The frame.
    """
    if cell < 0:
        return
    side = lattice.side
    x, y, z = cell % side, cell // side % side, cell // (side * side)
    word = word_at(x >> 2, y >> 2, z >> 2, lattice.blocks)
    one = bit(((z & 3) << 4) + ((y & 3) << 2) + (x & 3))
    touch(word, out)
    if sure or out.hits[word] & one != 0:
        out.sure[word] |= one
    out.hits[word] |= one


@kernel
def cell_at(x: float, y: float, z: float, side: int) -> int:
    """Cell of a point, see `hit`; -1 outside the cube, also for NaN.

    Args:
        x: Place of the point from the lower corner of the cube [cells].
        y: Place.
        z: Place.
        side: Cells along an edge of the cube.
    """
    if not (0.0 <= x < side and 0.0 <= y < side and 0.0 <= z < side):
        return -1
    return (int(z) * side + int(y)) * side + int(x)


@kernel(inline=False)
def hit_area(
    i: int, j: int, depth: float, count: int, camera: Camera, lattice: Lattice,
    out: Look,
) -> None:  # fmt: skip
    """Note the cells of a pixel's area at its depth, by points from edge to edge.

    Args:
        i: Row of the pixel.
        j: Its column.
        depth: Its depth [cells].
        count: Parts of its edges between two points.
        camera: The camera.
        lattice: Place of the cells.
        out: The frame.
    """
    a, b, c = camera.axes[0], camera.axes[1], camera.axes[2]
    scale = 1.0 / lattice.cell
    ox = (camera.origin[0] - lattice.low[0]) * scale
    oy = (camera.origin[1] - lattice.low[1]) * scale
    oz = (camera.origin[2] - lattice.low[2]) * scale
    for row in range(count + 1):
        t = i + row / count - 0.5
        t = depth * (t - camera.centre[1]) / camera.focal[1]
        for column in range(count + 1):
            s = j + column / count - 0.5
            s = depth * (s - camera.centre[0]) / camera.focal[0]
            x = ox + s * a[0] + t * b[0] + depth * c[0]
            y = oy + s * a[1] + t * b[1] + depth * c[1]
            z = oz + s * a[2] + t * b[2] + depth * c[2]
            hit(cell_at(x, y, z, lattice.side), True, lattice, out)


@kernel(inline=False)
def hit_row(
    i: int, depths: Singles, single: bool, camera: Camera, lattice: Lattice, out: Look
) -> None:
    """Note the cells of a row of pixels; see `hit_pixels`."""
    scale, side = 1.0 / lattice.cell, lattice.side
    t = (i - camera.centre[1]) / camera.focal[1]
    a, b, c = camera.axes[0], camera.axes[1], camera.axes[2]
    bx, by, bz = t * b[0] + c[0], t * b[1] + c[1], t * b[2] + c[2]
    ox = (camera.origin[0] - lattice.low[0]) * scale
    oy = (camera.origin[1] - lattice.low[1]) * scale
    oz = (camera.origin[2] - lattice.low[2]) * scale
    per_pixel = 1.0 / camera.focal[0]
    most = min(camera.focal[0], camera.focal[1])
    # Pixels that follow each other and lie in one cell are noted together.
    last, count = -1, 0
    for j in range(depths.shape[0]):
        depth = float(depths[j])
        if depth <= 0.0:
            continue
        depth *= scale
        if depth > most:
            parts = min(int(np.ceil(depth / most)), MOST_PARTS)
            hit_area(i, j, depth, parts, camera, lattice, out)
            continue
        s = (j - camera.centre[0]) * per_pixel
        x = ox + depth * (s * a[0] + bx)
        y = oy + depth * (s * a[1] + by)
        z = oz + depth * (s * a[2] + bz)
        cell = cell_at(x, y, z, side)
        if cell != last:
            hit(last, single or count > 1, lattice, out)
            last, count = cell, 0
        # Where a cell is less than two pixels wide, one of them is enough.
        count += 1 if 2.0 * depth <= most else 2
    hit(last, single or count > 1, lattice, out)


@kernel(inline=False, entry=True)
def hit_pixels(single: bool, pyramid_lines: LongVector, look_lines: LongVector) -> None:
    """Note the cells in which the pixels of an image measured a surface.

    A pixel wider than a cell hits the cells of its area at its depth, by points that
    are no farther apart than a cell.

    Args:
        single: Whether one pixel in a cell is enough. Otherwise two are needed, where
            a cell is at least two pixels wide.
        pyramid_lines: Lines of `Pyramid`.
        look_lines: Lines of `Look`.
    """
    p, look = pyramid_of(pyramid_lines), look_of(look_lines)
    columns = p.levels[0, 2]
    for i in range(p.levels[0, 1]):
        row = p.least[i * columns : (i + 1) * columns]
        hit_row(i, row, single, look.camera, look.lattice, look)
