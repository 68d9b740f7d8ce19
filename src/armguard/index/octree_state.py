"""Arrays of the N-objects octree, and what their places mean."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# nodes: one row a node; children stand in blocks of eight, child c at first + c with
# bit 0 of c for the upper half in x, bit 1 in y, bit 2 in z.
FIRST_CHILD = 0  # LEAF, or the first of eight children
PARENT = 1  # -1 for the root; in a free block, the next free block
HEAD = 2  # first entry of a leaf's list, NONE if empty
COUNT = 3  # members of a leaf
DEPTH = 4  # 0 for the root
BORDER = 5  # bits 0-2: touches the root's lower x, y, z face; bits 3-5: the upper
NODE_WIDTH = 6

LEAF = -1
FREE = -2
NONE = -1

# entries: one row for each primitive in each leaf.
PRIMITIVE = 0
IN_LEAF = 1
NEXT_IN_LEAF = 2  # in a free entry, the next free entry
PREVIOUS_IN_LEAF = 3
NEXT_OF_PRIMITIVE = 4
ENTRY_WIDTH = 5

# residency: one row a primitive.
FIRST_ENTRY = 0
LEAF_COUNT = 1
STATUS = 2
RESIDENCY_WIDTH = 3

ABSENT = 0  # not in the tree
INDEXED = 1  # in every leaf it overlaps
OVERFLOWED = 2  # no entry was left; everything is a candidate until it fits again

# header
LEAF_CAPACITY = 0  # the paper's N, in objects
MAX_DEPTH = 1
FREE_BLOCK = 2  # head of the list of free blocks, NONE if empty
NODES_USED = 3  # nodes below this were handed out at least once
FREE_ENTRY = 4
ENTRIES_USED = 5
FREE_ENTRIES = 6  # entries that can still be handed out
TOKEN = 7  # grows with every search, so that marks need no clearing
OVERFLOW_COUNT = 8  # primitives that are OVERFLOWED
DROPPED = 9  # 1 if a split found a member that is in none of the children
HEADER_WIDTH = 10

# counters: they only grow; the difference over a cycle is what the cycle did.
COUNT_ENTERED = 0
COUNT_LEFT = 1
COUNT_SPLITS = 2
COUNT_MERGES = 3
COUNT_VISITED = 4  # cells tested against a primitive
COUNT_EVALUATED = 5  # updates that had to look at the tree
COUNT_SKIPPED = 6  # updates that the slack proved needless
COUNT_UNSPLIT = 7  # splits that had no room; the leaf stays, correct but long
COUNTER_WIDTH = 8


class OctreeState(NamedTuple):
    """All an octree consists of; kernels read and write it in place.

    Attributes:
        nodes: Topology, shape (n, NODE_WIDTH).
        cells: Lower and upper corner of each node, shape (n, 6) [m].
        entries: Lists of the leaves, shape (e, ENTRY_WIDTH).
        residency: Where each primitive is, shape (p, RESIDENCY_WIDTH).
        anchors: Row each primitive had when its leaves were determined, (p, 16).
        slack: How far its points may move before its leaves can change, (p,) [m].
        node_marks: Scratch, one token a node, shape (n,).
        primitive_marks: Scratch, one token a primitive, shape (p,).
        owner_marks: Scratch, one token an object, shape (p,).
        stack: Scratch for walks, shape (n,).
        found: Scratch for leaves, shape (n,).
        left: Scratch for parents of leaves, shape (n,).
        box: Scratch for a bounding box, shape (6,).
        header: Settings and free lists, shape (HEADER_WIDTH,).
        counters: What was done, shape (COUNTER_WIDTH,).
    """

    nodes: NDArray[np.int32]
    cells: NDArray[np.float64]
    entries: NDArray[np.int32]
    residency: NDArray[np.int32]
    anchors: NDArray[np.float64]
    slack: NDArray[np.float64]
    node_marks: NDArray[np.int64]
    primitive_marks: NDArray[np.int64]
    owner_marks: NDArray[np.int64]
    stack: NDArray[np.int32]
    found: NDArray[np.int32]
    left: NDArray[np.int32]
    box: NDArray[np.float64]
    header: NDArray[np.int64]
    counters: NDArray[np.int64]


def empty_state(
    primitive_count: int,
    *,
    leaf_capacity: int,
    max_depth: int,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    node_capacity: int,
    entry_capacity: int,
) -> OctreeState:
    """A tree of one empty leaf.

    Args:
        primitive_count: Rows the tree is for.
        leaf_capacity: N: a leaf with more members is split.
        max_depth: A leaf at this depth is not split.
        low: Lower corner of the root cube, shape (3,) [m].
        high: Upper corner, shape (3,) [m].
        node_capacity: Room for nodes.
        entry_capacity: Room for entries.
    """
    nodes = np.full((node_capacity, NODE_WIDTH), FREE, dtype=np.int32)
    nodes[0] = (LEAF, NONE, NONE, 0, 0, 0b111111)
    cells = np.zeros((node_capacity, 6))
    cells[0, :3] = low
    cells[0, 3:] = high
    header = np.zeros(HEADER_WIDTH, dtype=np.int64)
    header[LEAF_CAPACITY] = leaf_capacity
    header[MAX_DEPTH] = max_depth
    header[FREE_BLOCK] = NONE
    header[NODES_USED] = 1
    header[FREE_ENTRY] = NONE
    header[FREE_ENTRIES] = entry_capacity
    residency = np.zeros((primitive_count, RESIDENCY_WIDTH), dtype=np.int32)
    residency[:, FIRST_ENTRY] = NONE
    return OctreeState(
        nodes=nodes,
        cells=cells,
        entries=np.full((entry_capacity, ENTRY_WIDTH), NONE, dtype=np.int32),
        residency=residency,
        anchors=np.zeros((primitive_count, 16)),
        slack=np.zeros(primitive_count),
        node_marks=np.zeros(node_capacity, dtype=np.int64),
        primitive_marks=np.zeros(primitive_count, dtype=np.int64),
        owner_marks=np.zeros(primitive_count, dtype=np.int64),
        stack=np.zeros(node_capacity, dtype=np.int32),
        found=np.zeros(node_capacity, dtype=np.int32),
        left=np.zeros(node_capacity, dtype=np.int32),
        box=np.zeros(6),
        header=header,
        counters=np.zeros(COUNTER_WIDTH, dtype=np.int64),
    )
