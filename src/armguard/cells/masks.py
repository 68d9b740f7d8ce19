"""Cells inside own links, and those that own links may touch."""

from math import ceil, floor, sqrt

import numba
import numpy as np

from armguard.address import stack
from armguard.cells.carve import look_of
from armguard.cells.state import ALL, NONE, Look
from armguard.cells.words import bit, corner_of, member_corner, middle_of, word_at
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pairs import measure
from armguard.geometry.segments import closest_on_segment
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3, along, extent, norm, sub
from armguard.kernel import kernel
from armguard.table import LongVector, Vector

SPHERE, CAPSULE = int(ShapeKind.SPHERE), int(ShapeKind.CAPSULE)

# Distance of a cube's corner from its middle, in half edges [-].
DIAGONAL = sqrt(3.0)

# Growth of all bounds against rounding [m].
ROUND_OFF = 1e-9


@kernel
def depth_at(
    kind: int, row: Vector, point: Vec3, ball: Vector, out: Vector
) -> tuple[float, float]:
    """Signed distance of a point to a shape, and how fast it can fall.

    A signed distance to a convex shape is convex: in a cube about the point it is not
    below the one there less half the edge times the sum of the sizes of its gradient.

    Args:
        kind: ShapeKind.
        row: Row of the shape, world, shape (16,).
        point: The point [m].
        ball: Row of a sphere, zero but for its centre, overwritten.
        out: Scratch, shape (10,).

    Returns:
        Signed distance [m]; that sum, or the most it can be.
    """
    if kind > CAPSULE:
        ball[1], ball[2], ball[3] = point
        measure(SPHERE, ball, kind, row, out)
        return float(out[0]), DIAGONAL
    start = (row[1], row[2], row[3])
    u = (0.0, 0.0, 0.0)
    if kind == CAPSULE:
        u = sub((row[4], row[5], row[6]), start)
    apart = sub(point, along(start, closest_on_segment(point, start, u), u))
    gap = norm(apart)
    return gap - row[0], extent(apart) / gap if gap > 0.0 else DIAGONAL


@kernel
def add_cells(word: int, inside: np.uint64, shell: np.uint64, out: Look) -> None:
    """Add cells of a word to the masks."""
    if inside | shell == 0:
        return
    if out.inside[word] | out.shell[word] == 0:
        out.masked[out.notes.masked] = word
        out.notes.masked += 1
    out.inside[word] |= inside
    out.shell[word] = (out.shell[word] | shell) & ~out.inside[word]


@kernel(inline=False)
def mask_word(
    word: int, low: Vec3, kind: int, row: Vector, error: float, margin: float,
    out: Look,
) -> None:  # fmt: skip
    """Add the cells of a word to the masks; low is its lower corner [m]."""
    ball = numba.carray(stack(16), (16,), np.float64)
    found = numba.carray(stack(10), (10,), np.float64)
    ball[:] = 0.0
    cell = out.lattice.cell
    half = 2.0 * cell
    gap, fall = depth_at(kind, row, middle_of(low, 4.0 * cell), ball, found)
    if not gap - fall * half <= margin + ROUND_OFF:
        return
    if gap + DIAGONAL * half < -error - ROUND_OFF:
        add_cells(word, ALL, NONE, out)
        return
    inside, shell = NONE, NONE
    half = 0.5 * cell
    for k in range(64):
        middle = middle_of(member_corner(low, cell, k), cell)
        gap, fall = depth_at(kind, row, middle, ball, found)
        if gap + DIAGONAL * half < -error - ROUND_OFF:
            inside |= bit(k)
        elif gap - fall * half <= margin + ROUND_OFF:
            shell |= bit(k)
    add_cells(word, inside, shell, out)


@kernel(inline=False, entry=True)
def mask_shape(
    kind: int, row: Vector, error: float, margin: float, look_lines: LongVector
) -> None:
    """Add the cells of a shape to the masks.

    Args:
        kind: ShapeKind, not a half-space.
        row: Row of the shape, world, shape (16,).
        error: How far its surface may be within the shape [m]: nearer cells are not
            surely inside.
        margin: How far its surface may be outside it [m].
        look_lines: Lines of `Look`.
    """
    look = look_of(look_lines)
    lattice = look.lattice
    edge = 4.0 * lattice.cell
    words = lattice.side // 4
    bounds = numba.carray(stack(6), (6,), np.float64)
    row_bounds(kind, row, margin + ROUND_OFF, bounds)
    first = numba.carray(stack(3), (3,), np.float64)
    last = numba.carray(stack(3), (3,), np.float64)
    for k in range(3):
        low, high = bounds[k] - lattice.low[k], bounds[3 + k] - lattice.low[k]
        if not (high >= 0.0 and low <= words * edge):
            return
        first[k] = max(floor(low / edge), 0.0)
        last[k] = min(ceil(high / edge), float(words))
    for k in range(int(first[2]), int(last[2])):
        for j in range(int(first[1]), int(last[1])):
            for i in range(int(first[0]), int(last[0])):
                low_corner = corner_of((i, j, k), 4, lattice)
                word = word_at(i, j, k, lattice.blocks)
                mask_word(word, low_corner, kind, row, error, margin, look)


@kernel(inline=False, entry=True)
def clear_masks(look_lines: LongVector) -> None:
    """Take all cells off the masks."""
    look = look_of(look_lines)
    for k in range(look.notes.masked):
        word = look.masked[k]
        look.inside[word] = look.shell[word] = look.kept[word] = NONE
    look.notes.masked = 0
