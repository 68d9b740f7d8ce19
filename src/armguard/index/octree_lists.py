"""Lists of the octree: entries are allocated, linked, unlinked and freed.

An entry is in the list of its leaf, which is short, and in that of its primitive, whose
length grows with the size of the primitive: only the latter is linked both ways.
"""

from armguard.index.octree_state import FREE, NONE, OctreeState
from armguard.kernel import kernel


@kernel
def link_entry(i: int, leaf: int, state: OctreeState) -> None:
    """Add primitive i to a leaf's list. The caller guarantees a free entry."""
    entries, header, residency = state.entries, state.header[0], state.residency
    entry = header.free_entry
    if entry == NONE:
        entry = header.entries_used
        header.entries_used += 1
    else:
        header.free_entry = entries[entry].next_in_leaf
    header.free_entries -= 1
    after = residency[i].first_entry
    entries[entry].primitive = i
    entries[entry].previous_of_primitive = NONE
    entries[entry].next_of_primitive = after
    if after != NONE:
        entries[after].previous_of_primitive = entry
    residency[i].first_entry = entry
    hang_entry(entry, leaf, state)


@kernel
def hang_entry(entry: int, leaf: int, state: OctreeState) -> None:
    """Make an entry the head of a leaf's list."""
    entries, nodes = state.entries, state.nodes
    entries[entry].leaf = leaf
    entries[entry].next_in_leaf = nodes[leaf].link
    nodes[leaf].link = entry
    nodes[leaf].members += 1


@kernel
def unhang_entry(entry: int, state: OctreeState) -> None:
    """Remove an entry from its leaf's list."""
    entries, nodes = state.entries, state.nodes
    leaf, after = entries[entry].leaf, entries[entry].next_in_leaf
    here = nodes[leaf].link
    if here == entry:
        nodes[leaf].link = after
    else:
        while entries[here].next_in_leaf != entry:
            here = entries[here].next_in_leaf
        entries[here].next_in_leaf = after
    nodes[leaf].members -= 1


@kernel
def take_entry_back(entry: int, state: OctreeState) -> None:
    """Unlink an entry that is in no leaf's list from its primitive, and free it."""
    entries, header = state.entries, state.header[0]
    before = entries[entry].previous_of_primitive
    after = entries[entry].next_of_primitive
    if before == NONE:
        state.residency[entries[entry].primitive].first_entry = after
    else:
        entries[before].next_of_primitive = after
    if after != NONE:
        entries[after].previous_of_primitive = before
    entries[entry].primitive = NONE
    entries[entry].next_in_leaf = header.free_entry
    header.free_entry = entry
    header.free_entries += 1


@kernel
def free_entry(entry: int, state: OctreeState) -> None:
    """Unlink an entry from leaf and primitive, and free it."""
    unhang_entry(entry, state)
    take_entry_back(entry, state)


@kernel
def take_block(parent: int, state: OctreeState) -> int:
    """Allocate eight empty leaves below a node; the first, or NONE without room."""
    nodes, header = state.nodes, state.header[0]
    first = header.free_block
    if first != NONE:
        header.free_block = nodes[first].parent
    elif header.nodes_used + 8 <= nodes.shape[0]:
        first = header.nodes_used
        header.nodes_used += 8
    else:
        return NONE
    for c in range(8):
        child = first + c
        nodes[child].link = NONE
        nodes[child].parent = parent
        nodes[child].members = 0
        nodes[child].place = (nodes[parent].place << 3) + c
    return int(first)


@kernel
def free_block(first: int, state: OctreeState) -> None:
    """Free eight leaves."""
    nodes, header = state.nodes, state.header[0]
    for c in range(8):
        nodes[first + c].members = FREE
    nodes[first].parent = header.free_block
    header.free_block = first
