"""State of the N-objects octree."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.record import Records, Short, record, records
from armguard.table import IntVector, LongVector, Matrix, Vector

# Ends of lists; the parent of the root.
NONE = -1

# In place of the number of members of a leaf.
DIVIDED = -1
FREE = -2

# Mark in the number of members of leaves that a search has found, until these are
# entered.
FOUND = 1 << 30

# Status of a primitive.
ABSENT = 0  # not in the tree
INDEXED = 1  # in every leaf it overlaps
OVERFLOWED = 2  # no entry was left; all are candidates until it fits again

# Greatest depth: a leaf of a ten metre cube is then 1 cm, and a deeper place exceeds 32
# bits [-].
DEPTH_LIMIT = 10

# A walk pushes eight children and takes one of them before it pushes the next eight.
STACK_ROOM = 8 + 7 * DEPTH_LIMIT


@record
class Node:
    """Node of the tree.

    Children are blocks of eight, child c at the first + c with bit 0 of c for the upper
    half in x, bit 1 in y, bit 2 in z.

    Attributes:
        link: Of a leaf, the first entry of its list; of a divided node, its first
            child.
        parent: NONE for the root; in a free block, the next free block.
        members: Number of members of a leaf; DIVIDED; FREE.
        place: Code of the cell: 1 for the root, 8 · place + c for child c of a node.
    """

    link: Short
    parent: Short
    members: Short
    place: Short


@record
class Entry:
    """A primitive in a leaf.

    Attributes:
        primitive: The primitive; NONE in an entry that was freed.
        leaf: The leaf.
        next_in_leaf: Next entry of the leaf; in a free entry, the next free entry.
        next_of_primitive: Next entry of the primitive.
        previous_of_primitive: Previous entry of the primitive.
    """

    primitive: Short
    leaf: Short
    next_in_leaf: Short
    next_of_primitive: Short
    previous_of_primitive: Short


@record
class Residency:
    """Entries and status of a primitive.

    Attributes:
        first_entry: First entry of the primitive.
        status: ABSENT, INDEXED or OVERFLOWED.
    """

    first_entry: Short
    status: Short


@record
class Rule:
    """Decomposition rule.

    Attributes:
        leaf_capacity: The paper's N, in objects.
        max_depth: Depth at which a leaf is not split.
    """

    leaf_capacity: int
    max_depth: int


@record
class Header:
    """Free lists and tokens of a tree.

    Attributes:
        free_block: Head of the list of free blocks, NONE if empty.
        nodes_used: Nodes below this were handed out at least once.
        free_entry: Head of the list of free entries, NONE if empty.
        entries_used: Entries below this were handed out at least once.
        free_entries: Entries that can still be handed out.
        token: Grows with every search, so that marks are never cleared.
        overflow_count: Primitives that are OVERFLOWED.
        dropped: 1 if a split found a member that is in none of the children.
    """

    free_block: int
    nodes_used: int
    free_entry: int
    entries_used: int
    free_entries: int
    token: int
    overflow_count: int
    dropped: int


@record
class Counters:
    """Operations of a tree; a cycle's work is the growth of the counts over the cycle.

    Attributes:
        entered: Leaves entered.
        left: Leaves left.
        splits: Splits.
        merges: Merges.
        visited: Cells tested against a primitive.
        evaluated: Updates that searched the tree.
        skipped: Updates that the slack proved unnecessary.
        unsplit: Splits without room; the leaf stays, correct but long.
    """

    entered: int
    left: int
    splits: int
    merges: int
    visited: int
    evaluated: int
    skipped: int
    unsplit: int


class OctreeState(NamedTuple):
    """Arrays of an octree; kernels read and write them in place.

    There may be a million static primitives, so derived values are not stored for them:
    a node's cell follows from its place, and only the first a primitives, which include
    all moving ones, have an anchor and a slack.

    Attributes:
        nodes: Topology, shape (n,).
        cube: Lower corner and edges of the root, shape (2, 3) [m].
        entries: Lists of the leaves, shape (e,).
        residency: Entries and status of each primitive, shape (p,).
        anchors: Row of each primitive when its leaves were determined, (a, 16).
        slack: Displacement of its points from the anchor up to which its leaves are
            unchanged, shape (a,) [m].
        primitive_marks: Scratch, one token a primitive, shape (p,).
        owner_marks: Scratch, one token an object, shape (p,).
        rule: Decomposition rule, shape (1,).
        stack: Scratch for walks, shape (STACK_ROOM,).
        found: Scratch for the leaves of a primitive, shape (f,).
        left: Scratch for the parents of leaves that a primitive left, shape (f,).
        box: Scratch for a bounding box, shape (6,) [m].
        header: Free lists and tokens, shape (1,).
        counters: Counts of operations, shape (1,).
    """

    nodes: Annotated[Records[Node], 1]
    cube: Matrix
    entries: Annotated[Records[Entry], 1]
    residency: Annotated[Records[Residency], 1]
    anchors: Matrix
    slack: Vector
    primitive_marks: LongVector
    owner_marks: LongVector
    rule: Annotated[Records[Rule], 1]
    stack: IntVector
    found: IntVector
    left: IntVector
    box: Vector
    header: Annotated[Records[Header], 1]
    counters: Annotated[Records[Counters], 1]


def empty_state(
    primitive_count: int,
    *,
    leaf_capacity: int,
    max_depth: int,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    node_capacity: int,
    entry_capacity: int,
    anchor_count: int | None = None,
) -> OctreeState:
    """State of a tree of one empty leaf.

    Args:
        primitive_count: Number of primitives of the world.
        leaf_capacity: N: a leaf with more objects is split.
        max_depth: Depth at which a leaf is not split.
        low: Lower corner of the root cube, shape (3,) [m].
        high: Upper corner of the root cube, shape (3,) [m].
        node_capacity: Greatest number of nodes.
        entry_capacity: Greatest number of entries, and of leaves that a search finds.
        anchor_count: Number of primitives that have an anchor; all if None.
    """
    nodes, rule, header = (
        records(node_capacity, Node),
        records(1, Rule),
        records(1, Header),
    )
    nodes[0] = (NONE, NONE, 0, 1)
    rule[0] = (leaf_capacity, max_depth)
    header.free_block = header.free_entry = NONE
    header.nodes_used, header.free_entries = 1, entry_capacity
    residency = records(primitive_count, Residency)
    residency.first_entry = NONE
    anchored = primitive_count if anchor_count is None else anchor_count
    return OctreeState(
        nodes=nodes,
        cube=np.array([low, high - low], dtype=np.float64),
        entries=records(entry_capacity, Entry),
        residency=residency,
        anchors=np.zeros((anchored, 16)),
        slack=np.zeros(anchored),
        primitive_marks=np.zeros(primitive_count, dtype=np.int64),
        owner_marks=np.zeros(primitive_count, dtype=np.int64),
        rule=rule,
        stack=np.zeros(STACK_ROOM, dtype=np.int32),
        found=np.zeros(entry_capacity, dtype=np.int32),
        left=np.zeros(entry_capacity, dtype=np.int32),
        box=np.zeros(6),
        header=header,
        counters=records(1, Counters),
    )


def state_with_room(
    state: OctreeState, *, spare_nodes: int, spare_entries: int
) -> OctreeState:
    """Copy of a tree in arrays of exact size plus spare capacity for moving primitives.

    Args:
        state: The tree.
        spare_nodes: Number of further nodes.
        spare_entries: Number of further entries, and of leaves that a search finds.
    """
    rows: Any = state.header
    header = rows.copy()
    used = int(header[0].entries_used)
    header.free_entries += used + spare_entries - state.entries.shape[0]
    return state._replace(
        nodes=enlarged(state.nodes, int(header[0].nodes_used), spare_nodes),
        entries=enlarged(state.entries, used, spare_entries),
        found=np.zeros(spare_entries, dtype=np.int32),
        left=np.zeros(spare_entries, dtype=np.int32),
        header=header,
    )


def enlarged(rows: Any, used: int, spare: int) -> Any:
    """Copy of the used rows of records, with further rows of zeros."""
    copy = np.zeros(used + spare, dtype=rows.dtype).view(np.recarray)
    copy[:used] = rows[:used]
    return copy
