"""The exact second stage of links as flat tables, beside the primitives they refine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ROW_WIDTH, PlacedShape, Shape, shape_row

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


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
        of_primitive: First exact shape of the link a primitive stands for, and how
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


def exact_tables(
    owners: Sequence[str], sizes: Sequence[int], parts: Mapping[str, ExactPart]
) -> ExactTables:
    """Tables for runs of primitives, each run of one owner.

    Args:
        owners: 'robot/link' or object of each run.
        sizes: Primitives in each run.
        parts: Exact geometry by owner, of those that have any.
    """
    kinds: list[int] = []
    rows: list[Floats] = []
    shapes: list[Shape] = []
    ranges = {}
    errors = {}
    for owner, part in parts.items():
        ranges[owner] = (len(kinds), len(part.shapes))
        errors[owner] = max((placed.model_error for placed in part.shapes), default=0.0)
        for placed in part.shapes:
            kinds.append(int(placed.shape.kind))
            rows.append(shape_row(placed.shape, part.T @ placed.pose.matrix()))
            shapes.append(placed.shape)
    of_run = np.array([ranges.get(owner, (-1, 0)) for owner in owners], dtype=np.int32)
    return ExactTables(
        of_primitive=np.repeat(of_run.reshape(-1, 2), np.array(sizes, np.intp), axis=0),
        kinds=np.array(kinds, dtype=np.int32),
        rows=np.array(rows, dtype=np.float64).reshape(-1, ROW_WIDTH),
        errors=np.repeat(
            np.array([errors.get(owner, 0.0) for owner in owners], dtype=np.float64),
            np.array(sizes, np.intp),
        ),
        shapes=tuple(shapes),
    )
