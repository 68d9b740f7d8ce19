"""Distance of a primitive's core to an axis-aligned cell."""

from math import nan, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.box_separation import box_distance
from armguard.geometry.gjk import core_gap
from armguard.geometry.segment_box import nearest_to_box
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3
from armguard.kernel import kernel

Row = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
HALF_SPACE = int(ShapeKind.HALF_SPACE)


@kernel
def outside(x: float, low: float, high: float) -> float:
    """How far x lies outside [low, high]; NaN stays NaN."""
    if x < low:
        return low - x
    if x > high:
        return x - high
    return x - x


@kernel
def point_gap(point: Vec3, low: Vec3, high: Vec3) -> float:
    """Distance of a point to a cell from its lower to its upper corner [m]."""
    dx = outside(point[0], low[0], high[0])
    dy = outside(point[1], low[1], high[1])
    dz = outside(point[2], low[2], high[2])
    return sqrt(dx * dx + dy * dy + dz * dz)


@kernel(inline=False, entry=True)
def cell_gap(
    kind: int,
    row: Row,
    x0: float, y0: float, z0: float, x1: float, y1: float, z1: float,
) -> float:  # fmt: skip
    """Distance of a primitive's core to a cell; 0 where they meet.

    Exact for every kind, so that a long thin link does not inhabit the cells that only
    its bounding box touches. The radius of the row is not taken off.

    Args:
        kind: ShapeKind.
        row: Row of the primitive, shape (16,).
        x0: Lower corner of the cell [m].
        y0: Lower corner.
        z0: Lower corner.
        x1: Upper corner [m].
        y1: Upper corner.
        z1: Upper corner.
    """
    if kind == SPHERE:
        centre = (row[1], row[2], row[3])
        return float(point_gap(centre, (x0, y0, z0), (x1, y1, z1)))
    if kind == CAPSULE:
        cx, cy, cz = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1)
        p = (row[1] - cx, row[2] - cy, row[3] - cz)
        u = (row[4] - row[1], row[5] - row[2], row[6] - row[3])
        t = nearest_to_box(p, u, (x1 - cx, y1 - cy, z1 - cz))
        point = (row[1] + t * u[0], row[2] + t * u[1], row[3] + t * u[2])
        return float(point_gap(point, (x0, y0, z0), (x1, y1, z1)))
    if kind == BOX:
        return float(box_gap(row, x0, y0, z0, x1, y1, z1))
    if kind == HALF_SPACE:
        return float(half_space_gap(row, x0, y0, z0, x1, y1, z1))
    return float(convex_gap(kind, row, x0, y0, z0, x1, y1, z1))


@kernel(inline=False, entry=True)
def is_farther(kind: int, row: Row, low: Vec3, high: Vec3, distance: float) -> bool:
    """Whether a primitive's core is farther from a cell than a distance.

    False for some boxes that are: their edges are not compared. A NaN compares false.

    Args:
        kind: ShapeKind.
        row: Row of the primitive, shape (16,).
        low: Lower corner of the cell [m].
        high: Upper corner [m].
        distance: The distance [m].
    """
    if kind == BOX:
        return bool(box_gap_floor(row, low, high) > distance)
    gap = cell_gap(kind, row, low[0], low[1], low[2], high[0], high[1], high[2])
    return bool(gap > distance)


@kernel
def box_gap_floor(row: Row, low: Vec3, high: Vec3) -> float:
    """Lower bound of the distance of a box core to a cell [m].

    The greater of the distances of each from the other one's bounding box, along its
    own axes.
    """
    square = own = 0.0
    for k in range(3):
        reach = cell = along = 0.0
        for axis in range(3):
            # Columns of the rotation are the axes of the box.
            reach += row[4 + axis] * abs(row[7 + 3 * k + axis])
            cell += 0.5 * (high[axis] - low[axis]) * abs(row[7 + 3 * axis + k])
            middle = 0.5 * (high[axis] + low[axis]) - row[1 + axis]
            along += middle * row[7 + 3 * axis + k]
        gap = outside_by(low[k] - (row[1 + k] + reach), (row[1 + k] - reach) - high[k])
        square += gap * gap
        beyond = abs(along) - (row[4 + k] + cell)
        gap = outside_by(beyond, beyond)
        own += gap * gap
    return sqrt(max(square, own))


@kernel
def half_space_gap(
    row: Row, x0: float, y0: float, z0: float, x1: float, y1: float, z1: float
) -> float:
    """Distance of a cell's deepest corner to a half-space; 0 where they meet."""
    gap = (
        row[4] * ((x0 if row[4] >= 0.0 else x1) - row[1])
        + row[5] * ((y0 if row[5] >= 0.0 else y1) - row[2])
        + row[6] * ((z0 if row[6] >= 0.0 else z1) - row[3])
    )
    return float(0.0 if gap < 0.0 else gap)


@kernel(inline=False)
def convex_gap(
    kind: int,
    row: Row,
    x0: float, y0: float, z0: float, x1: float, y1: float, z1: float,
) -> float:  # fmt: skip
    """Distance of any convex core to a cell, a lower bound sharp to round-off."""
    cell = array_at(stack(16), (16,), np.float64)
    total = 0.0
    for k in range(16):
        cell[k] = 0.0
        total += 0.0 * row[k]
    if total != 0.0:
        return float(nan)
    cell[1], cell[2], cell[3] = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1)
    cell[4], cell[5], cell[6] = x1 - cell[1], y1 - cell[2], z1 - cell[3]
    cell[7] = cell[11] = cell[15] = 1.0
    return float(core_gap(kind, row, BOX, cell))


@kernel
def is_aligned(row: Row) -> bool:
    """Whether a box's axes are the world's, to the last bit; a NaN is not."""
    return bool(
        row[7] == 1.0 and row[11] == 1.0 and row[15] == 1.0
        and row[8] == 0.0 and row[9] == 0.0 and row[10] == 0.0
        and row[12] == 0.0 and row[13] == 0.0 and row[14] == 0.0
    )  # fmt: skip


@kernel
def outside_by(below: float, above: float) -> float:
    """The positive one of two gaps, 0 if there is none; NaN stays NaN."""
    if below > 0.0:
        return below
    if above > 0.0:
        return above
    return 0.0 * (below + above)


@kernel
def box_gap(
    row: Row, x0: float, y0: float, z0: float, x1: float, y1: float, z1: float
) -> float:
    """Distance of a box core to a cell."""
    if is_aligned(row):
        cx, cy, cz = row[1], row[2], row[3]
        # Gap of two intervals, twice: once they overlap, both are negative.
        dx = outside_by(x0 - (cx + row[4]), (cx - row[4]) - x1)
        dy = outside_by(y0 - (cy + row[5]), (cy - row[5]) - y1)
        dz = outside_by(z0 - (cz + row[6]), (cz - row[6]) - z1)
        return sqrt(dx * dx + dy * dy + dz * dz)
    cx, cy, cz = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1)
    centre = (row[1] - cx, row[2] - cy, row[3] - cz)
    cell = (x1 - cx, y1 - cy, z1 - cz)
    half = (row[4], row[5], row[6])
    gap = box_distance(
        cell, half, centre,
        (row[7], row[10], row[13]),
        (row[8], row[11], row[14]),
        (row[9], row[12], row[15]),
    )[0]  # fmt: skip
    return float(0.0 if gap < 0.0 else gap)
