"""Second step of a cycle: let the index follow the primitives that moved."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import (
    CHANGED_LEAF,
    LEAVES_ENTERED,
    LEAVES_LEFT,
    MERGES,
    SPLITS,
)
from armguard.index.octree_state import (
    COUNT_ENTERED,
    COUNT_LEFT,
    COUNT_MERGES,
    COUNT_SPLITS,
    OctreeState,
)
from armguard.index.octree_update import octree_update
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bytes = NDArray[np.uint8]

# Kinds of index, as the cycle is told them.
OCTREE = 0
BRUTE_FORCE = 1


@kernel
def update_index(
    index_kind: int,
    moving_count: int,
    bodies: Ints,
    body_moved: Bytes,
    world: World,
    octree: OctreeState,
    out: Floats,
) -> None:
    """Update the leaves of every primitive whose body moved; count what changed.

    Brute force keeps no structure, so there is nothing to follow.
    """
    if index_kind == BRUTE_FORCE:
        return
    counters = octree.counters
    entered, left = counters[COUNT_ENTERED], counters[COUNT_LEFT]
    splits, merges = counters[COUNT_SPLITS], counters[COUNT_MERGES]
    changed_body = -1
    for i in range(moving_count):
        body = bodies[i]
        if not body_moved[body]:
            continue
        before = counters[COUNT_ENTERED] + counters[COUNT_LEFT]
        octree_update(i, world, octree)
        if (
            body != changed_body
            and counters[COUNT_ENTERED] + counters[COUNT_LEFT] != before
        ):
            out[CHANGED_LEAF] += 1.0
            changed_body = body
    out[LEAVES_ENTERED] = counters[COUNT_ENTERED] - entered
    out[LEAVES_LEFT] = counters[COUNT_LEFT] - left
    out[SPLITS] = counters[COUNT_SPLITS] - splits
    out[MERGES] = counters[COUNT_MERGES] - merges
