"""Cells inside own links, and those that own links may touch."""

from math import ceil, floor, sqrt
from typing import Any

import numpy as np

from armguard.address import array_at, stack
from armguard.cells.carve import look_of
from armguard.cells.state import (
    ALL,
    GROUP_SIDE,
    NONE,
    WORD_SIDE,
    Lattice,
    Look,
    Triple,
    Words,
)
from armguard.cells.words import bit, corner_of, middle_of, place_of_word, word_at
from armguard.geometry.bounds import row_bounds
from armguard.geometry.box_frame import to_box, turn_to_box
from armguard.geometry.pairs import measure
from armguard.geometry.segments import closest_on_segment
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3, add, along, dot, extent, norm, sub
from armguard.kernel import kernel
from armguard.lanes import bits, either, least, load, most, root, size, splat
from armguard.table import IntVector, LongVector, Matrix, Vector

Pair = tuple[float, float]

SPHERE, CAPSULE = int(ShapeKind.SPHERE), int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)

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


@kernel
def write_offsets(kind: int, row: Vector, cell: float, out: Vector) -> None:
    """Write a word's cells from its middle: x of all, y of all, z of all; shape (192,).

    They are in the frame of a box, and in the world for other shapes [m].
    """
    for k in range(64):
        way = (
            cell * ((k & 3) - 1.5),
            cell * ((k >> 2 & 3) - 1.5),
            cell * ((k >> 4) - 1.5),
        )
        if kind == BOX:
            way = turn_to_box(row, way)
        for axis in range(3):
            out[64 * axis + k] = way[axis]


@kernel
def depths_in_box(row: Vector, middle: Vec3, first: int, offsets: Vector) -> Any:
    """Signed distances of eight cells' middles to a box, in lanes [m].

    Args:
        row: Row of the box, world, shape (16,).
        middle: Middle of their word, world [m].
        first: The first one of them.
        offsets: Result of `write_offsets`.
    """
    x, y, z = to_box(row, middle)
    x = size(load(offsets, first) + x) - row[4]
    y = size(load(offsets, 64 + first) + y) - row[5]
    z = size(load(offsets, 128 + first) + z) - row[6]
    a, b, c = most(x, 0.0), most(y, 0.0), most(z, 0.0)
    outside = root(a * a + b * b + c * c)
    within = most(most(x, y), z)
    return either(outside > 0.0, outside, within) - row[0]


@kernel
def depths_in_capsule(
    kind: int, row: Vector, middle: Vec3, first: int, offsets: Vector
) -> Any:
    """Signed distances of eight cells' middles to a capsule or a sphere, in lanes [m].

    Args:
        kind: CAPSULE or SPHERE.
        row: Row of the shape, world, shape (16,).
        middle: Middle of their word, world [m].
        first: The first one of them.
        offsets: Result of `write_offsets`.

    Returns:
        The distances, and how fast each can fall, see `depth_at`.
    """
    start = (row[1], row[2], row[3])
    x, y, z = sub(middle, start)
    a = load(offsets, first) + x
    b = load(offsets, 64 + first) + y
    c = load(offsets, 128 + first) + z
    if kind == CAPSULE:
        u = sub((row[4], row[5], row[6]), start)
        uu = dot(u, u)
        t = (a * u[0] + b * u[1] + c * u[2]) / (uu if uu > 0.0 else 1.0)
        t = least(most(t, 0.0), 1.0)
        a, b, c = a - t * u[0], b - t * u[1], c - t * u[2]
    gap = root(a * a + b * b + c * c)
    fall = (size(a) + size(b) + size(c)) / either(gap > 0.0, gap, 1.0)
    return gap - row[0], either(gap > 0.0, fall, DIAGONAL)


@kernel(inline=False)
def mask_cells(
    word: int, middle: Vec3, kind: int, row: Vector, bounds: Pair, offsets: Vector,
    out: Look,
) -> None:  # fmt: skip
    """Add the cells of a word to the masks, each by its distance.

    Args:
        word: The word.
        middle: Its middle, world [m].
        kind: ShapeKind.
        row: Row of the shape, world, shape (16,).
        bounds: Distance below which a middle is surely inside, and up to which a cell
            is in the shell [m].
        offsets: Result of `write_offsets`.
        out: The frame.
    """
    inside, shell = NONE, NONE
    half = 0.5 * out.lattice.cell
    if kind <= BOX:
        for n in range(8):
            if kind == BOX:
                gap, fall = depths_in_box(row, middle, 8 * n, offsets), splat(DIAGONAL)
            else:
                gap, fall = depths_in_capsule(kind, row, middle, 8 * n, offsets)
            inside |= np.uint64(bits(gap < bounds[0])) << np.uint64(8 * n)
            touched = gap - fall * half <= bounds[1]
            shell |= np.uint64(bits(touched)) << np.uint64(8 * n)
        add_cells(word, inside, shell & ~inside, out)
        return
    ball = array_at(stack(16), (16,), np.float64)
    found = array_at(stack(10), (10,), np.float64)
    ball[:] = 0.0
    for k in range(64):
        at = add(middle, (offsets[k], offsets[64 + k], offsets[128 + k]))
        depth, slope = depth_at(kind, row, at, ball, found)
        if depth < bounds[0]:
            inside |= bit(k)
        elif depth - slope * half <= bounds[1]:
            shell |= bit(k)
    add_cells(word, inside, shell, out)


@kernel
def words_about(
    kind: int, row: Vector, margin: float, lattice: Lattice
) -> tuple[int, int, int, int, int, int]:
    """Places of the words that a shape with a margin [m] may touch: first, and end."""
    edge = 4.0 * lattice.cell
    words = lattice.side // 4
    bounds = array_at(stack(6), (6,), np.float64)
    row_bounds(kind, row, margin + ROUND_OFF, bounds)
    first = array_at(stack(3), (3,), np.float64)
    last = array_at(stack(3), (3,), np.float64)
    for k in range(3):
        low, high = bounds[k] - lattice.low[k], bounds[3 + k] - lattice.low[k]
        if not (high >= 0.0 and low <= words * edge):
            return 0, 0, 0, 0, 0, 0
        first[k] = max(floor(low / edge), 0.0)
        last[k] = min(ceil(high / edge), float(words))
    return (
        int(first[0]), int(first[1]), int(first[2]),
        int(last[0]), int(last[1]), int(last[2]),
    )  # fmt: skip


@kernel(inline=False)
def mask_shape(kind: int, row: Vector, error: float, margin: float, out: Look) -> None:
    """Add the cells of a shape to the masks; see `mask_shapes`."""
    lattice = out.lattice
    cell = lattice.cell
    ball = array_at(stack(16), (16,), np.float64)
    found = array_at(stack(10), (10,), np.float64)
    offsets = array_at(stack(192), (192,), np.float64)
    ball[:] = 0.0
    write_offsets(kind, row, cell, offsets)
    low, high = -error - ROUND_OFF, margin + ROUND_OFF
    bounds = low - DIAGONAL * (0.5 * cell), high
    x0, y0, z0, x1, y1, z1 = words_about(kind, row, margin, lattice)
    for k in range(z0, z1):
        for j in range(y0, y1):
            for i in range(x0, x1):
                middle = middle_of(corner_of((i, j, k), 4, lattice), 4.0 * cell)
                gap, fall = depth_at(kind, row, middle, ball, found)
                if not gap - fall * (2.0 * cell) <= high:
                    continue
                word = word_at(i, j, k, lattice.blocks)
                if gap + DIAGONAL * (2.0 * cell) < low:
                    add_cells(word, ALL, NONE, out)
                else:
                    mask_cells(word, middle, kind, row, bounds, offsets, out)


@kernel(inline=False, entry=True)
def mask_shapes(
    kinds: IntVector, rows: Matrix, slacks: Matrix, look_lines: LongVector
) -> None:
    """Add the cells of shapes to the masks.

    Args:
        kinds: ShapeKind of each, not a half-space, shape (n,).
        rows: Their rows, world, shape (n, 16).
        slacks: How far the surface of each may be within it: nearer cells are not
            surely inside; and how far outside it, shape (n, 2) [m].
        look_lines: Lines of `Look`.
    """
    look = look_of(look_lines)
    for k in range(kinds.shape[0]):
        mask_shape(kinds[k], rows[k], slacks[k, 0], slacks[k, 1], look)


@kernel(inline=False, entry=True)
def mask_kept(
    words: IntVector, cells: Words, middle: Triple, reach: float, look_lines: LongVector
) -> None:
    """Keep cells near to a point as they are, in masks without any.

    Args:
        words: Words of the cells; fastest if they rise, shape (n,).
        cells: The cells of each, shape (n,).
        middle: The point, world, shape (3,) [m].
        reach: Distance up to which words are needed [m].
        look_lines: Lines of `Look`.
    """
    look = look_of(look_lines)
    lattice, group, near = look.lattice, -1, False
    edge = GROUP_SIDE * lattice.cell
    for k in range(words.shape[0]):
        word = int(words[k])
        if word >> 6 != group:
            group = word >> 6
            place = place_of_word(group << 6, lattice.blocks)
            at = middle_of(corner_of(place, WORD_SIDE, lattice), edge)
            away = norm(sub(at, (middle[0], middle[1], middle[2])))
            near = away <= reach + 0.5 * DIAGONAL * edge
        if near:
            look.shell[word] = look.kept[word] = cells[k]
            look.masked[look.notes.masked] = word
            look.notes.masked += 1


@kernel(inline=False, entry=True)
def clear_masks(look_lines: LongVector) -> None:
    """Take all cells off the masks."""
    look = look_of(look_lines)
    for k in range(look.notes.masked):
        word = look.masked[k]
        look.inside[word] = look.shell[word] = look.kept[word] = NONE
    look.notes.masked = 0
