"""Boxes around cells, in slots of the tables."""

import numpy as np

from armguard.cells.clearance import ALONG_X, ALONG_Y, ALONG_Z
from armguard.cells.state import NO_SENSOR, WORD_SIDE, Claims
from armguard.cells.words import place_of_word, word_at
from armguard.geometry.cell_gap import cell_gap, is_farther
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3
from armguard.guard.needs import robot_of
from armguard.guard.sensed import BY_WORD, LISTED, CellBox, CellKind, Sensed
from armguard.guard.sensed_search import EXACT, count_work
from armguard.guard.sensed_words import inside_of_word
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.lanes import ones

UNSEEN = int(CellKind.UNSEEN)
BOX = int(ShapeKind.BOX)

# Listed boxes from which on no further ones are divided.
FINE = LISTED // 2

# Extent of the space outside the region [m].
FAR = 100.0


@kernel
def put_box(low: Vec3, high: Vec3, stamp: float, s: Sensed) -> CellBox:
    """Set the box that is to be one slot; returns it, without errors and source."""
    g = s.box
    g.stamp, g.error, g.source = stamp, 0.0, NO_SENSOR
    for k in range(3):
        g.low[k], g.high[k] = low[k], high[k]
    return g


@kernel
def box_cells(word: int, corner: Vec3, left: np.uint64, w: Workspace) -> bool:
    """Put the box around cells of a word, without those of objects that robots carry.

    Args:
        word: The word.
        corner: Its lower corner [m].
        left: Its cells of the kind that is judged, or some of them.
        w: The workspace.

    Returns:
        False if no cell is left.
    """
    s = w.sensed
    claims = s.claims
    for k in range(s.carried.shape[0]):
        i = int(s.carried[k])
        if robot_of(i, w.watch) >= 0:
            place = place_of_word(word, claims.lattice.blocks)
            left &= ~inside_of_word(
                place, w.world.kinds[i], w.world.rows[i], claims.lattice.cell,
                claims.lattice,
            )  # fmt: skip
    if left == 0:
        return False
    cell = claims.lattice.cell
    x0, x1 = ends_along(left, ALONG_X, 1)
    y0, y1 = ends_along(left, ALONG_Y, 4)
    z0, z1 = ends_along(left, ALONG_Z, 16)
    low = (corner[0] + x0 * cell, corner[1] + y0 * cell, corner[2] + z0 * cell)
    high = (corner[0] + x1 * cell, corner[1] + y1 * cell, corner[2] + z1 * cell)
    stamp = s.about.stamp if s.search.kind >= UNSEEN else claims.stamp[word]
    g = put_box(low, high, stamp, s)
    g.error, g.source = claims.error[word], claims.source[word]
    if s.search.kind >= UNSEEN:
        g.error = error_about(word, claims)
    return True


@kernel
def error_about(word: int, claims: Claims) -> float:
    """Greatest error of a word and of those beside it [m].

    Where a frame that is that far off has freed a word, the one beside it may reach
    into it, though no frame has touched that one.
    """
    blocks, greatest = claims.lattice.blocks, 0.0
    x, y, z = place_of_word(word, blocks)
    last = (blocks << 4) - 1
    for k in range(max(z - 1, 0), min(z + 1, last) + 1):
        for j in range(max(y - 1, 0), min(y + 1, last) + 1):
            for i in range(max(x - 1, 0), min(x + 1, last) + 1):
                greatest = max(greatest, float(claims.error[word_at(i, j, k, blocks)]))
    return greatest


@kernel
def gap_of_box(s: Sensed) -> float:
    """Distance of the primitive from the box, less the error of its cells [m]."""
    g, query = s.box, s.query
    count_work(EXACT, s)
    gap = cell_gap(
        query.kind, query.row, g.low[0], g.low[1], g.low[2], g.high[0], g.high[1],
        g.high[2],
    )  # fmt: skip
    return float(gap - query.row[0] - g.error)


@kernel
def is_filled(cells: np.uint64, s: Sensed) -> bool:
    """Whether cells fill the box around them."""
    g, edge = s.box, s.claims.lattice.cell
    volume = 1.0
    for k in range(3):
        volume *= g.high[k] - g.low[k]
    return bool(volume <= (ones(cells) + 0.5) * edge * edge * edge)


@kernel
def is_coarse(s: Sensed) -> bool:
    """Whether the box is to be divided before it is judged.

    As a slot it is divided if it blocks a robot at rest, and where planes stand for
    boxes if the primitive is nearer than the box is long.
    """
    g, row = s.box, s.query.row
    if s.search.level == BY_WORD:
        low, high = (g.low[0], g.low[1], g.low[2]), (g.high[0], g.high[1], g.high[2])
        need = s.search.need + g.error + row[0]
        return not is_farther(s.query.kind, row, low, high, need)
    gap = gap_of_box(s)
    square = 0.0
    for k in range(3):
        square += (g.high[k] - g.low[k]) * (g.high[k] - g.low[k])
    return bool(s.about.listed < FINE and (gap <= 0.0 or gap * gap < square))


@kernel
def ends_along(cells: np.uint64, one: np.uint64, step: int) -> tuple[int, int]:
    """First cell of a word along an axis that is set, and the one after the last.

    Args:
        cells: Cells of the word, not empty.
        one: Bits of the cells at place 0 along the axis.
        step: Bits from one place to the next.
    """
    first, end = WORD_SIDE, 0
    for k in range(WORD_SIDE):
        if cells & (one << np.uint64(k * step)) != 0:
            first, end = min(first, k), k + 1
    return first, end


@kernel
def first_slot(s: Sensed) -> int:
    """First slot of the kind and the robot that are judged."""
    return int(s.slots[s.search.kind, s.search.robot])


@kernel
def end_of_slots(s: Sensed) -> int:
    """The slot after the last one of theirs."""
    return int(s.slots[s.search.kind, s.search.robot + 1])


@kernel(inline=False)
def slot_of_box(free: int, w: Workspace) -> int:
    """Slot that is the box, grown by the error of its cells.

    Args:
        free: First slot that is not in use; it becomes the box if no other one is.
        w: The workspace.

    Returns:
        The slot, or the one after the last if all are in use.
    """
    s = w.sensed
    g, kinds = s.box, w.world.kinds
    x = (0.5 * (g.low[0] + g.high[0]), 0.5 * (g.high[0] - g.low[0]))
    y = (0.5 * (g.low[1] + g.high[1]), 0.5 * (g.high[1] - g.low[1]))
    z = (0.5 * (g.low[2] + g.high[2]), 0.5 * (g.high[2] - g.low[2]))
    for j in range(first_slot(s), free):
        row = w.world.rows[j]
        same = row[0] == g.error and w.watch.seen_at[j] == g.stamp and kinds[j] == BOX
        same &= row[1] == x[0] and row[4] == x[1] and row[2] == y[0]
        if same and row[5] == y[1] and row[3] == z[0] and row[6] == z[1]:
            return j
    if free == end_of_slots(s):
        return free
    row = w.world.rows[free]
    kinds[free] = BOX
    row[1], row[2], row[3] = x[0], y[0], z[0]
    row[4], row[5], row[6] = x[1], y[1], z[1]
    bound_slot(free, w)
    return free


@kernel
def bound_slot(slot: int, w: Workspace) -> None:
    """Write errors, bounds, stamp and source of a slot: those of the box.

    No robot evades it yet.
    """
    s, g = w.sensed, w.sensed.box
    w.world.rows[slot, 0] = g.error
    box = w.world.boxes[slot]
    for k in range(3):
        box[k], box[k + 3] = g.low[k] - g.error, g.high[k] + g.error
    w.watch.seen_at[slot], w.watch.evaded[slot] = g.stamp, 0
    s.sources[slot - s.slots[0, 0]] = g.source


@kernel
def slab_corner(axis: int, side: int, end: int, first: Vec3, last: Vec3) -> Vec3:
    """Corner of the space beyond a face of the region [m].

    Args:
        axis: Axis along its normal.
        side: 0 for the face with the lower coordinate.
        end: 0 for the lower corner.
        first: Lower corner of the region [m].
        last: Upper corner [m].
    """
    x = slab_end(axis == 0, side, end, first[0], last[0])
    y = slab_end(axis == 1, side, end, first[1], last[1])
    z = slab_end(axis == 2, side, end, first[2], last[2])
    return (x, y, z)


@kernel
def slab_end(along: bool, side: int, end: int, first: float, last: float) -> float:
    """One coordinate of a corner, see `slab_corner` [m]."""
    if along and side == 0 and end == 1:
        return first
    if along and side == 1 and end == 0:
        return last
    return last + FAR if end == 1 else first - FAR
