"""Gripper proxy: one box for a gripper far from obstacles, its links' primitives near.

The box contains the links at any finger position, so either may represent the gripper.
One is inserted into the index before the other is removed, between two judgements: no
pair is ever judged with neither. The box is replaced before it could require more
separation than the links, and returns only at 1.5 times that distance.
"""

from armguard.guard.grips import GripperModel, Grips
from armguard.guard.near_pairs import boxes_apart
from armguard.guard.needs import look_distance
from armguard.guard.reindex import has_tree
from armguard.guard.watch import FEW, Watch
from armguard.guard.workspace import Workspace
from armguard.index.octree_query import primitives_in_box
from armguard.index.octree_state import ABSENT, INDEXED
from armguard.index.octree_update import octree_insert, octree_remove
from armguard.kernel import kernel

# Multiple of the replacement distance beyond which the box returns [-].
FAR_AGAIN = 1.5


@kernel(separate=True)
def choose_models(w: Workspace) -> None:
    """Choose the model of each gripper: as requested, or by the distance of others.

    Args:
        w: The workspace.
    """
    v, m = w.watch, w.motion
    h = w.grips
    for g in range(h.grippers.shape[0]):
        own = h.grippers[g]
        box = own.box
        if box < 0:
            continue
        coarse = own.model == GripperModel.COARSE
        if own.model == GripperModel.AUTO:
            near = h.swap[g] + w.settings.static_need + look_distance(box, v, m)
            if own.coarse == 0:
                near *= FAR_AGAIN
            coarse = not anything_near(box, near, w, v)
        if coarse and own.coarse == 0:
            put_in(box, w)
            for k in range(own.first_member, own.end_member):
                for i in range(h.members[k].first, h.members[k].end):
                    take_out(i, w)
            own.coarse = 1
        elif not coarse and own.coarse != 0:
            detail(g, h, w)


@kernel
def detail(g: int, h: Grips, w: Workspace) -> None:
    """Represent a gripper by the primitives of its links."""
    own = h.grippers[g]
    for k in range(own.first_member, own.end_member):
        for i in range(h.members[k].first, h.members[k].end):
            put_in(i, w)
    take_out(own.box, w)
    own.coarse = 0


@kernel
def anything_near(box: int, near: float, w: Workspace, v: Watch) -> bool:
    """Whether any primitive that a gripper is checked against is within a distance."""
    everyone = w.groups.shape[0]
    if everyone <= FEW or not has_tree(w):
        for j in range(everyone):
            if is_near(box, j, near, w):
                return True
        return False
    for k in range(3):
        w.look_box[k] = w.world.boxes[box, k] - near
        w.look_box[k + 3] = w.world.boxes[box, k + 3] + near
    w.memory.token += 1
    token = w.memory.token
    found = primitives_in_box(box, w.look_box, w.octree, w.seen, token, w.candidates)
    for k in range(found):
        if is_near(box, int(w.candidates[k]), near, w):
            return True
    return False


@kernel
def is_near(box: int, j: int, near: float, w: Workspace) -> bool:
    """Whether a primitive is present, checked, and its box within a distance."""
    if w.octree.residency[j].status == ABSENT:
        return False
    if w.checked[w.groups[box], w.groups[j]] == 0:
        return False
    return not boxes_apart(w.world.boxes, box, j, near)


@kernel(inline=False)
def put_in(i: int, w: Workspace) -> None:
    """Insert a primitive into the index at its present pose."""
    if has_tree(w):
        octree_insert(i, w.world, w.octree)
    else:
        w.octree.residency[i].status = INDEXED


@kernel(inline=False)
def take_out(i: int, w: Workspace) -> None:
    """Remove a primitive from the index."""
    if has_tree(w):
        octree_remove(i, w.world, w.octree)
    else:
        w.octree.residency[i].status = ABSENT
