"""Statistics of a whole octree: leaves, cells, lengths of lists."""

import numpy as np
from numpy.typing import NDArray

from armguard.index.octree_cell import cell_at
from armguard.index.octree_shape import count_owners
from armguard.index.octree_state import DIVIDED, NONE, OctreeState
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@kernel(inline=False, entry=True)
def walk_leaves(state: OctreeState, out: Ints) -> int:
    """Write the leaves in the order of a walk from the root, children in turn.

    Args:
        state: The octree.
        out: Leaves, overwritten; as long as the number of nodes in use.

    Returns:
        Number of leaves.
    """
    nodes, stack = state.nodes, state.stack
    stack[0] = 0
    height = 1
    found = 0
    while height > 0:
        height -= 1
        node = stack[height]
        if nodes[node].members == DIVIDED:
            for c in range(8):
                stack[height] = nodes[node].link + 7 - c
                height += 1
        else:
            out[found] = node
            found += 1
    return found


@kernel(inline=False, entry=True)
def corners(places: Ints, cube: Floats, out: Floats) -> None:
    """Write lower and upper corner of the cells at some places, shape (k, 6) [m]."""
    for k in range(places.shape[0]):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4], out[k, 5] = cell_at(
            places[k], cube
        )


@kernel(inline=False, entry=True)
def most_owners(leaves: Ints, world: World, state: OctreeState) -> int:
    """Greatest number of objects in a leaf."""
    most = 0
    for k in range(leaves.shape[0]):
        state.header[0].token += 1
        most = max(most, count_owners(leaves[k], 0, world, state))
    return most


@kernel(inline=False, entry=True)
def entries_of_moving(world: World, state: OctreeState) -> int:
    """Number of entries of all primitives with a growth."""
    count = 0
    for i in range(world.growth.shape[0]):
        if world.growth[i] > 0.0:
            entry = state.residency[i].first_entry
            while entry != NONE:
                count += 1
                entry = state.entries[entry].next_of_primitive
    return count
