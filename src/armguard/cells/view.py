"""Claims about cells as a user reads them: occupied and free cells, and distances."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.clearance import clearances
from armguard.cells.deltas import Delta, apply_deltas
from armguard.cells.grid import Bools, unpacked
from armguard.cells.state import BLOCK_SIDE, SIZES, empty_claims
from armguard.errors import CellMapError
from armguard.geometry.pose import Pose
from armguard.geometry.proximity import distance, local_row, transforms
from armguard.geometry.shapes import Box, Shape
from armguard.kernel import check_cache
from armguard.record import Records, dtype_of
from armguard.table import Ledger

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class NearestCell:
    """The cell nearest to a shape.

    Attributes:
        distance: Distance of the shape to it [m]. Of a shape whose core meets the cell
            it is minus the radius by which the core is grown; infinite without a cell
            within the limit.
        point_shape: Witness point on the shape, world, shape (3,) [m]; NaN without a
            cell.
        point_cell: Witness point on the cell [m].
        cell: Place of the cell along x, y and z; None without one.
    """

    distance: float
    point_shape: Floats
    point_cell: Floats
    cell: tuple[int, int, int] | None


@dataclass(frozen=True, slots=True)
class NearestCells:
    """The cell nearest to a shape at each of n poses.

    Attributes:
        distance: Distances, see `NearestCell`, shape (n,) [m].
        cell: Places of the cells, -1 without one, shape (n, 3).
        measured: Cells whose distance was computed, shape (n,).
    """

    distance: Floats
    cell: NDArray[np.int64]
    measured: NDArray[np.int64]

    def __len__(self) -> int:
        """Count of poses."""
        return len(self.distance)


class CellView:
    """Cells of a cube: occupied, known free, or unknown.

    It is filled by the deltas of a `CellMap`. Its cells are aligned with the world.

    Attributes:
        centre: Middle of the cube, world, shape (3,) [m].
        cell: Edge of a cell [m].
        size: Cells along an edge of the cube.
        claims: State: see `armguard.cells.state.Claims`.

    Args:
        centre: Middle of the cube, world [m].
        cell: Edge of a cell [m].
        size: Cells along an edge of the cube: 64, 128, 256 or 512.

    Raises:
        CellMapError: A number is not finite, not positive, or no such size.
    """

    def __init__(self, centre: ArrayLike, cell: float, size: int = 256) -> None:
        check_cache()
        middle = np.array(centre, dtype=np.float64)
        if middle.shape != (3,) or not np.isfinite(middle).all():
            raise CellMapError(f"centre is {centre!r}; it must be three finite numbers")
        if not 0.0 < cell < inf:
            raise CellMapError(f"cell is {cell}; it must be a positive length [m]")
        if size not in SIZES:
            raise CellMapError(f"size is {size}; it must be one of {SIZES}")
        self.centre, self.cell, self.size = middle, float(cell), size
        self.claims = empty_claims(middle - 0.5 * size * cell, cell, size)
        self._claims = Ledger(self.claims)
        self._first = np.full(1, -1, dtype=np.int32)

    def distance(
        self, shape: Shape, pose: Pose | ArrayLike, limit: float, *,
        unknown: bool = False,
    ) -> NearestCell:  # fmt: skip
        """Distance of a shape to the nearest occupied cell.

        Args:
            shape: The shape.
            pose: Its frame in the world, a `Pose` or a transform of shape (4, 4).
            limit: Distance up to which cells count [m].
            unknown: Whether to measure to the unknown cells in place of the occupied
                ones.

        Raises:
            PoseError: The transform is not rigid.
            CellMapError: The limit is not finite.
        """
        found = self.distances(shape, pose, limit, unknown=unknown)
        if len(found) != 1:
            raise CellMapError(f"there are {len(found)} poses; `distances` takes them")
        if found.cell[0, 0] < 0:
            nowhere = np.full(3, np.nan)
            return NearestCell(float(found.distance[0]), nowhere, nowhere, None)
        x, y, z = found.cell[0].tolist()
        box = Box(size=(self.cell,) * 3)
        middle = Pose(xyz=self.middles(found.cell)[0].tolist())
        both = distance(shape, pose, box, middle)
        return NearestCell(
            float(found.distance[0]), both.point_a, both.point_b, (x, y, z)
        )

    def distances(
        self, shape: Shape, poses: Pose | ArrayLike, limit: float, *,
        unknown: bool = False,
    ) -> NearestCells:  # fmt: skip
        """The same at many poses, each with the same bits as alone.

        Args:
            shape: The shape.
            poses: Its frames in the world, shape (n, 4, 4).
            limit: Distance up to which cells count [m].
            unknown: Whether to measure to the unknown cells.

        Raises:
            PoseError: A transform is not rigid.
            CellMapError: The limit is not finite.
        """
        if not isfinite(limit):
            raise CellMapError(f"limit is {limit}; it must be finite")
        rows = transforms("poses", poses)
        out = np.zeros((len(rows), 5))
        clearances(
            int(shape.kind), local_row(shape), rows, float(limit), unknown,
            self._claims.lines, self._first, out,
        )  # fmt: skip
        cells = np.full((len(rows), 3), -1, dtype=np.int64)
        near = out[:, 1] >= 0.0
        word, bit = out[near, 1].astype(np.int64), out[near, 2].astype(np.int64)
        cells[near] = places_of(word, bit, self.size // BLOCK_SIDE)
        return NearestCells(out[:, 0], cells, out[:, 4].astype(np.int64))

    def middles(self, cells: ArrayLike) -> Floats:
        """Middles of cells, world [m].

        Args:
            cells: Their places along x, y and z, shape (n, 3).
        """
        low = self.centre - 0.5 * self.size * self.cell
        return np.asarray(low + self.cell * (np.asarray(cells) + 0.5))

    def occupied(self) -> Bools:
        """Which cells are occupied, shape (size, size, size), by x, y, z."""
        return unpacked(self.claims.occupied.words, self.size)

    def known_free(self) -> Bools:
        """Which cells are known free, shape (size, size, size), by x, y, z."""
        taken = self.claims.occupied.words | self.claims.unknown.words
        return unpacked(~taken, self.size)

    def apply(self, deltas: Records[Delta]) -> None:
        """Take over changes of a map of the same place and size.

        Args:
            deltas: Result of `CellMap.take_deltas`.

        Raises:
            CellMapError: They are no deltas, or of a larger map.
        """
        found: Any = deltas
        if found.dtype != dtype_of(Delta) or not found.flags.c_contiguous:
            raise CellMapError("deltas are no contiguous array of records of deltas")
        words = len(self.claims.stamp)
        if len(found) and not 0 <= found["word"].min() <= found["word"].max() < words:
            raise CellMapError(
                f"a delta is of a word beyond {words}; use maps of a size"
            )
        apply_deltas(found, self._claims.lines)

    def checkpoint(self) -> bytes:
        """Claims and their evidence as bytes, for `restore`; without own links."""
        return b"".join(array.tobytes() for array in self._arrays())

    def restore(self, data: bytes) -> None:
        """Continue from a checkpoint of another map of the same place and size.

        Args:
            data: Result of `checkpoint`.

        Raises:
            CellMapError: It is of another map; nothing has changed.
        """
        arrays = list(self._arrays())
        own = arrays[0].tobytes()
        if len(data) != sum(a.nbytes for a in arrays) or data[: len(own)] != own:
            raise CellMapError("this checkpoint is of another map, or is damaged")
        at = 0
        for array in arrays:
            part = np.frombuffer(data, array.dtype, array.size, at)
            array[...] = part.reshape(array.shape)
            at += array.nbytes

    def _arrays(self) -> Iterator[NDArray[Any]]:
        """Arrays of the state; the first one is the lattice."""
        yield from arrays_of(self.claims)


def places_of(
    word: NDArray[np.int64], bit: NDArray[np.int64], blocks: int
) -> NDArray[np.int64]:
    """Places of cells along x, y and z.

    Args:
        word: Numbers of their words, shape (n,).
        bit: Their bits in these, shape (n,).
        blocks: Blocks along an edge of the cube.
    """
    members = (bit, word, word >> 6)
    along = np.stack(np.unravel_index(word >> 12, (blocks,) * 3)[::-1], axis=1)
    axes = np.array([0, 2, 4])
    inner = sum((m[:, None] >> axes & 3) << 2 * k for k, m in enumerate(members))
    return np.asarray(BLOCK_SIDE * along + inner)


def arrays_of(table: tuple[Any, ...]) -> Iterator[NDArray[Any]]:
    """Arrays of a table and of the tables in it."""
    for field in table:
        if isinstance(field, tuple):
            yield from arrays_of(field)
        else:
            yield field
