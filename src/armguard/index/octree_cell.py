"""Cells of an octree: corners, and signed gap of a primitive and a cell."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.cell_gap import cell_gap
from armguard.index.octree_state import OctreeState
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]

# x0, y0, z0, x1, y1, z1: lower and upper corner [m].
Cell = tuple[float, float, float, float, float, float]

# Length by which an outermost cell extends beyond a primitive's box [m]. Any positive
# length serves: the face only has to be outside the primitive.
BEYOND = 1.0


@kernel
def depth_of(place: int) -> int:
    """Depth of a node from its place, 0 for the root."""
    depth = 0
    while place > 1:
        place >>= 3
        depth += 1
    return depth


@kernel
def every_third_bit(code: int) -> int:
    """Bits 0, 3, 6, … 27 of a number, packed."""
    bits = code & 0x09249249
    bits = (bits | (bits >> 2)) & 0x030C30C3
    bits = (bits | (bits >> 4)) & 0x0300F00F
    bits = (bits | (bits >> 8)) & 0x030000FF
    return (bits | (bits >> 16)) & 0x000003FF


@kernel
def steps_of(place: int) -> tuple[int, int, int, int]:
    """Cells along each edge of the cube at a node's depth, and the node's x, y, z."""
    depth = depth_of(place)
    code = place - (1 << (3 * depth))
    return (
        1 << depth,
        every_third_bit(code),
        every_third_bit(code >> 1),
        every_third_bit(code >> 2),
    )


@kernel(entry=True)
def cell_at(place: int, cube: Floats) -> Cell:
    """Corners of a node's cell [m].

    A step divided by a power of two is exact, so two cells that meet, whatever their
    depths, get the same number for the plane between them: no crack.
    """
    count, x, y, z = steps_of(place)
    share = 1.0 / count
    return (
        cube[0, 0] + cube[1, 0] * (x * share),
        cube[0, 1] + cube[1, 1] * (y * share),
        cube[0, 2] + cube[1, 2] * (z * share),
        cube[0, 0] + cube[1, 0] * ((x + 1) * share),
        cube[0, 1] + cube[1, 1] * ((y + 1) * share),
        cube[0, 2] + cube[1, 2] * ((z + 1) * share),
    )


@kernel
def border_of(place: int) -> int:
    """Faces on the root's: bits 0-2 for lower x, y, z, bits 3-5 for upper."""
    count, x, y, z = steps_of(place)
    last = count - 1
    return (
        (x == 0)
        | (y == 0) << 1
        | (z == 0) << 2
        | (x == last) << 3
        | (y == last) << 4
        | (z == last) << 5
    )


@kernel
def open_cell(i: int, place: int, world: World, state: OctreeState) -> Cell:
    """Corners of a cell; faces at the root's border are moved beyond primitive i [m].

    Outermost cells are unbounded outwards: a primitive that leaves the root cube stays
    in the tree.
    """
    x0, y0, z0, x1, y1, z1 = cell_at(place, state.cube)
    border = border_of(place)
    if border:
        boxes = world.boxes
        if border & 1:
            x0 = min(x0, boxes[i, 0] - BEYOND)
        if border & 2:
            y0 = min(y0, boxes[i, 1] - BEYOND)
        if border & 4:
            z0 = min(z0, boxes[i, 2] - BEYOND)
        if border & 8:
            x1 = max(x1, boxes[i, 3] + BEYOND)
        if border & 16:
            y1 = max(y1, boxes[i, 4] + BEYOND)
        if border & 32:
            z1 = max(z1, boxes[i, 5] + BEYOND)
    return x0, y0, z0, x1, y1, z1


@kernel(entry=True)
def grown_gap(i: int, place: int, world: World, state: OctreeState) -> float:
    """Gap between a grown primitive and a cell [m]; it overlaps the cell if <= 0.

    The distance of the core to the cell minus the radius and the growth. So the size of
    a negative value is how far the core may withdraw before the primitive leaves. Far
    away, a lower bound of the gap.

    A NaN row gives NaN, which callers must read as "overlaps".
    """
    x0, y0, z0, x1, y1, z1 = open_cell(i, place, world, state)
    box = world.boxes[i]
    # The gap of the bounding box is a lower bound; if it exceeds the growth, the exact
    # test is not needed.
    apart = max(x0 - box[3], box[0] - x1)
    apart = max(apart, y0 - box[4], box[1] - y1)
    apart = max(apart, z0 - box[5], box[2] - z1)
    if apart > world.growth[i]:
        return float(apart - world.growth[i])
    row = world.rows[i]
    gap = cell_gap(world.kinds[i], row, x0, y0, z0, x1, y1, z1)
    return float(gap - row[0] - world.growth[i])
