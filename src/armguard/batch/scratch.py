"""What a search of pairs in lanes writes beside its places."""

from typing import Annotated, NamedTuple

from armguard.batch.pose import Place
from armguard.record import record
from armguard.table import TABLE, IntMatrix, LongVector, Matrix, Vector, table

# Pairs that are kept of one span at most; a span with more is searched row by row.
ROOM = 512


@record
class SearchSettings:
    """What a search looks for.

    Attributes:
        margin: Distances from this on are left out [m].
        strict: 1 if distances count above the pair's buffer.
        drop: Infinite where one pair decides a configuration, else 0 [m].
        limit: Greatest joint position [rad or m].
    """

    margin: float
    strict: int
    drop: float
    limit: float


@table
class Scratch(NamedTuple):
    """What one call writes beside its places.

    Attributes:
        settings: What is searched for.
        block: Joint positions of the rows of eight spans, and eight numbers more,
            shape (256 · n + 8,).
        sides: Middle, half width and sum of magnitudes, of eight joints, (24,).
        kept: Pairs that are kept of each span; -1: search its rows, shape (8,).
        pairs: Primitives of those pairs, shape (8 · room, 2).
        low: Least distance they may have in a row, and their buffer, (8 · room, 2) [m].
        single: Rows of a pair in one configuration, its witness, and the pose of a
            body, shape (4, 16).
        cells: Where the joints between two links are searched, cell by cell.
    """

    settings: SearchSettings
    block: Vector
    sides: Vector
    kept: LongVector
    pairs: IntMatrix
    low: Matrix
    single: Matrix
    cells: Annotated[Place, TABLE]
