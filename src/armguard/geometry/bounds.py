"""Axis-aligned bounding boxes."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.box_separation import axis_of
from armguard.geometry.core_support import core_support
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import scaled
from armguard.kernel import kernel

Row = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
TRIANGLE = int(ShapeKind.TRIANGLE)
HALF_SPACE = int(ShapeKind.HALF_SPACE)


@kernel(entry=True)
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
        elif kind == TRIANGLE:
            out[k] = min(row[1 + k], row[4 + k], row[7 + k]) - radius
            out[3 + k] = max(row[1 + k], row[4 + k], row[7 + k]) + radius
        elif kind == BOX:
            reach = radius
            for axis in range(3):
                reach += abs(row[7 + 3 * k + axis]) * row[4 + axis]
            out[k] = row[1 + k] - reach
            out[3 + k] = row[1 + k] + reach
        elif kind == HALF_SPACE:
            # Without end, but for a side that faces along an axis.
            out[k] = row[1 + k] - radius if row[4 + k] == -1.0 else -inf
            out[3 + k] = row[1 + k] + radius if row[4 + k] == 1.0 else inf
        else:
            high = core_support(kind, row, axis_of(k))
            low = core_support(kind, row, scaled(-1.0, axis_of(k)))
            out[k] = row[1 + k] + low[k] - radius
            out[3 + k] = row[1 + k] + high[k] + radius
