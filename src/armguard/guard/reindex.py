"""Second step of a cycle: update of the index for the primitives that moved."""

from armguard.guard.workspace import IndexKind, Workspace
from armguard.index.joint_cells import locate_cells
from armguard.index.octree_update import octree_update
from armguard.kernel import kernel
from armguard.table import Vector


@kernel
def has_tree(w: Workspace) -> bool:
    """Whether the index of the scene is an octree, used by every cycle or not."""
    kind = w.settings.index_kind
    return bool(kind == IndexKind.OCTREE or kind == IndexKind.LISTED)


@kernel
def update_index(q: Vector, w: Workspace) -> None:
    """Update the leaves of every primitive whose body moved; count the changes.

    Of a joint-space table the cells of the links are determined. Brute force keeps no
    structure, so there is nothing to update.
    """
    if w.settings.index_kind == IndexKind.JOINT_TABLE:
        locate_cells(q, w.joint_cells)
    if not has_tree(w):
        return
    counters, out = w.octree.counters[0], w.header
    entered, left = counters.entered, counters.left
    splits, merges = counters.splits, counters.merges
    changed_body = -1
    for i in range(w.settings.moving_count):
        body = w.bodies[i]
        if not w.body_moved[body]:
            continue
        before = counters.entered + counters.left
        octree_update(i, w.world, w.octree)
        if body != changed_body and counters.entered + counters.left != before:
            out.changed_leaf += 1.0
            changed_body = body
    out.leaves_entered = counters.entered - entered
    out.leaves_left = counters.left - left
    out.splits = counters.splits - splits
    out.merges = counters.merges - merges
