"""The exact second stage of links as flat tables, beside the primitives they refine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ROW_WIDTH, PlacedShape, Shape, shape_row
from armguard.scene.blocks import Block

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Number = TypeVar("Number", np.int32, np.float64)


@dataclass(frozen=True, slots=True)
class ExactPart:
    """The exact shapes of a link, and its frame.

    Attributes:
        shapes: Its collision geometry, meshes by their hulls.
        T: Frame of the link in its body, or in the world, shape (4, 4).
    """

    shapes: Sequence[PlacedShape]
    T: Floats


@dataclass(frozen=True, slots=True)
class ExactTables:
    """Exact shapes of all links that have any.

    Attributes:
        of_primitive: First exact shape of the link a primitive encloses, and how
            many there are; (-1, 0) where the primitive is exact itself, shape (p, 2).
        kinds: ShapeKind of each exact shape, shape (e,).
        rows: Rows in the frame of the body, or in the world, shape (e, 16).
        errors: Model error of the exact shapes a primitive's link has, the largest;
            0 where the primitive is exact itself, shape (p,) [m].
        shapes: The shapes, whose numbers the rows lead to.
    """

    of_primitive: Ints
    kinds: Ints
    rows: Floats
    errors: Floats
    shapes: tuple[Shape, ...]


def repeated(values: NDArray[Number], blocks: Sequence[Block]) -> NDArray[Number]:
    """A row of each block for each of its primitives."""
    return np.repeat(values, np.array([len(b) for b in blocks], dtype=np.intp), axis=0)


def exact_tables(
    blocks: Sequence[Block], parts: Mapping[str, ExactPart]
) -> ExactTables:
    """Tables for blocks of primitives.

    Args:
        blocks: All blocks, in the order of the tables.
        parts: Exact geometry by owner, of those that have any.
    """
    placed = [(part.T, one) for part in parts.values() for one in part.shapes]
    ranges: dict[str, tuple[int, int]] = {}
    first = 0
    for owner, part in parts.items():
        ranges[owner] = (first, len(part.shapes))
        first += len(part.shapes)
    errors = {
        owner: max((one.model_error for one in part.shapes), default=0.0)
        for owner, part in parts.items()
    }
    of_block = np.array([ranges.get(b.owner, (-1, 0)) for b in blocks], dtype=np.int32)
    error = np.array([errors.get(b.owner, 0.0) for b in blocks], dtype=np.float64)
    rows = [shape_row(one.shape, T @ one.pose.matrix()) for T, one in placed]
    return ExactTables(
        of_primitive=repeated(of_block.reshape(-1, 2), blocks),
        kinds=np.array([int(one.shape.kind) for _, one in placed], dtype=np.int32),
        rows=np.array(rows, dtype=np.float64).reshape(-1, ROW_WIDTH),
        errors=repeated(error, blocks),
        shapes=tuple(one.shape for _, one in placed),
    )
