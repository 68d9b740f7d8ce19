"""Insertion, removal and motion of single primitives in the octree."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import displacement
from armguard.index.octree_cell import border_of, cell_at, grown_gap
from armguard.index.octree_lists import free_entry, link_entry
from armguard.index.octree_shape import merge_upwards, split_as_needed
from armguard.index.octree_state import (
    ABSENT,
    DIVIDED,
    FOUND,
    INDEXED,
    NONE,
    OVERFLOWED,
    OctreeState,
)
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]

# Bound on the rounding of a displacement and a slack [m]: a thousand times the last
# place of a coordinate of ten metres.
ROUNDING = 1e-12


@kernel(entry=True)
def octree_update(i: int, world: World, state: OctreeState) -> None:
    """Update the tree after primitive i moved to its present row.

    While no point of its core has moved farther than the slack, every cell stays on its
    side and nothing changes. A primitive without an anchor is always searched again.
    """
    if state.residency[i].status == ABSENT:
        return
    if i < state.anchors.shape[0] and state.residency[i].status == INDEXED:
        moved = displacement(world.kinds[i], state.anchors[i], world.rows[i])
        if moved + ROUNDING < state.slack[i]:
            state.counters[0].skipped += 1
            return
    relocate(i, world, state)


@kernel(entry=True)
def octree_insert(i: int, world: World, state: OctreeState) -> None:
    """Add primitive i to the tree at its present row."""
    if state.residency[i].status != ABSENT:
        return
    state.residency[i].status = INDEXED
    relocate(i, world, state)


@kernel(entry=True)
def octree_remove(i: int, world: World, state: OctreeState) -> None:
    """Remove primitive i from the tree."""
    if state.residency[i].status == OVERFLOWED:
        state.header[0].overflow_count -= 1
    state.residency[i].status = ABSENT
    withdraw(i, world, state)


@kernel(inline=False)
def withdraw(i: int, world: World, state: OctreeState) -> None:
    """Remove primitive i from all its leaves, and merge leaves by the rule.

    A merge may free entries of i, so the first entry is looked up every time.
    """
    entry = state.residency[i].first_entry
    while entry != NONE:
        parent = state.nodes[state.entries[entry].leaf].parent
        free_entry(entry, state)
        state.counters[0].left += 1
        merge_upwards(parent, world, state)
        entry = state.residency[i].first_entry


@kernel(inline=False)
def relocate(i: int, world: World, state: OctreeState) -> None:
    """Determine the leaves and the slack of primitive i again.

    The search is local: from a leaf of the primitive it climbs to the smallest node
    that contains the primitive with room for its growth, and descends only into cells
    that the primitive overlaps. A large displacement climbs to the root.
    """
    nodes, leaves = state.nodes, state.found
    state.counters[0].evaluated += 1
    if not few_leaves(i, state):
        withdraw(i, world, state)
    start, slack = search_root(i, world, state)
    found, slack = find_leaves(i, start, slack, world, state)
    if i < state.anchors.shape[0]:
        set_anchor(i, world, state)
        state.slack[i] = slack
    if found > leaves.shape[0]:
        overflow(i, world, state)
        return
    # i leaves its leaves without a mark, and enters marked leaves that are not its own
    # yet. All marks are removed before any split or merge.
    for k in range(found):
        nodes[leaves[k]].members += FOUND
    left, kept = leave_unmarked(i, state)
    fits = found - kept <= state.header[0].free_entries
    for k in range(found):
        leaf = leaves[k]
        if nodes[leaf].members >= FOUND:
            nodes[leaf].members -= FOUND
            if fits:
                link_entry(i, leaf, state)
                state.counters[0].entered += 1
    if fits and state.residency[i].status == OVERFLOWED:
        state.residency[i].status = INDEXED
        state.header[0].overflow_count -= 1
    # Enter, leave, split, merge: in another order a small step would merge leaves that
    # the next line splits again.
    if fits:
        for k in range(found):
            split_as_needed(leaves[k], world, state)
    for k in range(left):
        merge_upwards(state.left[k], world, state)
    if not fits:
        overflow(i, world, state)


@kernel
def set_anchor(i: int, world: World, state: OctreeState) -> None:
    """Keep the row of primitive i as its anchor.

    Number by number: Numba's assignment of a row also compiles what puts its shape into
    the message of an error, which takes two seconds.
    """
    for k in range(state.anchors.shape[1]):
        state.anchors[i, k] = world.rows[i, k]


@kernel
def few_leaves(i: int, state: OctreeState) -> bool:
    """Whether `left` has room for the parents of all leaves of primitive i."""
    count = 0
    entry = state.residency[i].first_entry
    while entry != NONE:
        count += 1
        if count > state.left.shape[0]:
            return False
        entry = state.entries[entry].next_of_primitive
    return True


@kernel
def search_root(i: int, world: World, state: OctreeState) -> tuple[int, float]:
    """Smallest node above a leaf of primitive i that contains it now, with room.

    Returns:
        The node, and the distance of i from its faces [m]: cells beyond them are not
        searched, so this distance bounds the slack.
    """
    entry = state.residency[i].first_entry
    if entry == NONE:
        return 0, np.inf
    room = world.growth[i]
    row_bounds(world.kinds[i], world.rows[i], room, state.box)
    node = int(state.entries[entry].leaf)
    while True:
        inside = room_inside(state.nodes[node].place, state.box, state.cube)
        if inside > room:
            return node, float(inside)
        if state.nodes[node].parent == NONE:
            return node, np.inf
        node = int(state.nodes[node].parent)


@kernel
def room_inside(place: int, box: Floats, cube: Floats) -> float:
    """Least distance from a box to the faces of the cell around it [m].

    Negative if the box is partly outside; faces at the root's border do not count.
    """
    x0, y0, z0, x1, y1, z1 = cell_at(place, cube)
    border = border_of(place)
    room = np.inf
    if not border & 1:
        room = min(room, box[0] - x0)
    if not border & 2:
        room = min(room, box[1] - y0)
    if not border & 4:
        room = min(room, box[2] - z0)
    if not border & 8:
        room = min(room, x1 - box[3])
    if not border & 16:
        room = min(room, y1 - box[4])
    if not border & 32:
        room = min(room, z1 - box[5])
    return room


@kernel
def find_leaves(
    i: int, start: int, slack: float, world: World, state: OctreeState
) -> tuple[int, float]:
    """Write the leaves below `start` that primitive i overlaps into `state.found`.

    Returns:
        Their number, which exceeds the length of `found` if they do not fit; and the
        slack, reduced by every tested cell [m].
    """
    nodes, stack = state.nodes, state.stack
    stack[0] = start
    height = 1
    found = 0
    visited = 0
    while height > 0:
        height -= 1
        node = stack[height]
        gap = grown_gap(i, nodes[node].place, world, state)
        visited += 1
        if gap > 0.0:
            slack = min(slack, gap)
        elif nodes[node].members == DIVIDED:
            for c in range(8):
                stack[height] = nodes[node].link + c
                height += 1
        else:
            slack = min(slack, -gap)
            if found < state.found.shape[0]:
                state.found[found] = node
            found += 1
    state.counters[0].visited += visited
    return found, slack


@kernel
def leave_unmarked(i: int, state: OctreeState) -> tuple[int, int]:
    """Remove primitive i from its leaves without a mark, and the marks of the others.

    Returns:
        Number of parents in `state.left`, and number of leaves that i kept.
    """
    nodes, entries = state.nodes, state.entries
    left = 0
    kept = 0
    entry = state.residency[i].first_entry
    while entry != NONE:
        after = entries[entry].next_of_primitive
        leaf = entries[entry].leaf
        if nodes[leaf].members >= FOUND:
            nodes[leaf].members -= FOUND
            kept += 1
        else:
            free_entry(entry, state)
            state.left[left] = nodes[leaf].parent
            left += 1
        entry = after
    state.counters[0].left += left
    return left, kept


@kernel
def overflow(i: int, world: World, state: OctreeState) -> None:
    """Mark primitive i as overflowed: from now on all primitives are its candidates."""
    if state.residency[i].status != OVERFLOWED:
        state.residency[i].status = OVERFLOWED
        state.header[0].overflow_count += 1
    withdraw(i, world, state)
