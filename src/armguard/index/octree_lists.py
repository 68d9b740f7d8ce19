"""Lists of the octree: entries are allocated, linked, unlinked and freed.

An entry is in the list of its leaf, which is short, and in that of its primitive, whose
length grows with the size of the primitive: only the latter is linked both ways.
"""

from armguard.index.octree_state import (
    COUNT,
    ENTRIES_USED,
    FIRST_ENTRY,
    FREE,
    FREE_BLOCK,
    FREE_ENTRIES,
    FREE_ENTRY,
    IN_LEAF,
    LINK,
    NEXT_IN_LEAF,
    NEXT_OF_PRIMITIVE,
    NODES_USED,
    NONE,
    PARENT,
    PLACE,
    PREVIOUS_OF_PRIMITIVE,
    PRIMITIVE,
    OctreeState,
)
from armguard.kernel import kernel


@kernel
def link_entry(i: int, leaf: int, state: OctreeState) -> None:
    """Add primitive i to a leaf's list. The caller guarantees a free entry."""
    entries, header, residency = state.entries, state.header, state.residency
    entry = header[FREE_ENTRY]
    if entry == NONE:
        entry = header[ENTRIES_USED]
        header[ENTRIES_USED] += 1
    else:
        header[FREE_ENTRY] = entries[entry, NEXT_IN_LEAF]
    header[FREE_ENTRIES] -= 1
    after = residency[i, FIRST_ENTRY]
    entries[entry, PRIMITIVE] = i
    entries[entry, PREVIOUS_OF_PRIMITIVE] = NONE
    entries[entry, NEXT_OF_PRIMITIVE] = after
    if after != NONE:
        entries[after, PREVIOUS_OF_PRIMITIVE] = entry
    residency[i, FIRST_ENTRY] = entry
    hang_entry(entry, leaf, state)


@kernel
def hang_entry(entry: int, leaf: int, state: OctreeState) -> None:
    """Make an entry the head of a leaf's list."""
    entries, nodes = state.entries, state.nodes
    entries[entry, IN_LEAF] = leaf
    entries[entry, NEXT_IN_LEAF] = nodes[leaf, LINK]
    nodes[leaf, LINK] = entry
    nodes[leaf, COUNT] += 1


@kernel
def unhang_entry(entry: int, state: OctreeState) -> None:
    """Remove an entry from its leaf's list."""
    entries, nodes = state.entries, state.nodes
    leaf, after = entries[entry, IN_LEAF], entries[entry, NEXT_IN_LEAF]
    here = nodes[leaf, LINK]
    if here == entry:
        nodes[leaf, LINK] = after
    else:
        while entries[here, NEXT_IN_LEAF] != entry:
            here = entries[here, NEXT_IN_LEAF]
        entries[here, NEXT_IN_LEAF] = after
    nodes[leaf, COUNT] -= 1


@kernel
def take_entry_back(entry: int, state: OctreeState) -> None:
    """Unlink an entry that is in no leaf's list from its primitive, and free it."""
    entries, header = state.entries, state.header
    before = entries[entry, PREVIOUS_OF_PRIMITIVE]
    after = entries[entry, NEXT_OF_PRIMITIVE]
    if before == NONE:
        state.residency[entries[entry, PRIMITIVE], FIRST_ENTRY] = after
    else:
        entries[before, NEXT_OF_PRIMITIVE] = after
    if after != NONE:
        entries[after, PREVIOUS_OF_PRIMITIVE] = before
    entries[entry, PRIMITIVE] = NONE
    entries[entry, NEXT_IN_LEAF] = header[FREE_ENTRY]
    header[FREE_ENTRY] = entry
    header[FREE_ENTRIES] += 1


@kernel
def free_entry(entry: int, state: OctreeState) -> None:
    """Unlink an entry from leaf and primitive, and free it."""
    unhang_entry(entry, state)
    take_entry_back(entry, state)


@kernel
def take_block(parent: int, state: OctreeState) -> int:
    """Allocate eight empty leaves below a node; the first, or NONE without room."""
    nodes, header = state.nodes, state.header
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
        nodes[child, LINK] = NONE
        nodes[child, PARENT] = parent
        nodes[child, COUNT] = 0
        nodes[child, PLACE] = (nodes[parent, PLACE] << 3) + c
    return int(first)


@kernel
def free_block(first: int, state: OctreeState) -> None:
    """Free eight leaves."""
    nodes, header = state.nodes, state.header
    for c in range(8):
        nodes[first + c, COUNT] = FREE
    nodes[first, PARENT] = header[FREE_BLOCK]
    header[FREE_BLOCK] = first
