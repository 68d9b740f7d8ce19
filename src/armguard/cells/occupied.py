"""Cells of space that moving primitives may touch, and in which tiles of a motion.

The cells are found by descent from cubes of 16 cells. A cube is left out where the
signed distance of its middle shows that the primitive ends before it, taken whole where
the primitive holds all of it, and divided otherwise. A cell that cannot be left out
counts as touched.
"""

from math import floor
from typing import NamedTuple

import numpy as np

from armguard.address import array_at, stack
from armguard.cells.masks import DIAGONAL, ROUND_OFF, depth_at
from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.table import (
    IntVector,
    LongMatrix,
    LongVector,
    Matrix,
    Vector,
    opener,
    table,
)

# Cells along an edge of the cubes that a descent begins with.
SIDE = 16

# Cubes that wait in a descent: seven on each of four levels, and one.
WAITING = 32
ROOM = 4 * WAITING

# What is returned where a primitive reaches beyond the cells that there are.
OUTSIDE = -1

# Columns of `Visits.runs`.
CELL, FIRST, LAST = range(3)


@table
class Visits(NamedTuple):
    """Runs of tiles in which a cell is touched.

    Attributes:
        first: Number of the first cell along each axis; that at the origin of the world
            is 0, shape (3,).
        counts: Cells along each axis, multiples of 16, shape (3,).
        open: Last run of each cell, -1 before its first one; by z, then y, then x.
        runs: Cell, first and last tile of each run, shape (r, 3).
        size: How many runs there are, which may be more than there is room for,
            shape (1,).
    """

    first: LongVector
    counts: LongVector
    open: IntVector
    runs: LongMatrix
    size: LongVector


open_visits = opener(Visits)


@kernel(inline=False, entry=True)
def visit_cells(
    kinds: IntVector,
    local_rows: Matrix,
    bodies: IntVector,
    T_world: Matrix,
    growth: Vector,
    edge: float,
    tile: int,
    lines: LongVector,
) -> int:
    """Add the cells that primitives on bodies may touch in a tile.

    Args:
        kinds: ShapeKind of each primitive, shape (m,).
        local_rows: Its row in the frame of its body, shape (m, 16).
        bodies: Its body, shape (m,).
        T_world: Poses of the bodies in the middle of the tile, shape (b, 12).
        growth: How far each primitive is grown, shape (m,) [m].
        edge: Edge of a cell [m].
        tile: Number of the tile, in ascending order from call to call.
        lines: Ledger of `Visits`, which are updated.

    Returns:
        Count of runs, or OUTSIDE.
    """
    v = open_visits(lines)
    row = array_at(stack(ROW_WIDTH), (ROW_WIDTH,), np.float64)
    box = array_at(stack(6), (6,), np.float64)
    width = SIDE * edge
    for i in range(kinds.shape[0]):
        place_row(kinds[i], local_rows[i], T_world[bodies[i]], row)
        row_bounds(kinds[i], row, growth[i] + ROUND_OFF, box)
        for k in range(3):
            low, high = v.first[k] * edge, (v.first[k] + v.counts[k]) * edge
            if not (box[k] >= low and box[k + 3] < high):
                return OUTSIDE
        for x in range(floor(box[0] / width), floor(box[3] / width) + 1):
            for y in range(floor(box[1] / width), floor(box[4] / width) + 1):
                for z in range(floor(box[2] / width), floor(box[5] / width) + 1):
                    cube = (SIDE * x, SIDE * y, SIDE * z)
                    visit_cube(kinds[i], row, growth[i], cube, edge, tile, v)
    return int(v.size[0])


@kernel(inline=False)
def visit_cube(
    kind: int,
    row: Vector,
    growth: float,
    start: tuple[int, int, int],
    edge: float,
    tile: int,
    v: Visits,
) -> None:
    """Add the cells of a cube of 16 cells along an edge that a primitive may touch.

    Args:
        kind: ShapeKind.
        row: Row of the primitive in the world.
        growth: How far it is grown [m].
        start: Number of the cube's first cell along each axis.
        edge: Edge of a cell [m].
        tile: Number of the tile.
        v: The visits.
    """
    # First cell along each axis, and cells along an edge, of each cube that waits.
    waiting = array_at(stack(ROOM), (WAITING, 4), np.int64)
    ball = array_at(stack(ROW_WIDTH), (ROW_WIDTH,), np.float64)
    witness = array_at(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    for k in range(ROW_WIDTH):
        ball[k] = 0.0
    put_cube(waiting[0], start[0], start[1], start[2], SIDE)
    left = 1
    while left > 0:
        left -= 1
        cube = waiting[left]
        x, y, z, side = cube[0], cube[1], cube[2], cube[3]
        half = 0.5 * side * edge
        point = (x * edge + half, y * edge + half, z * edge + half)
        depth, slope = depth_at(kind, row, point, ball, witness)
        if depth - slope * half > growth + ROUND_OFF:
            continue
        if side == 1 or depth + DIAGONAL * half < growth:
            visit_all(x, y, z, side, tile, v)
            continue
        side //= 2
        for part in range(8):
            i, j, k = part & 1, part >> 1 & 1, part >> 2
            put_cube(waiting[left], x + side * i, y + side * j, z + side * k, side)
            left += 1


@kernel
def put_cube(cube: LongVector, x: int, y: int, z: int, side: int) -> None:
    """Write a cube that waits."""
    cube[0], cube[1], cube[2], cube[3] = x, y, z, side


@kernel
def visit_all(x: int, y: int, z: int, side: int, tile: int, v: Visits) -> None:
    """Add all cells of a cube."""
    x, y, z = x - v.first[0], y - v.first[1], z - v.first[2]
    for k in range(z, z + side):
        for j in range(y, y + side):
            row = (k * v.counts[1] + j) * v.counts[0]
            for cell in range(row + x, row + x + side):
                visit(cell, tile, v)


@kernel
def visit(cell: int, tile: int, v: Visits) -> None:
    """Add a tile to the last run of a cell, or begin another run."""
    run, size = v.open[cell], v.size[0]
    if run >= 0 and v.runs[run, LAST] >= tile - 1:
        v.runs[run, LAST] = tile
        return
    v.size[0] = size + 1
    if size < v.runs.shape[0]:
        v.runs[size, CELL], v.runs[size, FIRST], v.runs[size, LAST] = cell, tile, tile
        v.open[cell] = size
