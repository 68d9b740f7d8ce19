"""Words of sensed space: claims taken over, and the kinds of obstacle that follow."""

from math import ceil, floor, inf, sqrt

import numpy as np

from armguard.address import array_at, stack
from armguard.cells.deltas import Delta
from armguard.cells.state import (
    ALL,
    MEMBERS,
    NONE,
    WORD_SIDE,
    Bits,
    Lattice,
    Motion,
    Words,
)
from armguard.cells.words import (
    bit,
    corner_of,
    member_corner,
    middle_of,
    put_word,
    word_at,
)
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.sensed import Sensed
from armguard.kernel import kernel
from armguard.lanes import lowest
from armguard.record import Records
from armguard.table import LongVector, Vector, opener

STILL = int(Motion.STILL)
SPHERE = int(ShapeKind.SPHERE)

# Distance of a cube's corner from its middle, in half edges [-].
DIAGONAL = sqrt(3.0)

sensed_of = opener(Sensed)


@kernel(inline=False, entry=True)
def take_claims(deltas: Records[Delta], lines: LongVector) -> None:
    """Take over changes of a map.

    Args:
        deltas: The changes; their words exist.
        lines: Lines of `Sensed`.
    """
    s = sensed_of(lines)
    claims, about = s.claims, s.about
    for k in range(deltas.shape[0]):
        delta = deltas[k]
        word = int(delta.word)
        put_word(word, delta.bits[0], claims.occupied)
        put_word(word, delta.bits[1], claims.unknown)
        claims.stamp[word], claims.error[word] = delta.stamp, delta.error
        claims.motion[word], claims.source[word] = delta.motion, delta.source
        about.newest = max(about.newest, delta.stamp)
        about.error = max(about.error, float(claims.error[word]))
        sort_word(word, s)
    note_oldest(s)


@kernel(inline=False, entry=True)
def sort_words(lines: LongVector) -> None:
    """Sort all words by kind anew, and compute what is known of all together.

    Args:
        lines: Lines of `Sensed`; a stamp or an error that is NaN becomes the worst one.
    """
    s = sensed_of(lines)
    claims = s.claims
    s.about.error = 0.0
    for word in range(claims.stamp.shape[0]):
        put_word(word, claims.occupied.words[word], claims.occupied)
        put_word(word, claims.unknown.words[word], claims.unknown)
        if not claims.stamp[word] > -inf:
            claims.stamp[word] = -inf
        if not claims.error[word] >= 0.0:
            claims.error[word] = inf
        s.about.error = max(s.about.error, float(s.claims.error[word]))
        sort_word(word, s)
    note_oldest(s)


@kernel(inline=False, entry=True)
def sort_some(words: LongVector, lines: LongVector) -> None:
    """Sort some words by kind anew, after other cells are claimed.

    Args:
        words: Their numbers.
        lines: Lines of `Sensed`.
    """
    s = sensed_of(lines)
    for k in range(words.shape[0]):
        sort_word(int(words[k]), s)
    note_oldest(s)


@kernel(inline=False)
def sort_word(word: int, s: Sensed) -> None:
    """Sort the cells of a word by kind; those inside objects are of none."""
    open_cells = ~s.claimed[word]
    occupied = s.claims.occupied.words[word] & open_cells
    moves = s.claims.motion[word] != STILL
    put_if_new(word, NONE if moves else occupied, s.still)
    put_if_new(word, occupied if moves else NONE, s.moving)
    unknown = s.claims.unknown.words[word] & ~occupied & open_cells
    put_if_new(word, unknown & s.may_be_unseen[word], s.unseen)
    put_if_new(word, unknown & s.may_be_growing[word], s.growing)


@kernel
def put_if_new(word: int, cells: np.uint64, out: Bits) -> None:
    """Set the cells of a word, if they differ."""
    if out.words[word] != cells:
        put_word(word, cells, out)


@kernel(inline=False)
def note_oldest(s: Sensed) -> None:
    """Write the oldest stamp of the moving cells."""
    oldest = inf
    cells = s.moving
    for root in range(cells.roots.shape[0]):
        blocks = cells.roots[root]
        while blocks != 0:
            block = (root << 6) + lowest(blocks)
            blocks &= blocks - bit(0)
            groups = cells.blocks[block]
            while groups != 0:
                group = (block << 6) + lowest(groups)
                groups &= groups - bit(0)
                words = cells.groups[group]
                while words != 0:
                    word = (group << 6) + lowest(words)
                    words &= words - bit(0)
                    oldest = min(oldest, s.claims.stamp[word])
    s.about.oldest = oldest


@kernel(inline=False, entry=True)
def mark_inside(
    kind: int, row: Vector, grown: float, lattice: Lattice, out: Words
) -> None:
    """Mark the cells whose middles are inside a primitive that is grown.

    Args:
        kind: ShapeKind.
        row: Its row, world, shape (16,).
        grown: Growth [m].
        lattice: Place of the cells.
        out: Words; bits are added.
    """
    edge = WORD_SIDE * lattice.cell
    words = lattice.side // WORD_SIDE
    bounds = array_at(stack(6), (6,), np.float64)
    row_bounds(kind, row, grown + edge, bounds)
    first = array_at(stack(3), (3,), np.float64)
    last = array_at(stack(3), (3,), np.float64)
    for k in range(3):
        low, high = bounds[k] - lattice.low[k], bounds[3 + k] - lattice.low[k]
        first[k] = min(max(floor(low / edge), 0.0), float(words))
        last[k] = min(max(ceil(high / edge), 0.0), float(words))
    for z in range(int(first[2]), int(last[2])):
        for y in range(int(first[1]), int(last[1])):
            for x in range(int(first[0]), int(last[0])):
                word = word_at(x, y, z, lattice.blocks)
                out[word] |= inside_of_word((x, y, z), kind, row, grown, lattice)


@kernel(inline=False)
def inside_of_word(
    place: tuple[int, int, int], kind: int, row: Vector, grown: float, lattice: Lattice
) -> np.uint64:
    """Cells of a word whose middles are inside a primitive that is grown.

    Args:
        place: Place of the word [words].
        kind: ShapeKind.
        row: Row of the primitive, world, shape (16,).
        grown: Growth [m].
        lattice: Place of the cells.
    """
    ball = array_at(stack(16), (16,), np.float64)
    ball[:] = 0.0
    cell = lattice.cell
    corner = corner_of(place, WORD_SIDE, lattice)
    gap = point_distance(middle_of(corner, WORD_SIDE * cell), kind, row, ball)
    # A distance changes by no more than the way of the point.
    half = DIAGONAL * 0.5 * WORD_SIDE * cell
    if gap - half > grown:
        return NONE
    if gap + half <= grown:
        return ALL
    found = NONE
    for k in range(MEMBERS):
        middle = middle_of(member_corner(corner, cell, k), cell)
        if point_distance(middle, kind, row, ball) <= grown:
            found |= bit(k)
    return found


@kernel
def point_distance(point: Vec3, kind: int, row: Vector, ball: Vector) -> float:
    """Signed distance of a point to a primitive [m].

    Args:
        point: The point [m].
        kind: ShapeKind.
        row: Row of the primitive, world, shape (16,).
        ball: Row of a sphere, zero but for its centre, overwritten.
    """
    out = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    ball[1], ball[2], ball[3] = point
    measure(SPHERE, ball, kind, row, out)
    return float(out[0])
