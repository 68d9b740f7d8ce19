"""Boxes around cells, in slots of the tables."""

from math import inf

import numpy as np

from armguard.cells.clearance import ALONG_X, ALONG_Y, ALONG_Z
from armguard.cells.evidence import common_source
from armguard.cells.state import NO_SENSOR, WORD_SIDE
from armguard.cells.words import place_of_word
from armguard.geometry.cell_gap import cell_gap
from armguard.geometry.vec3 import Vec3
from armguard.guard.needs import robot_of
from armguard.guard.sensed import CellKind, Gathered, Sensed
from armguard.guard.sensed_words import inside_of_word
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.lanes import ones
from armguard.table import Vector

UNSEEN = int(CellKind.UNSEEN)

# What becomes one slot: the cells of a word, of a group, or all on one side.
BY_WORD, BY_GROUP, BY_SIDE = 0, 1, 2

# Extent of the space outside the region [m].
FAR = 100.0


@kernel
def gather(low: Vec3, high: Vec3, w: Workspace) -> Gathered:
    """Add a box to the cells that are to be one slot; returns these."""
    s = w.sensed
    side = 0
    if s.search.level == BY_SIDE:
        side = side_of(low, high, w.world.boxes[s.search.primitive])
    g = s.gathered[side]
    if g.count == 0:
        g.stamp, g.error, g.source = inf, 0.0, NO_SENSOR
        for k in range(3):
            g.low[k], g.high[k] = inf, -inf
    g.count += 1
    for k in range(3):
        g.low[k], g.high[k] = min(g.low[k], low[k]), max(g.high[k], high[k])
    return g


@kernel
def side_of(low: Vec3, high: Vec3, box: Vector) -> int:
    """Side of a bounding box from which another box is farthest away.

    Boxes on one side are together no nearer along its axis than the nearest of them.

    Args:
        low: Lower corner of the other box [m].
        high: Its upper corner [m].
        box: Corners of the bounding box, shape (6,) [m].
    """
    side, farthest = 0, -inf
    for k in range(3):
        if box[k] - high[k] > farthest:
            side, farthest = k, box[k] - high[k]
        if low[k] - box[k + 3] > farthest:
            side, farthest = k + 3, low[k] - box[k + 3]
    return side


@kernel
def gather_word(word: int, corner: Vec3, left: np.uint64, w: Workspace) -> None:
    """Add cells of a word, but for those of objects that a robot carries.

    Args:
        word: The word.
        corner: Its lower corner [m].
        left: Its cells of the kind that is judged, or some of them.
        w: The workspace.
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
        return
    cell = claims.lattice.cell
    x0, x1 = ends_along(left, ALONG_X, 1)
    y0, y1 = ends_along(left, ALONG_Y, 4)
    z0, z1 = ends_along(left, ALONG_Z, 16)
    low = (corner[0] + x0 * cell, corner[1] + y0 * cell, corner[2] + z0 * cell)
    high = (corner[0] + x1 * cell, corner[1] + y1 * cell, corner[2] + z1 * cell)
    g = gather(low, high, w)
    stamp = s.about.stamp if s.search.kind >= UNSEEN else claims.stamp[word]
    g.stamp = min(g.stamp, stamp)
    g.error = max(g.error, float(claims.error[word]))
    g.source = common_source(int(g.source), int(claims.source[word]))


@kernel
def is_coarse(cells: np.uint64, g: Gathered, s: Sensed) -> bool:
    """Whether a box around cells of a word blocks a robot, and is not filled by them.

    Args:
        cells: The cells.
        g: The box.
        s: Sensed space, with the primitive that is compared.
    """
    query, edge = s.query, s.claims.lattice.cell
    gap = cell_gap(
        query.kind, query.row, g.low[0], g.low[1], g.low[2], g.high[0], g.high[1],
        g.high[2],
    )  # fmt: skip
    if gap - query.row[0] - g.error > s.search.need:
        return False
    x, y, z = g.high[0] - g.low[0], g.high[1] - g.low[1], g.high[2] - g.low[2]
    return bool(x * y * z > (ones(cells) + 0.5) * edge * edge * edge)


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


@kernel(inline=False)
def slot_of_gathered(g: Gathered, free: int, w: Workspace) -> int:
    """Slot around the cells that were gathered, grown by their error.

    Args:
        g: The cells; nothing is gathered afterwards.
        free: First slot that is not in use; it is placed there if no other one is.
        w: The workspace.

    Returns:
        The slot, or the one after the last if all are in use.
    """
    s = w.sensed
    g.count = 0
    x = (0.5 * (g.low[0] + g.high[0]), 0.5 * (g.high[0] - g.low[0]))
    y = (0.5 * (g.low[1] + g.high[1]), 0.5 * (g.high[1] - g.low[1]))
    z = (0.5 * (g.low[2] + g.high[2]), 0.5 * (g.high[2] - g.low[2]))
    for j in range(s.slots[s.search.kind, 0], free):
        row = w.world.rows[j]
        same = row[0] == g.error and w.watch.seen_at[j] == g.stamp
        same &= row[1] == x[0] and row[4] == x[1] and row[2] == y[0]
        if same and row[5] == y[1] and row[3] == z[0] and row[6] == z[1]:
            return j
    if free == s.slots[s.search.kind, 1]:
        return free
    row, box = w.world.rows[free], w.world.boxes[free]
    row[0], row[1], row[2], row[3] = g.error, x[0], y[0], z[0]
    row[4], row[5], row[6] = x[1], y[1], z[1]
    for k in range(3):
        box[k], box[k + 3] = g.low[k] - g.error, g.high[k] + g.error
    w.watch.seen_at[free] = g.stamp
    s.sources[free - s.slots[0, 0]] = g.source
    return free


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
