"""Words of cells: bits, places, and sets with their summaries."""

import numpy as np

from armguard.cells.state import Bits, Lattice, Look
from armguard.geometry.vec3 import Vec3
from armguard.kernel import kernel


@kernel
def bit(k: int) -> np.uint64:
    """A number of which bit k alone is set."""
    return np.uint64(1) << np.uint64(k)


@kernel
def word_at(x: int, y: int, z: int, blocks: int) -> int:
    """Number of the word at a place [words]; blocks is that of the lattice."""
    block = ((z >> 4) * blocks + (y >> 4)) * blocks + (x >> 4)
    group = ((z >> 2 & 3) << 4) + ((y >> 2 & 3) << 2) + (x >> 2 & 3)
    return (block << 12) + (group << 6) + ((z & 3) << 4) + ((y & 3) << 2) + (x & 3)


@kernel
def place_of_block(block: int, blocks: int) -> tuple[int, int, int]:
    """Place of a block [blocks]."""
    return (block % blocks, block // blocks % blocks, block // (blocks * blocks))


@kernel
def place_of_word(word: int, blocks: int) -> tuple[int, int, int]:
    """Place of a word [words]."""
    x, y, z = place_of_block(word >> 12, blocks)
    return (
        (x << 4) + (word >> 4 & 12) + (word & 3),
        (y << 4) + (word >> 6 & 12) + (word >> 2 & 3),
        (z << 4) + (word >> 8 & 12) + (word >> 4 & 3),
    )


@kernel
def member_of_group(word: int) -> int:
    """Which of the eight cubes of 8³ cells of its group a word is in."""
    return (word >> 1 & 1) + (word >> 2 & 2) + (word >> 3 & 4)


@kernel
def corner_of(place: tuple[int, int, int], side: int, lattice: Lattice) -> Vec3:
    """Lower corner of a word, group or block, world [m].

    Args:
        place: Its place [words, groups or blocks].
        side: Cells along its edge.
        lattice: Place of the cells.
    """
    edge = side * lattice.cell
    return (
        lattice.low[0] + edge * place[0],
        lattice.low[1] + edge * place[1],
        lattice.low[2] + edge * place[2],
    )


@kernel
def member_corner(corner: Vec3, edge: float, k: int) -> Vec3:
    """Lower corner of member k of a word, group or block [m].

    Args:
        corner: Lower corner of the word, group or block [m].
        edge: Edge of a member [m].
        k: Its bit.
    """
    return (
        corner[0] + edge * (k & 3),
        corner[1] + edge * (k >> 2 & 3),
        corner[2] + edge * (k >> 4),
    )


@kernel
def middle_of(corner: Vec3, edge: float) -> Vec3:
    """Middle of a cube with a lower corner [m]."""
    half = 0.5 * edge
    return (corner[0] + half, corner[1] + half, corner[2] + half)


@kernel
def put_word(word: int, cells: np.uint64, out: Bits) -> None:
    """Set the cells of a word, and the summaries."""
    group = word >> 6
    block = group >> 6
    out.words[word] = cells
    if cells != 0:
        out.groups[group] |= bit(word & 63)
        out.blocks[block] |= bit(group & 63)
        out.roots[block >> 6] |= bit(block & 63)
        return
    out.groups[group] &= ~bit(word & 63)
    if out.groups[group] == 0:
        out.blocks[block] &= ~bit(group & 63)
        if out.blocks[block] == 0:
            out.roots[block >> 6] &= ~bit(block & 63)


@kernel
def touch(word: int, out: Look) -> None:
    """List a word that is about to get its first hit or pass of a frame."""
    if out.hits[word] | out.passes[word] == 0:
        out.touched[out.notes.touched] = word
        out.notes.touched += 1
