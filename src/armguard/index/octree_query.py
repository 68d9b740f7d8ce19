"""Queries of the octree: primitives that share a leaf, or are near a box."""

import numpy as np
from numpy.typing import NDArray

from armguard.index.octree_cell import cell_at
from armguard.index.octree_state import ABSENT, DIVIDED, NONE, OctreeState, Residency
from armguard.kernel import kernel
from armguard.record import Records

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]


@kernel(entry=True)
def octree_candidates(
    i: int, state: OctreeState, seen: Longs, token: int, out: Ints
) -> int:
    """Primitives that share a leaf with primitive i, each once, in no special order.

    Args:
        i: The primitive.
        state: The octree.
        seen: Marks, one a primitive; those equal to `token` were met before.
        token: A number `seen` does not hold yet.
        out: Ids, overwritten, shape (p,), or as long as `candidate_bound`.

    Returns:
        Number of ids in `out`.
    """
    if state.header[0].overflow_count > 0:
        return int(present_primitives(i, state.residency, out))
    entries, nodes = state.entries, state.nodes
    count = 0
    seen[i] = token
    mine = state.residency[i].first_entry
    while mine != NONE:
        entry = nodes[entries[mine].leaf].link
        while entry != NONE:
            j = entries[entry].primitive
            if seen[j] != token:
                seen[j] = token
                out[count] = j
                count += 1
            entry = entries[entry].next_in_leaf
        mine = entries[mine].next_of_primitive
    return count


@kernel(inline=False, entry=True)
def primitives_in_box(
    i: int, box: Floats, state: OctreeState, seen: Longs, token: int, out: Ints
) -> int:
    """Primitives other than i in the leaves that meet a box, each once.

    They include every primitive that meets the box. A primitive outside the root cube
    is in its outermost leaves, so the box is first moved into the cube.

    Args:
        i: Primitive that is left out.
        box: Lower and upper corner, shape (6,); changed [m].
        state: The octree.
        seen: Marks, one a primitive; those equal to `token` were met before.
        token: A number that `seen` does not hold yet.
        out: Ids, overwritten, shape (p,).

    Returns:
        Number of ids in `out`.
    """
    if state.header[0].overflow_count > 0:
        return int(present_primitives(i, state.residency, out))
    for k in range(3):
        low, high = state.cube[0, k], state.cube[0, k] + state.cube[1, k]
        # A NaN becomes the far end of its side, so that all leaves are searched.
        box[k] = min(box[k], high) if box[k] >= low else low
        box[k + 3] = max(box[k + 3], low) if box[k + 3] <= high else high
    entries, nodes, stack = state.entries, state.nodes, state.stack
    seen[i] = token
    stack[0] = 0
    height = 1
    count = 0
    while height > 0:
        height -= 1
        node = stack[height]
        cell = cell_at(nodes[node].place, state.cube)
        if not (
            cell[0] <= box[3]
            and cell[1] <= box[4]
            and cell[2] <= box[5]
            and cell[3] >= box[0]
            and cell[4] >= box[1]
            and cell[5] >= box[2]
        ):
            continue
        if nodes[node].members == DIVIDED:
            for c in range(8):
                stack[height] = nodes[node].link + c
                height += 1
            continue
        entry = nodes[node].link
        while entry != NONE:
            j = entries[entry].primitive
            if seen[j] != token:
                seen[j] = token
                out[count] = j
                count += 1
            entry = entries[entry].next_in_leaf
    return count


@kernel(entry=True)
def candidate_bound(i: int, state: OctreeState) -> int:
    """Upper bound of the number of candidates of primitive i."""
    everyone = int(state.residency.shape[0])
    if state.header[0].overflow_count > 0:
        return everyone
    members = 0
    mine = state.residency[i].first_entry
    while mine != NONE:
        members += state.nodes[state.entries[mine].leaf].members
        mine = state.entries[mine].next_of_primitive
    return int(min(members, everyone))


@kernel(entry=True)
def present_primitives(i: int, residency: Records[Residency], out: Ints) -> int:
    """Write all primitives in the index except i: the candidates of brute force.

    Args:
        i: The primitive.
        residency: Residency of the primitives, of which only the status is read, shape
            (p,).
        out: Ids, overwritten, shape (p,).

    Returns:
        Number of ids in `out`.
    """
    count = 0
    for j in range(residency.shape[0]):
        if j != i and residency[j].status != ABSENT:
            out[count] = j
            count += 1
    return count
