"""Primitives in motion: placed by a transform, and how far they have come.

A transform is twelve numbers, the rows of [R | p].
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel

Row = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
TRIANGLE = int(ShapeKind.TRIANGLE)
CYLINDER = int(ShapeKind.CYLINDER)
CONE = int(ShapeKind.CONE)
ELLIPSOID = int(ShapeKind.ELLIPSOID)
HALF_SPACE = int(ShapeKind.HALF_SPACE)


@kernel
def place_point(T: Row, local: Row, at: int, out: Row) -> None:
    """Write T times the point at place `at` of a row."""
    x, y, z = local[at], local[at + 1], local[at + 2]
    out[at] = T[0] * x + T[1] * y + T[2] * z + T[3]
    out[at + 1] = T[4] * x + T[5] * y + T[6] * z + T[7]
    out[at + 2] = T[8] * x + T[9] * y + T[10] * z + T[11]


@kernel
def turn_row(T: Row, local: Row, at: int, out: Row) -> None:
    """Write T times the direction at place `at` of a row."""
    x, y, z = local[at], local[at + 1], local[at + 2]
    out[at] = T[0] * x + T[1] * y + T[2] * z
    out[at + 1] = T[4] * x + T[5] * y + T[6] * z
    out[at + 2] = T[8] * x + T[9] * y + T[10] * z


@kernel(entry=True)
def place_row(kind: int, local: Row, T: Row, out: Row) -> None:
    """Row of a primitive in the world.

    Args:
        kind: ShapeKind.
        local: Row in the frame T, shape (16,).
        T: Frame in the world, shape (12,).
        out: Row in the world, overwritten, shape (16,).
    """
    if kind <= CAPSULE or kind == TRIANGLE or kind == HALF_SPACE:
        # What a kind does not use is 0: a search for a NaN reads all of a row.
        for k in range(4, ROW_WIDTH):
            out[k] = 0.0
    out[0] = local[0]
    place_point(T, local, 1, out)
    if kind == SPHERE:
        return
    if kind == CAPSULE:
        place_point(T, local, 4, out)
        return
    if kind == TRIANGLE:
        place_point(T, local, 4, out)
        place_point(T, local, 7, out)
        return
    if kind == HALF_SPACE:
        turn_row(T, local, 4, out)
        return
    out[4], out[5], out[6] = local[4], local[5], local[6]
    for r in range(3):
        a, b, c = T[4 * r], T[4 * r + 1], T[4 * r + 2]
        for k in range(3):
            out[7 + 3 * r + k] = (
                a * local[7 + k] + b * local[10 + k] + c * local[13 + k]
            )


@kernel
def apart(a: Row, b: Row, at: int) -> float:
    """Distance of the points at place `at` of two rows [m]."""
    x, y, z = a[at] - b[at], a[at + 1] - b[at + 1], a[at + 2] - b[at + 2]
    return sqrt(x * x + y * y + z * z)


@kernel(entry=True)
def displacement(kind: int, a: Row, b: Row) -> float:
    """Bound on how far any point of a core moved between two rows of a primitive [m].

    Exact for points, segments and triangles, whose points move at most as far as a
    corner does. Otherwise the turning of each axis is counted at the core's full
    reach along it. A half-space that turns moves without bound.
    """
    moved = apart(a, b, 1)
    if kind == SPHERE:
        return float(moved)
    if kind == CAPSULE:
        return float(max(moved, apart(a, b, 4)))
    if kind == TRIANGLE:
        return float(max(moved, apart(a, b, 4), apart(a, b, 7)))
    if kind == HALF_SPACE:
        return float(moved if apart(a, b, 4) == 0.0 else inf)
    for k in range(3):
        x, y, z = a[7 + k] - b[7 + k], a[10 + k] - b[10 + k], a[13 + k] - b[13 + k]
        moved += reach_along(kind, a, k) * sqrt(x * x + y * y + z * z)
    return float(moved)


@kernel
def reach_along(kind: int, row: Row, k: int) -> float:
    """How far a core with a frame reaches along its own axis k, at most [m]."""
    if kind == BOX or kind == ELLIPSOID:
        return float(row[4 + k])
    if kind == CYLINDER or kind == CONE:
        return float(row[5] if k == 2 else max(row[4], row[6]))
    return float(row[6])
