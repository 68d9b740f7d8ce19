"""Second step of a cycle: update of the index for the primitives that moved."""

from armguard.guard.workspace import IndexKind, Workspace
from armguard.index.octree_state import (
    COUNT_ENTERED,
    COUNT_LEFT,
    COUNT_MERGES,
    COUNT_SPLITS,
)
from armguard.index.octree_update import octree_update
from armguard.kernel import kernel


@kernel
def update_index(w: Workspace) -> None:
    """Update the leaves of every primitive whose body moved; count the changes.

    Brute force keeps no structure, so there is nothing to update.
    """
    if w.settings[0].index_kind == IndexKind.BRUTE_FORCE:
        return
    counters, out = w.octree.counters, w.header
    entered, left = counters[COUNT_ENTERED], counters[COUNT_LEFT]
    splits, merges = counters[COUNT_SPLITS], counters[COUNT_MERGES]
    changed_body = -1
    for i in range(w.settings[0].moving_count):
        body = w.bodies[i]
        if not w.body_moved[body]:
            continue
        before = counters[COUNT_ENTERED] + counters[COUNT_LEFT]
        octree_update(i, w.world, w.octree)
        if (
            body != changed_body
            and counters[COUNT_ENTERED] + counters[COUNT_LEFT] != before
        ):
            out.changed_leaf += 1.0
            changed_body = body
    out.leaves_entered = counters[COUNT_ENTERED] - entered
    out.leaves_left = counters[COUNT_LEFT] - left
    out.splits = counters[COUNT_SPLITS] - splits
    out.merges = counters[COUNT_MERGES] - merges
