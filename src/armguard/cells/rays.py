"""Rays to measured points: cells crossed are passed, the last one is hit."""

from math import inf

from armguard.cells.carve import look_of
from armguard.cells.hits import cell_at, hit
from armguard.cells.state import Lattice, Look, Triple
from armguard.cells.words import bit, touch, word_at
from armguard.geometry.vec3 import Vec3, norm, scaled, sub
from armguard.kernel import kernel
from armguard.table import LongVector, Matrix, Vector

# Share of a ray below which it only touches a cell [-].
TOUCHED = 1e-12


@kernel
def clipped(start: Vec3, way: Vec3, side: int, end: float) -> tuple[float, float]:
    """Part of a segment within the cube, as shares of its way; empty if reversed."""
    first, last = 0.0, end
    for k in range(3):
        if way[k] == 0.0:
            if not 0.0 <= start[k] < side:
                return 1.0, 0.0
            continue
        a, b = -start[k] / way[k], (side - start[k]) / way[k]
        first, last = max(first, min(a, b)), min(last, max(a, b))
    return first, last


@kernel
def next_plane(start: float, way: float, cell: int) -> float:
    """Share of the way at which a ray leaves its cell along one axis."""
    if way == 0.0:
        return inf
    return (cell + (1 if way > 0.0 else 0) - start) / way


@kernel
def pass_cell(x: int, y: int, z: int, lattice: Lattice, out: Look) -> None:
    """Note that a ray has crossed a cell."""
    word = word_at(x >> 2, y >> 2, z >> 2, lattice.blocks)
    touch(word, out)
    out.passes[word] |= bit(((z & 3) << 4) + ((y & 3) << 2) + (x & 3))


@kernel(inline=False)
def cross_cells(
    start: Vec3, way: Vec3, end: float, lattice: Lattice, out: Look
) -> None:
    """Note the cells that a ray crosses wholly.

    Args:
        start: Its origin, from the lower corner of the cube [cells].
        way: From there to the measured point [cells].
        end: Share of the way up to which it counts.
        lattice: Place of the cells.
        out: The frame.
    """
    side = lattice.side
    at, last = clipped(start, way, side, end)
    if not at < last:
        return
    x = min(max(int(start[0] + at * way[0]), 0), side - 1)
    y = min(max(int(start[1] + at * way[1]), 0), side - 1)
    z = min(max(int(start[2] + at * way[2]), 0), side - 1)
    while 0 <= x < side and 0 <= y < side and 0 <= z < side:
        tx = next_plane(start[0], way[0], x)
        ty = next_plane(start[1], way[1], y)
        tz = next_plane(start[2], way[2], z)
        leave = min(tx, ty, tz)
        if not leave < end:
            return
        if leave > at + TOUCHED:
            pass_cell(x, y, z, lattice, out)
        at = max(at, leave)
        if tx == leave:
            x += 1 if way[0] > 0.0 else -1
        elif ty == leave:
            y += 1 if way[1] > 0.0 else -1
        else:
            z += 1 if way[2] > 0.0 else -1


@kernel(inline=False, entry=True)
def cast_rays(
    points: Matrix, origin: Triple, reaches: Vector, look_lines: LongVector
) -> None:
    """Note the cells that rays cross, and those of their points.

    Args:
        points: Measured points, world, shape (n, 3) [m]; one that is not finite is
            left out.
        origin: Where the rays begin, world, shape (3,) [m].
        reaches: Distance from the origin up to which each ray passes cells; NaN for
            none, shape (n,) [m].
        look_lines: Lines of `Look`.
    """
    look = look_of(look_lines)
    lattice = look.lattice
    low = (lattice.low[0], lattice.low[1], lattice.low[2])
    scale = 1.0 / lattice.cell
    start = scaled(scale, sub((origin[0], origin[1], origin[2]), low))
    for n in range(points.shape[0]):
        end = scaled(scale, sub((points[n, 0], points[n, 1], points[n, 2]), low))
        way = sub(end, start)
        length = norm(way) * lattice.cell
        if not length < inf:
            continue
        hit(cell_at(end[0], end[1], end[2], lattice.side), True, lattice.blocks, look)
        reach = reaches[n]
        if reach > 0.0:
            share = 1.0 if length <= reach else reach / length
            cross_cells(start, way, share, lattice, look)
