"""Primitives on their way into the tables, in blocks: one owner, one body."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.bounds import row_bounds
from armguard.geometry.shapes import ROW_WIDTH, PlacedShape, Shape, ShapeKind, shape_row
from armguard.kernel import kernel
from armguard.scene.meshes.surface import Surface, place_triangles

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Kinds whose rows hold addresses of numbers that belong to the shape.
WITH_ADDRESS = (ShapeKind.HULL, ShapeKind.SUPPORT)


@dataclass(frozen=True, slots=True)
class Block:
    """Primitives of one owner that ride on one body.

    Attributes:
        owner: 'robot/link' or an object's name.
        body: Kinematic body they ride on, -1 if they stand still.
        kinds: ShapeKind of each, shape (k,).
        rows: Rows, in the frame of the body or the world, or in that of `T`,
            shape (k, 16).
        model_errors: How far each may reach beyond its surface, shape (k,) [m].
        first: Number of the first of them among their owner's primitives.
        alone: Whether their owner has no more than this one primitive.
        T: Frame the rows of a surface have still to be placed by, shape (4, 4).
        shapes: Shapes whose numbers the rows lead to.
    """

    owner: str
    body: int
    kinds: Ints
    rows: Floats
    model_errors: Floats
    first: int
    alone: bool
    T: Floats | None = None
    shapes: tuple[Shape, ...] = ()

    def __len__(self) -> int:
        """How many primitives."""
        return len(self.kinds)


def blocks_of(
    owner: str,
    shapes: Sequence[PlacedShape],
    surfaces: Sequence[Surface],
    T: Floats,
    body: int,
) -> Iterator[Block]:
    """Blocks of one owner whose frame is at T in its body, or in the world."""
    count = len(shapes) + sum(map(len, surfaces))
    if shapes:
        yield Block(
            owner=owner,
            body=body,
            kinds=np.array([int(s.shape.kind) for s in shapes], dtype=np.int32),
            rows=np.array([shape_row(s.shape, T @ s.pose.matrix()) for s in shapes]),
            model_errors=np.array([s.model_error for s in shapes], dtype=np.float64),
            first=0,
            alone=count == 1,
            shapes=tuple(s.shape for s in shapes if s.shape.kind in WITH_ADDRESS),
        )
    first = len(shapes)
    for surface in surfaces:
        yield Block(
            owner=owner,
            body=body,
            kinds=np.full(len(surface), ShapeKind.TRIANGLE, dtype=np.int32),
            rows=surface.rows,
            model_errors=np.zeros(len(surface)),
            first=first,
            alone=count == 1,
            T=T,
        )
        first += len(surface)


def stacked_rows(blocks: Sequence[Block]) -> Floats:
    """Rows of all blocks, placed, shape (p, 16); a surface is written once."""
    rows = np.empty((sum(map(len, blocks)), ROW_WIDTH))
    start = 0
    for block in blocks:
        part = rows[start : start + len(block)]
        if block.T is None:
            part[:] = block.rows
        else:
            place_triangles(block.rows, block.T, part)
        start += len(block)
    return rows


def index_owners(blocks: Sequence[Block]) -> Ints:
    """What the index counts as one object, numbered, for each primitive, shape (p,).

    What rides on one body is one, what is static is one by its name; but each
    triangle of a surface is one of its own. The index splits a leaf that holds many
    objects, and a surface is not the few large items that parts of an object are.
    """
    numbers: dict[str | int, int] = {}
    used = 0
    owners = np.empty(sum(map(len, blocks)), dtype=np.int32)
    start = 0
    for block in blocks:
        end = start + len(block)
        if block.T is not None:
            owners[start:end] = np.arange(used, used + len(block))
            used += len(block)
        else:
            key = block.owner if block.body < 0 else block.body
            if key not in numbers:
                numbers[key] = used
                used += 1
            owners[start:end] = numbers[key]
        start = end
    return owners


@kernel(inline=False, entry=True)
def extent(kinds: Ints, rows: Floats, out: Floats) -> None:
    """Box around primitives; what has no end on a side is left out on that side.

    Args:
        kinds: Their kinds, shape (k,).
        rows: Their rows, shape (k, 16).
        out: Lower and upper corner, overwritten, shape (6,) [m]; without primitives
            the lower is infinite and the upper minus infinite.
    """
    box = array_at(stack(6), (6,), np.float64)
    for k in range(3):
        out[k], out[k + 3] = np.inf, -np.inf
    for i in range(kinds.shape[0]):
        row_bounds(kinds[i], rows[i], 0.0, box)
        for k in range(6):
            if isfinite(box[k]):
                out[k] = min(out[k], box[k]) if k < 3 else max(out[k], box[k])
