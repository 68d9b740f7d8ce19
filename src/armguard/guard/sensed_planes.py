"""Half-spaces in place of many boxes of cells near a primitive.

The nearest box gives a plane: that through its nearest point, across the line from the
primitive, or a little before it. The half-space behind it holds all boxes that lie
wholly behind the plane. The nearest box that is left gives the next plane. So a few
half-spaces stand for hundreds of boxes. They do not end where the boxes do: a link that
is to pass the edge of a box may have to wait until a later cycle finds another plane.
"""

import numpy as np

from armguard.address import array_at, stack
from armguard.cells.evidence import common_source
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3
from armguard.guard.sensed import LISTED, CellBox, Sensed
from armguard.guard.sensed_boxes import (
    bound_slot,
    end_of_slots,
    gap_of_box,
    slot_of_box,
)
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.table import Vector

BOX, HALF_SPACE = int(ShapeKind.BOX), int(ShapeKind.HALF_SPACE)

WITNESS_WIDTH = 10

# A box nearer than this gives no plane [m].
TOUCHES = 1e-4

# How far before its box a plane may lie, as a share of the distance: else each cell
# around a link would need its own plane.
BEFORE = 0.25


@kernel
def list_box(s: Sensed) -> None:
    """Add the box to those near the primitive; note if there is no room."""
    if s.about.listed == LISTED:
        s.about.spent = 1
        return
    g, one = s.box, s.listed[s.about.listed]
    s.about.listed += 1
    one.gap, one.open = gap_of_box(s), 1
    one.stamp, one.error, one.source = g.stamp, g.error, g.source
    for k in range(3):
        one.low[k], one.high[k] = g.low[k], g.high[k]


@kernel
def nearest_open(s: Sensed) -> int:
    """The nearest listed box that is in no slot, -1 if all are. A NaN is nearest."""
    found = -1
    for k in range(s.about.listed):
        one = s.listed[k]
        if one.open == 0:
            continue
        if not one.gap == one.gap:
            return k
        if found < 0 or one.gap < s.listed[found].gap:
            found = k
    return found


@kernel(inline=False)
def slot_of_nearest(nearest: int, free: int, w: Workspace) -> int:
    """Slot that holds a box, and all listed boxes behind a plane through it.

    Args:
        nearest: The nearest box that is in no slot.
        free: First slot that is not in use.
        w: The workspace.

    Returns:
        The slot, or the one after the last if all are in use.
    """
    s = w.sensed
    one, g, query = s.listed[nearest], s.box, s.query
    one.open = 0
    g.stamp, g.error, g.source = one.stamp, one.error, one.source
    for k in range(3):
        g.low[k], g.high[k] = one.low[k], one.high[k]
    witness = array_at(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    row = array_at(stack(ROW_WIDTH), (ROW_WIDTH,), np.float64)
    write_box(g, row)
    measure(query.kind, query.row, BOX, row, witness)
    if not witness[0] - g.error > TOUCHES or free == end_of_slots(s):
        return slot_of_box(free, w)
    n = (witness[7], witness[8], witness[9])
    before = BEFORE * (witness[0] - g.error)
    height = n[0] * witness[4] + n[1] * witness[5] + n[2] * witness[6] - before
    for k in range(s.about.listed):
        other = s.listed[k]
        if other.open != 0 and lowest_along(n, other) >= height:
            other.open = 0
            widen(g, other)
    row = w.world.rows[free]
    w.world.kinds[free] = HALF_SPACE
    for k in range(3):
        row[1 + k], row[4 + k] = witness[4 + k] - before * n[k], -n[k]
    bound_slot(free, w)
    return free


@kernel
def write_box(g: CellBox, out: Vector) -> None:
    """Write the row of a box along the axes of the world, shape (16,)."""
    out[:] = 0.0
    for k in range(3):
        out[1 + k] = 0.5 * (g.low[k] + g.high[k])
        out[4 + k] = 0.5 * (g.high[k] - g.low[k])
        out[7 + 4 * k] = 1.0


@kernel
def lowest_along(n: Vec3, box: CellBox) -> float:
    """Least coordinate of the points of a box along a direction [m]."""
    lowest = 0.0
    for k in range(3):
        lowest += n[k] * (box.low[k] if n[k] > 0.0 else box.high[k])
    return lowest


@kernel
def widen(g: CellBox, other: CellBox) -> None:
    """Add the cells of another box to a box."""
    g.stamp, g.error = min(g.stamp, other.stamp), max(g.error, other.error)
    g.source = common_source(int(g.source), int(other.source))
    for k in range(3):
        g.low[k], g.high[k] = min(g.low[k], other.low[k]), max(g.high[k], other.high[k])
