"""Decomposition rule: split leaves above N objects, merge them at N or fewer."""

from armguard.geometry.place import displacement
from armguard.index.octree_cell import depth_of, grown_gap
from armguard.index.octree_lists import (
    free_block,
    hang_entry,
    link_entry,
    take_block,
    take_entry_back,
)
from armguard.index.octree_state import DIVIDED, NONE, OctreeState
from armguard.index.world import World
from armguard.kernel import kernel


@kernel(inline=False)
def split_as_needed(leaf: int, world: World, state: OctreeState) -> None:
    """Split a leaf, and its children, until the rule holds."""
    stack = state.stack
    state.header[0].dropped = 0
    stack[0] = leaf
    height = 1
    while height > 0:
        height -= 1
        node = stack[height]
        if not must_split(node, world, state):
            continue
        first = split(node, world, state)
        if first == NONE:
            state.counters[0].unsplit += 1
            continue
        for c in range(8):
            stack[height] = first + c
            height += 1
    if state.header[0].dropped:
        merge_below(leaf, world, state)


@kernel(inline=False)
def merge_below(top: int, world: World, state: OctreeState) -> None:
    """Merge all leaves that the rule merges below a node that was just split.

    A member may be in none of the children: one that has moved and is not updated yet,
    or one that only touches the node, by rounding. Then the remaining members may not
    require the split.
    """
    nodes, stack = state.nodes, state.stack
    stack[0] = top
    height = 1
    while height > 0:
        height -= 1
        node = stack[height]
        # A leaf; or a node that a merge further up has freed in the meantime.
        if nodes[node].members != DIVIDED:
            continue
        merge_upwards(node, world, state)
        if nodes[node].members == DIVIDED:
            for c in range(8):
                stack[height] = nodes[node].link + c
                height += 1


@kernel
def must_split(leaf: int, world: World, state: OctreeState) -> bool:
    """Whether a leaf has members of more than N objects and may be divided.

    False for a node that is divided already.
    """
    nodes, rule = state.nodes, state.rule[0]
    if not nodes[leaf].members > rule.leaf_capacity:
        return False
    if not depth_of(nodes[leaf].place) < rule.max_depth:
        return False
    state.header[0].token += 1
    return bool(count_owners(leaf, 0, world, state) > rule.leaf_capacity)


@kernel
def count_owners(leaf: int, known: int, world: World, state: OctreeState) -> int:
    """Number of objects in a leaf without the present token, added to known ones.

    Args:
        leaf: The leaf.
        known: Number of objects that have the token already.
        world: The primitives.
        state: The octree.
    """
    token = state.header[0].token
    entry = state.nodes[leaf].link
    while entry != NONE:
        owner = world.owners[state.entries[entry].primitive]
        if state.owner_marks[owner] != token:
            state.owner_marks[owner] = token
            known += 1
        entry = state.entries[entry].next_in_leaf
    return known


@kernel(inline=False)
def split(node: int, world: World, state: OctreeState) -> int:
    """Distribute a leaf's members to eight children.

    Returns:
        The first child, or NONE if there is no room; then nothing has changed.
    """
    nodes, entries = state.nodes, state.entries
    # Each member keeps its entry, and needs up to seven more.
    if state.header[0].free_entries < 7 * nodes[node].members:
        return NONE
    first = take_block(node, state)
    if first == NONE:
        return NONE
    entry = nodes[node].link
    nodes[node].link = first
    nodes[node].members = DIVIDED
    while entry != NONE:
        after = entries[entry].next_in_leaf
        i = entries[entry].primitive
        anchored = i < state.anchors.shape[0]
        moved = 0.0
        if anchored:
            # The slack counts from the anchor, the gaps from where i is now.
            moved = displacement(world.kinds[i], state.anchors[i], world.rows[i])
        linked = 0
        for c in range(8):
            gap = grown_gap(i, nodes[first + c].place, world, state)
            if anchored:
                state.slack[i] = min(state.slack[i], abs(gap) - moved)
            if gap > 0.0:
                continue
            if linked == 0:
                hang_entry(entry, first + c, state)
            else:
                link_entry(i, first + c, state)
            linked += 1
        if linked == 0:
            take_entry_back(entry, state)
            state.header[0].dropped = 1
        entry = after
    state.counters[0].splits += 1
    state.counters[0].visited += 8
    return int(first)


@kernel(inline=False)
def merge_upwards(node: int, world: World, state: OctreeState) -> None:
    """Merge a node's eight leaves if they hold at most N objects, then its parent's."""
    while node != NONE and mergeable(node, world, state):
        merge(node, state)
        node = state.nodes[node].parent


@kernel
def mergeable(node: int, world: World, state: OctreeState) -> bool:
    """Whether a node has eight leaves that together hold at most N objects."""
    nodes = state.nodes
    if nodes[node].members != DIVIDED:
        return False
    first = nodes[node].link
    for c in range(8):
        if nodes[first + c].members == DIVIDED:
            return False
    state.header[0].token += 1
    objects = 0
    for c in range(8):
        objects = count_owners(first + c, objects, world, state)
        if objects > state.rule[0].leaf_capacity:
            return False
    return True


@kernel(inline=False)
def merge(node: int, state: OctreeState) -> None:
    """Replace a node's eight leaves by one leaf with their members, each once."""
    nodes, entries, header = state.nodes, state.entries, state.header[0]
    first = nodes[node].link
    nodes[node].link = NONE
    nodes[node].members = 0
    header.token += 1
    for c in range(8):
        entry = nodes[first + c].link
        while entry != NONE:
            after = entries[entry].next_in_leaf
            i = entries[entry].primitive
            if state.primitive_marks[i] == header.token:
                take_entry_back(entry, state)
            else:
                state.primitive_marks[i] = header.token
                hang_entry(entry, node, state)
            entry = after
    free_block(first, state)
    state.counters[0].merges += 1
