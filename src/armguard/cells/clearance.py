"""Distance of a primitive to a set of cells.

The set is searched from its summaries downwards, nearest members first. A member's box
that is not nearer than the best cell so far is left out with all in it. The answer is
the least of the cells' own distances, whatever the order, so a search that begins with
a good guess gives the same bits.
"""

from math import inf, nan
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.cells.state import (
    BLOCK_SIDE,
    GROUP_SIDE,
    WORD_SIDE,
    Bits,
    Claims,
    Lattice,
    Triple,
)
from armguard.cells.words import (
    bit,
    corner_of,
    member_corner,
    middle_of,
    place_of_block,
    place_of_word,
)
from armguard.geometry.bounds import row_bounds
from armguard.geometry.cell_gap import cell_gap
from armguard.geometry.place import place_row
from armguard.geometry.segments import POINT, clamp01
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, along, dot, extent, norm, sub
from armguard.kernel import kernel
from armguard.lanes import lowest
from armguard.record import maker, record
from armguard.table import IntVector, LongVector, Matrix, Vector, opener

CAPSULE = int(ShapeKind.CAPSULE)

# A box's gap counts as smaller by this share and this length: the gaps of cells in it
# are rounded, and those of curved cores are proven to a share of 1e-9 [-, m].
SHARE, ROUND_OFF = 4e-9, 1e-12

# Bits of members by their place along an axis, from 0 to 3, in a word, group or block.
ALONG_X = np.uint64(0x1111111111111111)
ALONG_Y = np.uint64(0x000F000F000F000F)
ALONG_Z = np.uint64(0x000000000000FFFF)


@record
class Nearest:
    """Nearest cell of a search.

    Attributes:
        gap: Distance of the core to it, at first that up to which cells count [m].
        word: Its word, -1 without one.
        cell: Its bit in the word.
        visited: Boxes whose exact gap was computed, cells among them.
        measured: Cells whose exact gap was computed.
    """

    gap: float
    word: int
    cell: int
    visited: int
    measured: int


@record
class Query:
    """A primitive whose nearest cell is searched.

    Attributes:
        kind: ShapeKind.
        row: Its row, world.
        bounds: Corners of the bounding box of its core, world [m].
        way: From the start of a capsule's axis to its end, 0 for other kinds [m].
        per_square: Inverse of its squared length, 0 for a point [1/m²].
    """

    kind: int
    row: Annotated[NDArray[np.float64], (ROW_WIDTH,)]
    bounds: Annotated[NDArray[np.float64], (6,)]
    way: Triple
    per_square: float


make_nearest, make_query = maker(Nearest), maker(Query)
claims_of = opener(Claims)


@kernel
def range_bits(low: float, high: float, one: np.uint64, step: int) -> np.uint64:
    """Members whose place along an axis meets a range.

    Args:
        low: Lower end of the range, from the lower corner [members].
        high: Upper end.
        one: Bits of the members at place 0.
        step: Bits from one place to the next.
    """
    found = np.uint64(0)
    for k in range(4):
        if low <= k + 1.0 and high >= k:
            found |= one << np.uint64(k * step)
    return found


@kernel
def reachable(
    members: np.uint64, corner: Vec3, edge: float, query: Query, gap: float
) -> np.uint64:
    """Members that meet the bounding box of a core grown by a gap.

    Args:
        members: Members of a word, group or block.
        corner: Its lower corner [m].
        edge: Edge of a member [m].
        query: The primitive.
        gap: Growth [m].
    """
    scale, growth, bounds = 1.0 / edge, gap * (1.0 + SHARE) + ROUND_OFF, query.bounds
    low, high = bounds[0] - growth - corner[0], bounds[3] + growth - corner[0]
    members &= range_bits(low * scale, high * scale, ALONG_X, 1)
    low, high = bounds[1] - growth - corner[1], bounds[4] + growth - corner[1]
    members &= range_bits(low * scale, high * scale, ALONG_Y, 4)
    low, high = bounds[2] - growth - corner[2], bounds[5] + growth - corner[2]
    return members & range_bits(low * scale, high * scale, ALONG_Z, 16)


@kernel
def box_gap(query: Query, low: Vec3, edge: float) -> float:
    """Distance of a core to a cube with a lower corner [m]."""
    x, y, z = low
    high = (x + edge, y + edge, z + edge)
    return float(cell_gap(query.kind, query.row, x, y, z, high[0], high[1], high[2]))


@kernel
def is_beyond(gap: float, best: Nearest) -> bool:
    """Whether no cell of a box with this gap can be nearer than the best one."""
    return bool(gap * (1.0 - SHARE) - ROUND_OFF > best.gap)


@kernel
def quick_gap(query: Query, low: Vec3, edge: float) -> float:
    """Lower bound of the distance of a sphere's or a capsule's core to a cube [m].

    The distance to a segment is convex: in a cube it is not below the one in the middle
    less half the edge times the sum of the sizes of its gradient.

    Args:
        query: The primitive.
        low: Lower corner of the cube [m].
        edge: Its edge [m].
    """
    row, way = query.row, (query.way[0], query.way[1], query.way[2])
    apart = sub(middle_of(low, edge), (row[1], row[2], row[3]))
    apart = along(apart, -clamp01(dot(apart, way) * query.per_square), way)
    gap = norm(apart)
    return gap - 0.5 * edge * extent(apart) / gap if gap > 0.0 else 0.0


@kernel
def write_bounds(out: Query) -> None:
    """Bounding box of the core, and the axis of a capsule."""
    row = out.row
    row_bounds(out.kind, row, -row[0], out.bounds)
    square = 0.0
    for k in range(3):
        out.way[k] = row[4 + k] - row[1 + k] if out.kind == CAPSULE else 0.0
        square += out.way[k] * out.way[k]
    out.per_square = 1.0 / square if square > POINT else 0.0


@kernel(inline=False)
def search_word(
    word: int, cells: np.uint64, query: Query, lattice: Lattice, out: Nearest
) -> None:
    """Compare the cells of a word; of equal ones the first counts."""
    corner = corner_of(place_of_word(word, lattice.blocks), WORD_SIDE, lattice)
    edge = lattice.cell
    cells = reachable(cells, corner, edge, query, out.gap)
    while cells != 0:
        cell = lowest(cells)
        cells &= cells - np.uint64(1)
        low = member_corner(corner, edge, cell)
        if query.kind <= CAPSULE and is_beyond(quick_gap(query, low, edge), out):
            continue
        gap = box_gap(query, low, edge)
        out.visited += 1
        out.measured += 1
        first = (
            out.word < 0 or word < out.word or (word == out.word and cell < out.cell)
        )
        if gap < out.gap or (gap == out.gap and first):
            out.gap, out.word, out.cell = gap, word, cell


@kernel
def gaps_of(
    members: np.uint64, corner: Vec3, edge: float, query: Query, best: Nearest,
    out: Vector,
) -> np.uint64:  # fmt: skip
    """Write gaps of members, or bounds; members beyond the best cell are left out."""
    left = members
    while left != 0:
        k = lowest(left)
        left &= left - np.uint64(1)
        low = member_corner(corner, edge, k)
        if query.kind <= CAPSULE:
            out[k] = quick_gap(query, low, edge)
        else:
            out[k] = box_gap(query, low, edge)
            best.visited += 1
        if is_beyond(out[k], best):
            members &= ~bit(k)
    return members


@kernel
def nearest_of(members: np.uint64, gaps: Vector) -> int:
    """Member with the least gap."""
    found = lowest(members)
    members &= members - np.uint64(1)
    while members != 0:
        k = lowest(members)
        members &= members - np.uint64(1)
        if gaps[k] < gaps[found]:
            found = k
    return found


@kernel(inline=False)
def search_group(
    group: int, corner: Vec3, query: Query, lattice: Lattice, cells: Bits, out: Nearest
) -> None:
    """Search the words of a group with a lower corner [m]."""
    gaps = array_at(stack(64), (64,), np.float64)
    edge = WORD_SIDE * lattice.cell
    members = reachable(cells.groups[group], corner, edge, query, out.gap)
    members = gaps_of(members, corner, edge, query, out, gaps)
    while members != 0:
        k = nearest_of(members, gaps)
        members &= ~bit(k)
        if is_beyond(gaps[k], out):
            return
        word = (group << 6) + k
        search_word(word, cells.words[word], query, lattice, out)


@kernel(inline=False)
def search_block(
    block: int, query: Query, lattice: Lattice, cells: Bits, out: Nearest
) -> None:
    """Search the groups of a block."""
    gaps = array_at(stack(64), (64,), np.float64)
    corner = corner_of(place_of_block(block, lattice.blocks), BLOCK_SIDE, lattice)
    edge = GROUP_SIDE * lattice.cell
    members = reachable(cells.blocks[block], corner, edge, query, out.gap)
    members = gaps_of(members, corner, edge, query, out, gaps)
    while members != 0:
        k = nearest_of(members, gaps)
        members &= ~bit(k)
        if is_beyond(gaps[k], out):
            return
        inner = member_corner(corner, edge, k)
        search_group((block << 6) + k, inner, query, lattice, cells, out)


@kernel(inline=False)
def search(
    query: Query, first: int, lattice: Lattice, cells: Bits, out: Nearest
) -> None:
    """Nearest cell of a set to the core of a primitive.

    Args:
        query: Kind and row of the primitive; the rest of it is overwritten.
        first: Word to search first, -1 for none.
        lattice: Place of the cells.
        cells: The set.
        out: Nearest cell; `gap` is at first the distance up to which cells count.
    """
    total = 0.0
    for k in range(ROW_WIDTH):
        total += 0.0 * query.row[k]
    if total != 0.0:
        out.gap = nan
        return
    write_bounds(query)
    if first >= 0:
        search_word(first, cells.words[first], query, lattice, out)
    edge = BLOCK_SIDE * lattice.cell
    for root in range(cells.roots.shape[0]):
        left = cells.roots[root]
        while left != 0:
            block = (root << 6) + lowest(left)
            left &= left - np.uint64(1)
            place = place_of_block(block, lattice.blocks)
            corner = corner_of(place, BLOCK_SIDE, lattice)
            if reachable(bit(0), corner, edge, query, out.gap) != 0:
                search_block(block, query, lattice, cells, out)


@kernel(inline=False, entry=True)
def clearances(
    kind: int, local: Vector, poses: Matrix, limit: float, unknown: bool,
    claims_lines: LongVector, words: IntVector, out: Matrix,
) -> None:  # fmt: skip
    """Distance of a shape at many poses to the occupied cells, or the unknown ones.

    Args:
        kind: ShapeKind.
        local: Row of the shape in its frame, shape (16,).
        poses: Its frames in the world, shape (n, 12).
        limit: Distance up to which cells count [m].
        unknown: Whether to measure to the unknown cells.
        claims_lines: Lines of `Claims`.
        words: Word to search first, -1 for none; overwritten by the nearest one's,
            shape (1,).
        out: Distance, infinite beyond the limit; word and bit of the nearest cell, -1
            without one; boxes and cells whose exact gap was computed; shape (n, 5).
    """
    claims = claims_of(claims_lines)
    query, best = make_query(), make_nearest()
    query.kind, row = kind, query.row
    row[:] = 0.0
    for n in range(out.shape[0]):
        place_row(kind, local, poses[n], row)
        best.gap, best.word, best.cell = limit + row[0], -1, -1
        best.visited = best.measured = 0
        if unknown:
            search(query, words[0], claims.lattice, claims.unknown, best)
        else:
            search(query, words[0], claims.lattice, claims.occupied, best)
        found = best.word >= 0 or best.gap != best.gap
        out[n, 0] = best.gap - row[0] if found else inf
        out[n, 1], out[n, 2] = best.word, best.cell
        out[n, 3], out[n, 4] = best.visited, best.measured
        if best.word >= 0:
            words[0] = best.word
