"""Who shares a leaf with whom."""

import numpy as np
from numpy.typing import NDArray

from armguard.index.octree_state import (
    ABSENT,
    COUNT,
    FIRST_ENTRY,
    IN_LEAF,
    LINK,
    NEXT_IN_LEAF,
    NEXT_OF_PRIMITIVE,
    NONE,
    OVERFLOW_COUNT,
    PRIMITIVE,
    STATUS,
    OctreeState,
)
from armguard.kernel import kernel

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
        out: Ids, overwritten, shape (p,) or as many as `candidate_bound` says.

    Returns:
        How many ids stand in `out`.
    """
    if state.header[OVERFLOW_COUNT] > 0:
        return int(present_primitives(i, state.residency, out))
    entries, nodes = state.entries, state.nodes
    count = 0
    seen[i] = token
    mine = state.residency[i, FIRST_ENTRY]
    while mine != NONE:
        entry = nodes[entries[mine, IN_LEAF], LINK]
        while entry != NONE:
            j = entries[entry, PRIMITIVE]
            if seen[j] != token:
                seen[j] = token
                out[count] = j
                count += 1
            entry = entries[entry, NEXT_IN_LEAF]
        mine = entries[mine, NEXT_OF_PRIMITIVE]
    return count


@kernel(entry=True)
def candidate_bound(i: int, state: OctreeState) -> int:
    """At least as many as primitive i has candidates."""
    everyone = int(state.residency.shape[0])
    if state.header[OVERFLOW_COUNT] > 0:
        return everyone
    members = 0
    mine = state.residency[i, FIRST_ENTRY]
    while mine != NONE:
        members += state.nodes[state.entries[mine, IN_LEAF], COUNT]
        mine = state.entries[mine, NEXT_OF_PRIMITIVE]
    return int(min(members, everyone))


@kernel(entry=True)
def present_primitives(i: int, residency: Ints, out: Ints) -> int:
    """All primitives in the index but i: what brute force looks at.

    Args:
        i: The primitive.
        residency: Only its STATUS is read, shape (p, RESIDENCY_WIDTH).
        out: Ids, overwritten, shape (p,).

    Returns:
        How many ids stand in `out`.
    """
    count = 0
    for j in range(residency.shape[0]):
        if j != i and residency[j, STATUS] != ABSENT:
            out[count] = j
            count += 1
    return count
