"""State of the N-objects octree: its arrays and their places."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.table import IntMatrix, IntVector, LongVector, Matrix, Vector

# nodes: one row a node; children are blocks of eight, child c at first + c with bit 0
# of c for the upper half in x, bit 1 in y, bit 2 in z.
LINK = 0  # of a leaf, the first entry of its list; of a divided node, its first child
PARENT = 1  # NONE for the root; in a free block, the next free block
COUNT = 2  # number of members of a leaf; DIVIDED; FREE
PLACE = 3  # code of the cell: 1 for the root, 8 · place + c for child c of a node
NODE_WIDTH = 4

DIVIDED = -1
FREE = -2
NONE = -1

# Mark in COUNT of the leaves that a search has found, until they are entered.
FOUND = 1 << 30

# entries: one row for each primitive in each leaf.
PRIMITIVE = 0
IN_LEAF = 1
NEXT_IN_LEAF = 2  # in a free entry, the next free entry
NEXT_OF_PRIMITIVE = 3
PREVIOUS_OF_PRIMITIVE = 4
ENTRY_WIDTH = 5

# residency: one row a primitive.
FIRST_ENTRY = 0
STATUS = 1
RESIDENCY_WIDTH = 2

ABSENT = 0  # not in the tree
INDEXED = 1  # in every leaf it overlaps
OVERFLOWED = 2  # no entry was left; all are candidates until it fits again

# rule: the decomposition rule.
LEAF_CAPACITY = 0  # the paper's N, in objects
MAX_DEPTH = 1
RULE_WIDTH = 2

# header
FREE_BLOCK = 0  # head of the list of free blocks, NONE if empty
NODES_USED = 1  # nodes below this were handed out at least once
FREE_ENTRY = 2
ENTRIES_USED = 3
FREE_ENTRIES = 4  # entries that can still be handed out
TOKEN = 5  # grows with every search, so that marks are never cleared
OVERFLOW_COUNT = 6  # primitives that are OVERFLOWED
DROPPED = 7  # 1 if a split found a member that is in none of the children
HEADER_WIDTH = 8

# counters: they only grow; their difference over a cycle is the work of the cycle.
COUNT_ENTERED = 0
COUNT_LEFT = 1
COUNT_SPLITS = 2
COUNT_MERGES = 3
COUNT_VISITED = 4  # cells tested against a primitive
COUNT_EVALUATED = 5  # updates that searched the tree
COUNT_SKIPPED = 6  # updates that the slack proved unnecessary
COUNT_UNSPLIT = 7  # splits without room; the leaf stays, correct but long
COUNTER_WIDTH = 8

# Greatest depth: a leaf of a ten metre cube is then 1 cm, and a deeper place exceeds 32
# bits [-].
DEPTH_LIMIT = 10

# A walk pushes eight children and takes one of them before it pushes the next eight.
STACK_ROOM = 8 + 7 * DEPTH_LIMIT


class OctreeState(NamedTuple):
    """Arrays of an octree; kernels read and write them in place.

    There may be a million static primitives, so derived values are not stored for them:
    a node's cell follows from its place, and only the first a primitives, which include
    all moving ones, have an anchor and a slack.

    Attributes:
        nodes: Topology, see LINK, shape (n, NODE_WIDTH).
        cube: Lower corner and edges of the root, shape (2, 3) [m].
        entries: Lists of the leaves, see PRIMITIVE, shape (e, ENTRY_WIDTH).
        residency: Entries and status of each primitive, shape (p, RESIDENCY_WIDTH).
        anchors: Row of each primitive when its leaves were determined, (a, 16).
        slack: Displacement of its points from the anchor up to which its leaves are
            unchanged, shape (a,) [m].
        primitive_marks: Scratch, one token a primitive, shape (p,).
        owner_marks: Scratch, one token an object, shape (p,).
        rule: N and the depth limit, shape (RULE_WIDTH,).
        stack: Scratch for walks, shape (STACK_ROOM,).
        found: Scratch for the leaves of a primitive, shape (f,).
        left: Scratch for the parents of leaves that a primitive left, shape (f,).
        box: Scratch for a bounding box, shape (6,) [m].
        header: Free lists and tokens, see FREE_BLOCK, shape (HEADER_WIDTH,).
        counters: Counts of operations, see COUNT_ENTERED, shape (COUNTER_WIDTH,).
    """

    nodes: IntMatrix
    cube: Matrix
    entries: IntMatrix
    residency: IntMatrix
    anchors: Matrix
    slack: Vector
    primitive_marks: LongVector
    owner_marks: LongVector
    rule: LongVector
    stack: IntVector
    found: IntVector
    left: IntVector
    box: Vector
    header: LongVector
    counters: LongVector


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
    nodes = np.zeros((node_capacity, NODE_WIDTH), dtype=np.int32)
    nodes[0] = (NONE, NONE, 0, 1)
    rule = np.zeros(RULE_WIDTH, dtype=np.int64)
    rule[LEAF_CAPACITY] = leaf_capacity
    rule[MAX_DEPTH] = max_depth
    header = np.zeros(HEADER_WIDTH, dtype=np.int64)
    header[FREE_BLOCK] = NONE
    header[NODES_USED] = 1
    header[FREE_ENTRY] = NONE
    header[FREE_ENTRIES] = entry_capacity
    residency = np.zeros((primitive_count, RESIDENCY_WIDTH), dtype=np.int32)
    residency[:, FIRST_ENTRY] = NONE
    anchored = primitive_count if anchor_count is None else anchor_count
    return OctreeState(
        nodes=nodes,
        cube=np.array([low, high - low], dtype=np.float64),
        entries=np.zeros((entry_capacity, ENTRY_WIDTH), dtype=np.int32),
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
        counters=np.zeros(COUNTER_WIDTH, dtype=np.int64),
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
    header = state.header.copy()
    header[FREE_ENTRIES] += header[ENTRIES_USED] + spare_entries - len(state.entries)
    return state._replace(
        nodes=enlarged(state.nodes[: header[NODES_USED]], spare_nodes),
        entries=enlarged(state.entries[: header[ENTRIES_USED]], spare_entries),
        found=np.zeros(spare_entries, dtype=np.int32),
        left=np.zeros(spare_entries, dtype=np.int32),
        header=header,
    )


def enlarged(rows: NDArray[np.int32], spare: int) -> NDArray[np.int32]:
    """Copy of a matrix with further rows of zeros."""
    copy = np.zeros((len(rows) + spare, rows.shape[1]), dtype=np.int32)
    copy[: len(rows)] = rows
    return copy
