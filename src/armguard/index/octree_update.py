"""Insert, remove and move single primitives."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import displacement
from armguard.index.octree_cell import grown_gap
from armguard.index.octree_lists import free_entry, link_entry
from armguard.index.octree_shape import merge_upwards, split_as_needed
from armguard.index.octree_state import (
    ABSENT,
    BORDER,
    COUNT_ENTERED,
    COUNT_EVALUATED,
    COUNT_LEFT,
    COUNT_SKIPPED,
    COUNT_VISITED,
    FIRST_CHILD,
    FIRST_ENTRY,
    FREE_ENTRIES,
    IN_LEAF,
    INDEXED,
    LEAF,
    NEXT_OF_PRIMITIVE,
    NONE,
    OVERFLOW_COUNT,
    OVERFLOWED,
    PARENT,
    STATUS,
    TOKEN,
    OctreeState,
)
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]

# What rounding may add to a displacement or take from a slack [m]: a thousand times
# the last place of a coordinate of ten metres.
ROUNDING = 1e-12


@kernel
def octree_update(i: int, world: World, state: OctreeState) -> None:
    """Let the tree follow primitive i to its present row.

    While no point of its core has moved farther than the slack, every cell is on the
    side it was on, and there is nothing to do.
    """
    if state.residency[i, STATUS] == ABSENT:
        return
    moved = displacement(world.kinds[i], state.anchors[i], world.rows[i])
    if state.residency[i, STATUS] == INDEXED and moved + ROUNDING < state.slack[i]:
        state.counters[COUNT_SKIPPED] += 1
        return
    relocate(i, world, state)


@kernel
def octree_insert(i: int, world: World, state: OctreeState) -> None:
    """Put primitive i into the tree, at its present row."""
    if state.residency[i, STATUS] != ABSENT:
        return
    state.residency[i, STATUS] = INDEXED
    relocate(i, world, state)


@kernel
def octree_remove(i: int, world: World, state: OctreeState) -> None:
    """Take primitive i out of the tree."""
    if state.residency[i, STATUS] == OVERFLOWED:
        state.header[OVERFLOW_COUNT] -= 1
    state.residency[i, STATUS] = ABSENT
    state.header[TOKEN] += 1
    left = leave_unmarked(i, state)
    for k in range(left):
        merge_upwards(state.left[k], world, state)


@kernel(inline=False)
def relocate(i: int, world: World, state: OctreeState) -> None:
    """Determine the leaves of primitive i anew, and its slack.

    The search is local: from a leaf it is in, it climbs to the smallest node that
    holds the primitive with room for its growth, and goes down only where the
    primitive is. A small step searches the neighbourhood, a jump climbs to the root.
    """
    state.counters[COUNT_EVALUATED] += 1
    state.header[TOKEN] += 1
    token = state.header[TOKEN]
    start = search_root(i, world, state)
    found = find_leaves(i, start, world, state)
    state.anchors[i] = world.rows[i]

    fresh = 0
    for k in range(found):
        state.node_marks[state.found[k]] = token
    entry = state.residency[i, FIRST_ENTRY]
    while entry != NONE:
        leaf = state.entries[entry, IN_LEAF]
        if state.node_marks[leaf] == token:
            state.node_marks[leaf] = -token
        entry = state.entries[entry, NEXT_OF_PRIMITIVE]
    for k in range(found):
        fresh += state.node_marks[state.found[k]] == token

    if fresh > state.header[FREE_ENTRIES]:
        overflow(i, world, state)
        return
    if state.residency[i, STATUS] == OVERFLOWED:
        state.residency[i, STATUS] = INDEXED
        state.header[OVERFLOW_COUNT] -= 1
    # A leaf that i keeps is marked -token, one it enters token: mark both alike, so
    # that what bears neither is what it leaves.
    for k in range(found):
        leaf = state.found[k]
        if state.node_marks[leaf] == token:
            link_entry(i, leaf, state)
            state.counters[COUNT_ENTERED] += 1
        state.node_marks[leaf] = token
    # Enter, leave, split, merge: in another order a small step would merge what the
    # next line splits again.
    left = leave_unmarked(i, state)
    for k in range(found):
        split_as_needed(state.found[k], world, state)
    for k in range(left):
        merge_upwards(state.left[k], world, state)


@kernel
def search_root(i: int, world: World, state: OctreeState) -> int:
    """The smallest node above a leaf of primitive i that holds it now, with room.

    Beyond the faces of that node nothing is searched, so they count for the slack.
    """
    state.slack[i] = np.inf
    entry = state.residency[i, FIRST_ENTRY]
    if entry == NONE:
        return 0
    room = world.growth[i]
    row_bounds(world.kinds[i], world.rows[i], room, state.box)
    node = state.entries[entry, IN_LEAF]
    while True:
        inside = room_inside(node, state.box, state)
        if inside > room:
            state.slack[i] = inside
            return int(node)
        if state.nodes[node, PARENT] == NONE:
            return int(node)
        node = state.nodes[node, PARENT]


@kernel
def room_inside(node: int, box: Floats, state: OctreeState) -> float:
    """Least distance from a box to the faces of the node around it [m].

    Negative if the box sticks out; faces at the root's border do not count.
    """
    room = np.inf
    border = state.nodes[node, BORDER]
    for k in range(3):
        if not border & (1 << k):
            room = min(room, box[k] - state.cells[node, k])
        if not border & (1 << (k + 3)):
            room = min(room, state.cells[node, k + 3] - box[k + 3])
    return room


@kernel
def find_leaves(i: int, start: int, world: World, state: OctreeState) -> int:
    """Write the leaves below `start` that primitive i inhabits; lower its slack.

    Returns:
        How many leaves stand in `state.found`.
    """
    nodes, stack = state.nodes, state.stack
    slack = state.slack[i]
    stack[0] = start
    height = 1
    found = 0
    visited = 0
    while height > 0:
        height -= 1
        node = stack[height]
        gap = grown_gap(i, node, world, state)
        visited += 1
        if gap > 0.0:
            slack = min(slack, gap)
        elif nodes[node, FIRST_CHILD] == LEAF:
            slack = min(slack, -gap)
            state.found[found] = node
            found += 1
        else:
            for c in range(8):
                stack[height] = nodes[node, FIRST_CHILD] + c
                height += 1
    state.slack[i] = slack
    state.counters[COUNT_VISITED] += visited
    return found


@kernel
def leave_unmarked(i: int, state: OctreeState) -> int:
    """Take primitive i out of every leaf that does not bear the present token.

    Returns:
        How many parents of such leaves stand in `state.left`.
    """
    token = state.header[TOKEN]
    left = 0
    previous = NONE
    entry = state.residency[i, FIRST_ENTRY]
    while entry != NONE:
        after = state.entries[entry, NEXT_OF_PRIMITIVE]
        leaf = state.entries[entry, IN_LEAF]
        if state.node_marks[leaf] == token:
            previous = entry
        else:
            free_entry(entry, previous, state)
            state.left[left] = state.nodes[leaf, PARENT]
            left += 1
            state.counters[COUNT_LEFT] += 1
        entry = after
    return left


@kernel
def overflow(i: int, world: World, state: OctreeState) -> None:
    """No entry is left for primitive i: from now on everything is its candidate."""
    if state.residency[i, STATUS] != OVERFLOWED:
        state.residency[i, STATUS] = OVERFLOWED
        state.header[OVERFLOW_COUNT] += 1
    state.header[TOKEN] += 1
    left = leave_unmarked(i, state)
    for k in range(left):
        merge_upwards(state.left[k], world, state)
