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
from armguard.index.octree_state import (
    COUNT,
    COUNT_MERGES,
    COUNT_SPLITS,
    COUNT_UNSPLIT,
    COUNT_VISITED,
    DIVIDED,
    DROPPED,
    FREE_ENTRIES,
    LEAF_CAPACITY,
    LINK,
    MAX_DEPTH,
    NEXT_IN_LEAF,
    NONE,
    PARENT,
    PLACE,
    PRIMITIVE,
    TOKEN,
    OctreeState,
)
from armguard.index.world import World
from armguard.kernel import kernel


@kernel(inline=False)
def split_as_needed(leaf: int, world: World, state: OctreeState) -> None:
    """Split a leaf, and its children, until the rule holds."""
    stack = state.stack
    state.header[DROPPED] = 0
    stack[0] = leaf
    height = 1
    while height > 0:
        height -= 1
        node = stack[height]
        if not must_split(node, world, state):
            continue
        first = split(node, world, state)
        if first == NONE:
            state.counters[COUNT_UNSPLIT] += 1
            continue
        for c in range(8):
            stack[height] = first + c
            height += 1
    if state.header[DROPPED]:
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
        if nodes[node, COUNT] != DIVIDED:
            continue
        merge_upwards(node, world, state)
        if nodes[node, COUNT] == DIVIDED:
            for c in range(8):
                stack[height] = nodes[node, LINK] + c
                height += 1


@kernel
def must_split(leaf: int, world: World, state: OctreeState) -> bool:
    """Whether a leaf has members of more than N objects and may be divided.

    False for a node that is divided already.
    """
    nodes, rule = state.nodes, state.rule
    if not nodes[leaf, COUNT] > rule[LEAF_CAPACITY]:
        return False
    if not depth_of(nodes[leaf, PLACE]) < rule[MAX_DEPTH]:
        return False
    state.header[TOKEN] += 1
    return bool(count_owners(leaf, 0, world, state) > rule[LEAF_CAPACITY])


@kernel
def count_owners(leaf: int, known: int, world: World, state: OctreeState) -> int:
    """Number of objects in a leaf without the present token, added to known ones.

    Args:
        leaf: The leaf.
        known: Number of objects that have the token already.
        world: The primitives.
        state: The octree.
    """
    token = state.header[TOKEN]
    entry = state.nodes[leaf, LINK]
    while entry != NONE:
        owner = world.owners[state.entries[entry, PRIMITIVE]]
        if state.owner_marks[owner] != token:
            state.owner_marks[owner] = token
            known += 1
        entry = state.entries[entry, NEXT_IN_LEAF]
    return known


@kernel(inline=False)
def split(node: int, world: World, state: OctreeState) -> int:
    """Distribute a leaf's members to eight children.

    Returns:
        The first child, or NONE if there is no room; then nothing has changed.
    """
    nodes, entries = state.nodes, state.entries
    # Each member keeps its entry, and needs up to seven more.
    if state.header[FREE_ENTRIES] < 7 * nodes[node, COUNT]:
        return NONE
    first = take_block(node, state)
    if first == NONE:
        return NONE
    entry = nodes[node, LINK]
    nodes[node, LINK] = first
    nodes[node, COUNT] = DIVIDED
    while entry != NONE:
        after = entries[entry, NEXT_IN_LEAF]
        i = entries[entry, PRIMITIVE]
        anchored = i < state.anchors.shape[0]
        moved = 0.0
        if anchored:
            # The slack counts from the anchor, the gaps from where i is now.
            moved = displacement(world.kinds[i], state.anchors[i], world.rows[i])
        linked = 0
        for c in range(8):
            gap = grown_gap(i, nodes[first + c, PLACE], world, state)
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
            state.header[DROPPED] = 1
        entry = after
    state.counters[COUNT_SPLITS] += 1
    state.counters[COUNT_VISITED] += 8
    return int(first)


@kernel(inline=False)
def merge_upwards(node: int, world: World, state: OctreeState) -> None:
    """Merge a node's eight leaves if they hold at most N objects, then its parent's."""
    while node != NONE and mergeable(node, world, state):
        merge(node, state)
        node = state.nodes[node, PARENT]


@kernel
def mergeable(node: int, world: World, state: OctreeState) -> bool:
    """Whether a node has eight leaves that together hold at most N objects."""
    nodes = state.nodes
    if nodes[node, COUNT] != DIVIDED:
        return False
    first = nodes[node, LINK]
    for c in range(8):
        if nodes[first + c, COUNT] == DIVIDED:
            return False
    state.header[TOKEN] += 1
    objects = 0
    for c in range(8):
        objects = count_owners(first + c, objects, world, state)
        if objects > state.rule[LEAF_CAPACITY]:
            return False
    return True


@kernel(inline=False)
def merge(node: int, state: OctreeState) -> None:
    """Replace a node's eight leaves by one leaf with their members, each once."""
    nodes, entries, header = state.nodes, state.entries, state.header
    first = nodes[node, LINK]
    nodes[node, LINK] = NONE
    nodes[node, COUNT] = 0
    header[TOKEN] += 1
    for c in range(8):
        entry = nodes[first + c, LINK]
        while entry != NONE:
            after = entries[entry, NEXT_IN_LEAF]
            i = entries[entry, PRIMITIVE]
            if state.primitive_marks[i] == header[TOKEN]:
                take_entry_back(entry, state)
            else:
                state.primitive_marks[i] = header[TOKEN]
                hang_entry(entry, node, state)
            entry = after
    free_block(first, state)
    state.counters[COUNT_MERGES] += 1
