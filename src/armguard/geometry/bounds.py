"""Axis-aligned bounding boxes."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ShapeKind
from armguard.kernel import kernel

Row = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)


@kernel
def row_bounds(kind: int, row: Row, growth: float, out: Row) -> None:
    """Smallest axis-aligned box around a primitive grown by its radius and more.

    Args:
        kind: ShapeKind.
        row: Its row, shape (16,).
        growth: Further growth [m].
        out: Lower and upper corner, overwritten, shape (6,) [m].
    """
    radius = row[0] + growth
    for k in range(3):
        if kind == SPHERE:
            out[k] = row[1 + k] - radius
            out[3 + k] = row[1 + k] + radius
        elif kind == CAPSULE:
            out[k] = min(row[1 + k], row[4 + k]) - radius
            out[3 + k] = max(row[1 + k], row[4 + k]) + radius
        else:
            reach = radius
            for axis in range(3):
                reach += abs(row[7 + 3 * k + axis]) * row[4 + axis]
            out[k] = row[1 + k] - reach
            out[3 + k] = row[1 + k] + reach
