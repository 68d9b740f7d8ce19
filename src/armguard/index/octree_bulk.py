"""Bulk build of an octree: lists of ids are divided from the root downwards.

The tree is canonical, so it equals the one that single inserts give. `grown_gap`
decides which children a primitive overlaps, unless a cheaper test surely agrees: a
bounding box well inside a cell, two boxes that overlap well or are well apart. *Well*
is by a length that exceeds the rounding of either test.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.box_separation import PLANE_SIN
from armguard.geometry.shapes import ShapeKind
from armguard.geometry.vec3 import Vec3
from armguard.index.octree_cell import (
    Cell,
    border_of,
    cell_at,
    depth_of,
    grown_gap,
    open_cell,
)
from armguard.index.octree_lists import link_entry, take_block
from armguard.index.octree_shape import merge_below
from armguard.index.octree_state import ABSENT, DIVIDED, INDEXED, NONE, OctreeState
from armguard.index.octree_update import find_leaves, set_anchor
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Bools = NDArray[np.bool_]

BOX = int(ShapeKind.BOX)

# Bound on the rounding of every test, relative to the largest coordinate [-]. A double
# has sixteen digits and the longest test loses three of them.
CLEAR = 1e-10

# Sine of the angle of two edges above which their cross product is exact enough [-].
TRUSTED_SIN = 1e-5

# Results of `build_tree`.
BUILT = 0
NODES_SHORT = 1
ENTRIES_SHORT = 2
LISTS_SHORT = 3


@kernel(inline=False, entry=True)
def grown_extent(present: Bools, world: World, box: Floats, out: Floats) -> None:
    """Smallest box around the present grown primitives, by their finite sides.

    Args:
        present: True for each primitive that counts, shape (p,).
        world: The primitives.
        box: Scratch, shape (6,).
        out: Lower and upper corner, overwritten, shape (6,) [m]; the lower one above
            the upper if nothing is present.
    """
    for k in range(3):
        out[k], out[k + 3] = np.inf, -np.inf
    for i in range(present.shape[0]):
        if not present[i]:
            continue
        row_bounds(world.kinds[i], world.rows[i], world.growth[i], box)
        for k in range(3):
            if box[k] > -np.inf:
                out[k] = min(out[k], box[k])
            if box[k + 3] < np.inf:
                out[k + 3] = max(out[k + 3], box[k + 3])


@kernel(inline=False, entry=True)
def build_tree(
    present: Bools,
    clear: float,
    world: World,
    state: OctreeState,
    lists: Ints,
    masks: Bytes,
    frames: Longs,
) -> int:
    """Build the tree of the present primitives.

    Depth first: the lists of the nodes on the path are stored in sequence, and each is
    discarded when its node is done.

    Args:
        present: True for each primitive that enters the tree, shape (p,).
        clear: Least length that counts as well inside or well apart [m].
        world: The primitives.
        state: A tree of one empty leaf; left unfinished if a capacity is too small.
        lists: Scratch for ids.
        masks: Scratch for the children of each id of a list, shape (p,).
        frames: Scratch for node, start and length of the open lists, shape
            (STACK_ROOM, 3).

    Returns:
        BUILT, or the capacity that was too small.
    """
    nodes, header = state.nodes, state.header[0]
    count = 0
    for i in range(present.shape[0]):
        if present[i]:
            state.residency[i].status = INDEXED
            lists[count] = i
            count += 1
    frames[0, 0], frames[0, 1], frames[0, 2] = 0, 0, count
    height = 1
    while height > 0:
        height -= 1
        node, start, length = frames[height, 0], frames[height, 1], frames[height, 2]
        if not list_is_long(node, start, length, lists, world, state):
            if header.free_entries < length:
                return ENTRIES_SHORT
            for k in range(start, start + length):
                link_entry(lists[k], node, state)
            continue
        first = take_block(node, state)
        if first == NONE:
            return NODES_SHORT
        nodes[node].link, nodes[node].members = first, DIVIDED
        for c in range(8):
            frames[height + c, 0], frames[height + c, 2] = first + c, 0
        choose_children(node, start, length, clear, world, state, lists, masks)
        if not share_list(start, length, masks, lists, frames[height : height + 8]):
            return LISTS_SHORT
        height += 8
    if header.dropped:
        merge_below(0, world, state)
    settle(world, state)
    return BUILT


@kernel
def share_list(
    start: int, length: int, masks: Bytes, lists: Ints, children: Longs
) -> bool:
    """Write the lists of a node's children behind its own.

    Args:
        start: Start of the node's list.
        length: Its length.
        masks: Bit set of the children of each of its ids.
        lists: The lists.
        children: Node, start and length of each child's list, shape (8, 3); lengths
            are 0 before.

    Returns:
        Whether there was room.
    """
    for k in range(length):
        for c in range(8):
            children[c, 2] += (masks[k] >> c) & 1
    end = start + length
    for c in range(8):
        children[c, 1] = end
        end += children[c, 2]
    if end > lists.shape[0]:
        return False
    for k in range(length):
        for c in range(8):
            if masks[k] & (1 << c):
                lists[children[c, 1]] = lists[start + k]
                children[c, 1] += 1
    for c in range(8):
        children[c, 1] -= children[c, 2]
    return True


@kernel
def list_is_long(
    node: int, start: int, length: int, lists: Ints, world: World, state: OctreeState
) -> bool:
    """Whether a list has ids of more than N objects, and its node may be divided."""
    most = state.rule[0].leaf_capacity
    if (
        length <= most
        or not depth_of(state.nodes[node].place) < state.rule[0].max_depth
    ):
        return False
    state.header[0].token += 1
    token = state.header[0].token
    known = 0
    for k in range(start, start + length):
        owner = world.owners[lists[k]]
        if state.owner_marks[owner] != token:
            state.owner_marks[owner] = token
            known += 1
            if known > most:
                return True
    return False


@kernel
def choose_children(
    node: int,
    start: int,
    length: int,
    clear: float,
    world: World,
    state: OctreeState,
    lists: Ints,
    masks: Bytes,
) -> None:
    """Write the children that each id of a list overlaps, child c as bit c."""
    place = state.nodes[node].place
    x0, y0, z0, x1, y1, z1 = cell_at(place, state.cube)
    _, _, _, mx, my, mz = cell_at(place << 3, state.cube)
    border = border_of(place)
    # Faces at the root's border are at infinity.
    x0, x1 = -np.inf if border & 1 else x0, np.inf if border & 8 else x1
    y0, y1 = -np.inf if border & 2 else y0, np.inf if border & 16 else y1
    z0, z1 = -np.inf if border & 4 else z0, np.inf if border & 32 else z1
    boxes = world.boxes
    for k in range(length):
        i = lists[start + k]
        grown = world.growth[i] + clear
        bx0, by0, bz0 = boxes[i, 0] - grown, boxes[i, 1] - grown, boxes[i, 2] - grown
        bx1, by1, bz1 = boxes[i, 3] + grown, boxes[i, 4] + grown, boxes[i, 5] + grown
        # A NaN leaves every half possible.
        mask = 0xFF
        if bx0 > mx:
            mask &= 0b10101010
        elif bx1 < mx:
            mask &= 0b01010101
        if by0 > my:
            mask &= 0b11001100
        elif by1 < my:
            mask &= 0b00110011
        if bz0 > mz:
            mask &= 0b11110000
        elif bz1 < mz:
            mask &= 0b00001111
        within = (
            bx0 > x0 and by0 > y0 and bz0 > z0 and bx1 < x1 and by1 < y1 and bz1 < z1
        )
        if not (within and mask & (mask - 1) == 0):
            mask = test_children(i, mask, place, clear, world, state)
            if mask == 0:
                # It touches the cell and none of its eighths, by rounding.
                state.header[0].dropped = 1
        masks[k] = mask


@kernel
def test_children(
    i: int, mask: int, place: int, clear: float, world: World, state: OctreeState
) -> int:
    """Children of a mask that primitive i overlaps, as a mask."""
    tested = 0
    kind, row = world.kinds[i], world.rows[i]
    for c in range(8):
        if not mask & (1 << c):
            continue
        child = (place << 3) + c
        answer = 0
        if kind == BOX:
            cell = open_cell(i, child, world, state)
            answer = box_meets_cell(row, world.growth[i], cell, clear)
        if answer > 0 or (answer == 0 and not grown_gap(i, child, world, state) > 0.0):
            tested |= 1 << c
    return tested


@kernel(entry=True)
def box_meets_cell(row: Floats, growth: float, cell: Cell, clear: float) -> int:
    """Whether a grown box overlaps a cell, by a separating axis test with a margin.

    Args:
        row: Row of the box, shape (16,).
        growth: Growth of the box [m].
        cell: The cell.
        clear: Least length that counts as well inside or well apart [m].

    Returns:
        1 if the core and the cell overlap well; -1 if they are well apart along one of
        the fifteen axes that can separate two boxes; 0 if neither is certain, or a
        number is NaN.

    References:
        Ericson, Real-Time Collision Detection, 2005, section 4.4.1.
    """
    x0, y0, z0, x1, y1, z1 = cell
    # The point of the cell nearest to the centre of the box.
    x = min(max(row[1], x0), x1) - row[1]
    y = min(max(row[2], y0), y1) - row[2]
    z = min(max(row[3], z0), z1) - row[3]
    overlap = True
    for k in range(3):
        along = abs(row[7 + k] * x + row[10 + k] * y + row[13 + k] * z)
        overlap = overlap and along < row[4 + k] - clear
    if overlap:
        return 1
    d = (
        0.5 * (x0 + x1) - row[1],
        0.5 * (y0 + y1) - row[2],
        0.5 * (z0 + z1) - row[3],
    )
    h = (0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * (z1 - z0))
    far = row[0] + growth + clear
    overlap = True
    for k in range(3):
        # The normals of the cell, then those of the box.
        u, v, w = row[7 + 3 * k], row[8 + 3 * k], row[9 + 3 * k]
        reach = row[4] * abs(u) + row[5] * abs(v) + row[6] * abs(w)
        gap = abs(d[k]) - h[k] - reach
        if gap > far:
            return -1
        overlap = overlap and gap < -clear
        u, v, w = row[7 + k], row[10 + k], row[13 + k]
        reach = h[0] * abs(u) + h[1] * abs(v) + h[2] * abs(w)
        gap = abs(d[0] * u + d[1] * v + d[2] * w) - row[4 + k] - reach
        if gap > far:
            return -1
        overlap = overlap and gap < -clear
    crossed = edges_meet(row, d, h, far, clear)
    if crossed < 0:
        return -1
    return 1 if overlap and crossed > 0 else 0


@kernel
def edges_meet(row: Floats, d: Vec3, h: Vec3, far: float, clear: float) -> int:
    """Whether a box and a cell overlap along the axes at right angles to two edges.

    Args:
        row: Row of the box, shape (16,).
        d: Centre of the cell from that of the box [m].
        h: Half extents of the cell [m].
        far: Gap from which on they are well apart [m].
        clear: Least length that counts as well inside [m].

    Returns:
        1 if they overlap well along all; -1 if one surely separates them; else 0.
    """
    overlap = True
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            m, n = (j + 1) % 3, (j + 2) % 3
            # Edge i of the cell across edge j of the box: an axis of this length.
            u, v = row[7 + 3 * a + j], row[7 + 3 * b + j]
            length = sqrt(u * u + v * v)
            if length <= PLANE_SIN:
                continue
            reach = h[a] * abs(v) + h[b] * abs(u)
            reach += row[4 + m] * abs(row[7 + 3 * i + n])
            reach += row[4 + n] * abs(row[7 + 3 * i + m])
            gap = abs(d[b] * u - d[a] * v) - reach
            # An axis that is too short has no certain direction, so it decides nothing.
            certain = length > TRUSTED_SIN
            if certain and gap > far * length:
                return -1
            overlap = overlap and certain and gap < -clear * length
    return 1 if overlap else 0


@kernel
def settle(world: World, state: OctreeState) -> None:
    """Write the anchors and slacks of all primitives that have one."""
    for i in range(state.anchors.shape[0]):
        set_anchor(i, world, state)
        state.slack[i] = 0.0
        if state.residency[i].status != ABSENT:
            _, state.slack[i] = find_leaves(i, 0, np.inf, world, state)
