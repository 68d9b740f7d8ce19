"""Cells with measured points."""

import numpy as np

from armguard.cells.carve import look_of
from armguard.cells.pyramid import pyramid_of
from armguard.cells.state import Camera, Lattice, Look, Singles
from armguard.cells.words import bit, touch, word_at
from armguard.kernel import kernel
from armguard.table import IntVector, LongVector

# Most parts of an edge of a pixel's area [-].
MOST_PARTS = 64


@kernel
def hit(cell: int, sure: bool, blocks: int, out: Look) -> None:
    """Note a point in a cell.

    Args:
        cell: Code of the cell, see `cell_at`; none if it is negative.
        sure: Whether one point is enough; otherwise two are needed.
        blocks: Blocks along an edge of the cube.
        out: The frame.
    """
    if cell < 0:
        return
    x, y, z = cell & 1023, cell >> 10 & 1023, cell >> 20
    word = word_at(x >> 2, y >> 2, z >> 2, blocks)
    one = bit(((z & 3) << 4) + ((y & 3) << 2) + (x & 3))
    before = out.hits[word]
    if before == 0:
        touch(word, out)
    # No branch: whether a pixel is the first one in its cell cannot be predicted.
    out.sure[word] |= one if sure else before & one
    out.hits[word] = before | one


@kernel
def cell_at(x: float, y: float, z: float, side: int) -> int:
    """Code of a point's cell: ten bits for its place along x, y and z each.

    It is -1 outside the cube, also for NaN.

    Args:
        x: Place of the point from the lower corner of the cube [cells].
        y: Place.
        z: Place.
        side: Cells along an edge of the cube.
    """
    if not (0.0 <= x < side and 0.0 <= y < side and 0.0 <= z < side):
        return -1
    return int(z) << 20 | int(y) << 10 | int(x)


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
            hit(cell_at(x, y, z, lattice.side), True, lattice.blocks, out)


@kernel
def valid(depth: np.float32) -> np.float32:
    """A depth; 0 if it is not a positive finite number."""
    within = (depth > np.float32(0.0)) & (depth < np.float32(np.inf))
    return depth if within else np.float32(0.0)


@kernel(inline=False)
def write_codes(
    i: int, depths: Singles, camera: Camera, lattice: Lattice, out: IntVector
) -> None:
    """Write the cell of each pixel of a row, see `cell_at`, -1 for none.

    Without a branch for a pixel the compiler computes several at a time.
    """
    scale, side = 1.0 / lattice.cell, float(lattice.side)
    t = (i - camera.centre[1]) / camera.focal[1]
    a, b, c = camera.axes[0], camera.axes[1], camera.axes[2]
    ax, ay, az = a[0], a[1], a[2]
    bx, by, bz = t * b[0] + c[0], t * b[1] + c[1], t * b[2] + c[2]
    ox = (camera.origin[0] - lattice.low[0]) * scale
    oy = (camera.origin[1] - lattice.low[1]) * scale
    oz = (camera.origin[2] - lattice.low[2]) * scale
    middle, per_pixel = camera.centre[0], 1.0 / camera.focal[0]
    for j in range(depths.shape[0]):
        depth = scale * valid(depths[j])
        s = (j - middle) * per_pixel
        x = ox + depth * (s * ax + bx)
        y = oy + depth * (s * ay + by)
        z = oz + depth * (s * az + bz)
        within = (x >= 0.0) & (x < side) & (y >= 0.0) & (y < side)
        within = within & (z >= 0.0) & (z < side) & (depth > 0.0)
        code = np.int32(z) << 20 | np.int32(y) << 10 | np.int32(x)
        out[j] = code if within else -1


@kernel(inline=False)
def hit_row(i: int, depths: Singles, single: bool, codes: IntVector, out: Look) -> None:
    """Note the cells of a row of pixels; see `hit_pixels`."""
    camera, lattice = out.camera, out.lattice
    blocks, cell = lattice.blocks, lattice.cell
    # Beyond the first depth a cell is less than two pixels wide, so that one of them is
    # enough, and beyond the second one a pixel is wider than a cell.
    wide = cell * min(camera.focal[0], camera.focal[1])
    enough = 0.0 if single else 0.5 * wide
    for j in range(depths.shape[0]):
        depth = depths[j]
        if wide < depth < np.inf:
            parts = min(int(np.ceil(depth / wide)), MOST_PARTS)
            hit_area(i, j, depth / cell, parts, camera, lattice, out)
        else:
            hit(codes[j], depth > enough, blocks, out)


@kernel(inline=False, entry=True)
def hit_pixels(
    image: Singles, single: bool, pyramid_lines: LongVector, look_lines: LongVector
) -> None:
    """Note the cells in which the pixels of an image measured a surface.

    A pixel wider than a cell hits the cells of its area at its depth, by points that
    are no farther apart than a cell.

    Args:
        image: Depths by rows, shape (rows · columns,) [m].
        single: Whether one pixel in a cell is enough. Otherwise two are needed, where
            a cell is at least two pixels wide.
        pyramid_lines: Lines of a `Pyramid` for images of that size, for its scratch.
        look_lines: Lines of `Look`.
    """
    p, look = pyramid_of(pyramid_lines), look_of(look_lines)
    columns = p.levels[0, 2]
    for i in range(p.levels[0, 1]):
        row = image[i * columns : (i + 1) * columns]
        write_codes(i, row, look.camera, look.lattice, p.codes)
        hit_row(i, row, single, p.codes, look)
