"""Lists of the octree: entries handed out, linked, unlinked and taken back."""

from armguard.index.octree_state import (
    BORDER,
    COUNT,
    DEPTH,
    ENTRIES_USED,
    FIRST_CHILD,
    FIRST_ENTRY,
    FREE,
    FREE_BLOCK,
    FREE_ENTRIES,
    FREE_ENTRY,
    HEAD,
    IN_LEAF,
    LEAF,
    LEAF_COUNT,
    NEXT_IN_LEAF,
    NEXT_OF_PRIMITIVE,
    NODES_USED,
    NONE,
    PARENT,
    PREVIOUS_IN_LEAF,
    PRIMITIVE,
    OctreeState,
)
from armguard.kernel import kernel


@kernel
def link_entry(i: int, leaf: int, state: OctreeState) -> None:
    """Put primitive i into a leaf's list. The caller has made sure of a free entry."""
    entries, header = state.entries, state.header
    entry = header[FREE_ENTRY]
    if entry == NONE:
        entry = header[ENTRIES_USED]
        header[ENTRIES_USED] += 1
    else:
        header[FREE_ENTRY] = entries[entry, NEXT_IN_LEAF]
    header[FREE_ENTRIES] -= 1
    entries[entry, PRIMITIVE] = i
    entries[entry, NEXT_OF_PRIMITIVE] = state.residency[i, FIRST_ENTRY]
    state.residency[i, FIRST_ENTRY] = entry
    state.residency[i, LEAF_COUNT] += 1
    hang_entry(entry, leaf, state)


@kernel
def hang_entry(entry: int, leaf: int, state: OctreeState) -> None:
    """Make an entry the head of a leaf's list."""
    entries, nodes = state.entries, state.nodes
    head = nodes[leaf, HEAD]
    entries[entry, IN_LEAF] = leaf
    entries[entry, NEXT_IN_LEAF] = head
    entries[entry, PREVIOUS_IN_LEAF] = NONE
    if head != NONE:
        entries[head, PREVIOUS_IN_LEAF] = entry
    nodes[leaf, HEAD] = entry
    nodes[leaf, COUNT] += 1


@kernel
def unhang_entry(entry: int, state: OctreeState) -> None:
    """Take an entry out of its leaf's list."""
    entries, nodes = state.entries, state.nodes
    leaf = entries[entry, IN_LEAF]
    before, after = entries[entry, PREVIOUS_IN_LEAF], entries[entry, NEXT_IN_LEAF]
    if before == NONE:
        nodes[leaf, HEAD] = after
    else:
        entries[before, NEXT_IN_LEAF] = after
    if after != NONE:
        entries[after, PREVIOUS_IN_LEAF] = before
    nodes[leaf, COUNT] -= 1


@kernel
def free_entry(entry: int, previous: int, state: OctreeState) -> None:
    """Unlink an entry everywhere and take it back.

    Args:
        entry: The entry.
        previous: The entry before it in its primitive's list, NONE if it is first.
        state: The octree.
    """
    entries, header = state.entries, state.header
    i = entries[entry, PRIMITIVE]
    after = entries[entry, NEXT_OF_PRIMITIVE]
    if previous == NONE:
        state.residency[i, FIRST_ENTRY] = after
    else:
        entries[previous, NEXT_OF_PRIMITIVE] = after
    state.residency[i, LEAF_COUNT] -= 1
    unhang_entry(entry, state)
    entries[entry, PRIMITIVE] = NONE
    entries[entry, NEXT_IN_LEAF] = header[FREE_ENTRY]
    header[FREE_ENTRY] = entry
    header[FREE_ENTRIES] += 1


@kernel
def entry_before(entry: int, state: OctreeState) -> int:
    """The entry before this one in its primitive's list, NONE if it is first."""
    entries = state.entries
    previous = NONE
    here = state.residency[entries[entry, PRIMITIVE], FIRST_ENTRY]
    while here != entry:
        previous = here
        here = entries[here, NEXT_OF_PRIMITIVE]
    return int(previous)


@kernel
def take_block(parent: int, state: OctreeState) -> int:
    """Eight empty leaves below a node: first of them, or NONE if there is no room."""
    nodes, cells, header = state.nodes, state.cells, state.header
    first = header[FREE_BLOCK]
    if first != NONE:
        header[FREE_BLOCK] = nodes[first, PARENT]
    elif header[NODES_USED] + 8 <= nodes.shape[0]:
        first = header[NODES_USED]
        header[NODES_USED] += 8
    else:
        return NONE
    for c in range(8):
        child = first + c
        nodes[child, FIRST_CHILD] = LEAF
        nodes[child, PARENT] = parent
        nodes[child, HEAD] = NONE
        nodes[child, COUNT] = 0
        nodes[child, DEPTH] = nodes[parent, DEPTH] + 1
        border = 0
        for k in range(3):
            low, high = cells[parent, k], cells[parent, k + 3]
            # Both halves get the same number for the plane between them: no crack.
            middle = 0.5 * (low + high)
            upper = (c >> k) & 1
            cells[child, k] = middle if upper else low
            cells[child, k + 3] = high if upper else middle
            border |= nodes[parent, BORDER] & (1 << (k + 3 if upper else k))
        nodes[child, BORDER] = border
    return int(first)


@kernel
def free_block(first: int, state: OctreeState) -> None:
    """Take eight leaves back."""
    nodes, header = state.nodes, state.header
    for c in range(8):
        nodes[first + c, FIRST_CHILD] = FREE
    nodes[first, PARENT] = header[FREE_BLOCK]
    header[FREE_BLOCK] = first
