"""State of a map of cells.

A cube is divided into cells. A word has the bits of 4³ cells, a group 4³ words, a block
4³ groups; so words, groups and blocks have edges of 4, 16 and 64 cells. Bit
x + 4y + 16z of a word is its cell (x, y, z), and so on upwards. Words are numbered by
block, group in it and word in that, blocks by rows along x, then y, then z.
"""

from enum import IntEnum
from math import inf
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.record import record, records
from armguard.table import TABLE, ByteVector, IntVector, LongVector, Vector, table

Words = Annotated[NDArray[np.uint64], 1]
Singles = Annotated[NDArray[np.float32], 1]
Triple = Annotated[NDArray[np.float64], (3,)]

# A word of which every cell is set, and none.
ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
NONE = np.uint64(0)

# Cells along an edge of a word, a group, a block.
WORD_SIDE, GROUP_SIDE, BLOCK_SIDE = 4, 16, 64

# Members of a word, a group, a block.
MEMBERS = 64

# Cells along an edge of a block of arrival times.
ARRIVAL_SIDE = 8

# All eight of these of a group, as in `Look.opened`.
EVERY_MEMBER = 255

# Sources of claims that are no sensor's alone; sensors are numbered from 1 on.
NO_SENSOR, SEVERAL = 0, 255

# Lengths of the edge of a map [cells].
SIZES = (64, 128, 256, 512)


class Motion(IntEnum):
    """Class of the occupied cells of a word.

    STILL cells were there when space was first looked at, or have been seen since.
    MOVING cells appeared where space was known free. Cells at the edge of a body that
    come and go are no new ones.
    """

    STILL = 0
    MOVING = 1


@record
class Lattice:
    """Place of the cells.

    Attributes:
        low: Lower corner of the cube, world [m].
        cell: Edge of a cell [m].
        side: Cells along an edge of the cube.
        blocks: Blocks along an edge of the cube.
    """

    low: Triple
    cell: float
    side: int
    blocks: int


@record
class Camera:
    """A pinhole camera where it took an image; z of its frame is the line of sight.

    Attributes:
        axes: Its axes x, y, z in the world, by rows.
        origin: Its place in the world [m].
        focal: Focal lengths along columns and rows [pixels].
        centre: Column and row of the principal point; a pixel's middle has whole
            numbers [pixels].
        reach: Depth up to which space is freed [m].
        side_extents: How far a cube with a half edge of 1 m extends along the normals
            of the sides of the view [pixels · m].
    """

    axes: Annotated[NDArray[np.float64], (3, 3)]
    origin: Triple
    focal: Annotated[NDArray[np.float64], (2,)]
    centre: Annotated[NDArray[np.float64], (2,)]
    reach: float
    side_extents: Annotated[NDArray[np.float64], (4,)]


@table
class Bits(NamedTuple):
    """A set of cells with three levels of summaries.

    Attributes:
        words: Cells of each word, shape (words,).
        groups: Words of each group that are not empty, shape (words / 64,).
        blocks: Groups of each block that are not empty, shape (words / 64²,).
        roots: Blocks that are not empty, 64 to a number.
    """

    words: Words
    groups: Words
    blocks: Words
    roots: Words


@table
class Claims(NamedTuple):
    """Claims of a map about its cells; a cell in neither set is known free.

    Attributes:
        lattice: Place of the cells.
        occupied: Occupied cells.
        unknown: Cells that no sensor has seen, free or occupied.
        stamp: Time at or after which every occupied cell of a word was looked at, of a
            MOVING word every cell that has appeared, of one without occupied cells
            every claim; minus infinity without a claim, shape (words,) [s].
        error: Greatest error of the poses from which it was looked at, shape
            (words,) [m].
        motion: `Motion` of the occupied cells of each word, shape (words,).
        source: Number of the sensor from which the claims of a word are, `NO_SENSOR`,
            or `SEVERAL`, shape (words,).
    """

    lattice: Lattice
    occupied: Annotated[Bits, TABLE]
    unknown: Annotated[Bits, TABLE]
    stamp: Vector
    error: Singles
    motion: ByteVector
    source: ByteVector


@table
class Evidence(NamedTuple):
    """Evidence for the claims, and the words whose claims wait to be sent.

    The evidence of a cell is a number from 0 to 7; bit k of it is in plane k.

    Attributes:
        ones: Plane 0, shape (words,).
        twos: Plane 1.
        fours: Plane 2.
        appeared: Last time at which a cell of a word became occupied where space was
            known free, shape (words,) [s].
        recent: Cells of a word that were occupied since it was empty for some time.
        moving: Cells that have appeared since a word became MOVING.
        occupied_at: Last time at which a word had occupied cells, shape (words,) [s].
        arrival: Time before which nothing can be in a block of 8³ cells, by rows along
            x, then y, then z, shape (words / 8,); empty without an intruder [s].
        waiting: Two rings of words that wait to be sent, of which the first one has
            those with new occupied cells, shape (2 · words,).
        ends: First place and count of each ring, shape (4,).
        marks: Bit 0 and 1: the word is in that ring; bit 2: it was changed since it was
            sent, shape (words,).
    """

    ones: Words
    twos: Words
    fours: Words
    appeared: Vector
    recent: Words
    moving: Words
    occupied_at: Vector
    arrival: Vector
    waiting: IntVector
    ends: LongVector
    marks: ByteVector


@record
class Notes:
    """Counts of a frame.

    Attributes:
        touched: Words with a hit or a pass.
        masked: Words with a cell of own links.
        hit: Cells that are hit.
        passed: Cells that are passed.
    """

    touched: int
    masked: int
    hit: int
    passed: int


@table
class Look(NamedTuple):
    """Hits and passes of one frame, and cells of own links.

    Attributes:
        lattice: Place of the cells.
        camera: Camera of the frame, if it is an image.
        hits: Cells with a measured point, shape (words,).
        sure: Those of them with enough points to count.
        passes: Cells that a sensor has looked through.
        touched: Words with a hit or a pass, shape (words,).
        inside: Cells surely inside own links, shape (words,).
        shell: Other cells that own links may touch.
        kept: Those of `shell` that keep what they have, also if unknown.
        masked: Words with one of these, shape (words,).
        seen: Words of each block of 8³ cells that were wholly passed, shape
            (words / 8,); empty without an intruder.
        opened: Bit k of each group: its member k of 8³ cells may have known free cells,
            shape (words / 64,).
        scratch: Scratch for arrival times.
        notes: Counts.
    """

    lattice: Lattice
    camera: Camera
    hits: Words
    sure: Words
    passes: Words
    touched: IntVector
    inside: Words
    shell: Words
    kept: Words
    masked: IntVector
    seen: ByteVector
    opened: ByteVector
    scratch: Vector
    notes: Notes


def empty_bits(words: int, value: np.uint64) -> Bits:
    """No cells, or all of them.

    Args:
        words: Count of words.
        value: NONE or ALL.
    """
    blocks = words // MEMBERS**2
    roots = np.zeros(-(-blocks // MEMBERS), dtype=np.uint64)
    for k in range(blocks if value else 0):
        roots[k // MEMBERS] |= np.uint64(1) << np.uint64(k % MEMBERS)
    cells, groups, members = (
        np.full(n, value, dtype=np.uint64) for n in (words, words // MEMBERS, blocks)
    )
    return Bits(cells, groups, members, roots)


def empty_claims(low: NDArray[np.float64], cell: float, side: int) -> Claims:
    """Claims of a map that has seen nothing."""
    words = (side // WORD_SIDE) ** 3
    lattice = records((), Lattice)
    lattice["low"], lattice["cell"], lattice["side"] = low, cell, side
    lattice["blocks"] = side // BLOCK_SIDE
    return Claims(
        lattice,
        empty_bits(words, NONE),
        empty_bits(words, ALL),
        np.full(words, -inf),
        np.zeros(words, dtype=np.float32),
        np.zeros(words, dtype=np.uint8),
        np.zeros(words, dtype=np.uint8),
    )


def empty_evidence(words: int, blocks: int) -> Evidence:
    """No evidence.

    Args:
        words: Count of words.
        blocks: Count of arrival times.
    """
    ones, twos, fours = (np.zeros(words, dtype=np.uint64) for _ in range(3))
    return Evidence(
        ones,
        twos,
        fours,
        np.full(words, -inf),
        np.zeros(words, dtype=np.uint64),
        np.zeros(words, dtype=np.uint64),
        np.full(words, -inf),
        np.full(blocks, -inf),
        np.zeros(2 * words, dtype=np.int32),
        np.zeros(4, dtype=np.int64),
        np.zeros(words, dtype=np.uint8),
    )


def empty_look(lattice: Lattice, words: int, blocks: int) -> Look:
    """Room for a frame; see `empty_evidence`."""
    hits, sure, passes, inside, shell, kept = (
        np.zeros(words, dtype=np.uint64) for _ in range(6)
    )
    touched, masked = (np.zeros(words, dtype=np.int32) for _ in range(2))
    # Blocks beside the border of the cube have neighbours outside it.
    padded = 2 * (round(blocks ** (1 / 3)) + 2) ** 3 if blocks else 0
    return Look(
        lattice, records((), Camera), hits, sure, passes, touched, inside, shell,
        kept, masked, np.zeros(blocks, dtype=np.uint8),
        np.full(words // MEMBERS, EVERY_MEMBER, dtype=np.uint8),
        np.zeros(padded), records((), Notes),
    )  # fmt: skip
