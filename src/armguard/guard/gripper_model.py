"""One box for a gripper where nothing is near, its links' own primitives elsewhere.

The box holds the links wherever the fingers are, so either stands for the gripper. One
is put into the index before the other is taken out, between two judgements: no pair is
ever judged with neither. The box goes before it could ask for more than the links do,
and comes back only when everything is half as far again.
"""

from armguard.guard.grips import (
    AUTO,
    BOX,
    COARSE,
    COARSE_NOW,
    END_MEMBER,
    FIRST_MEMBER,
    MODEL,
    Grips,
)
from armguard.guard.memory import TOKEN
from armguard.guard.near_pairs import boxes_apart
from armguard.guard.needs import look_distance
from armguard.guard.watch import FEW, Watch
from armguard.guard.workspace import (
    BRUTE_FORCE,
    INDEX_KIND,
    Workspace,
)
from armguard.index.octree_query import primitives_in_box
from armguard.index.octree_state import ABSENT, INDEXED, STATUS
from armguard.index.octree_update import octree_insert, octree_remove
from armguard.kernel import kernel

# What must be this many times as far away before a box comes back [-].
FAR_AGAIN = 1.5


@kernel(separate=True)
def choose_models(w: Workspace) -> None:
    """Let the model that is asked for stand for each gripper, or the one that will do.

    Args:
        w: The workspace.
    """
    v, m = w.watch, w.motion
    h = w.grips
    for g in range(h.grippers.shape[0]):
        own = h.grippers[g]
        box = int(own[BOX])
        if box < 0:
            continue
        coarse = own[MODEL] == COARSE
        if own[MODEL] == AUTO:
            near = h.swap[g] + w.look[0] + look_distance(box, v, m)
            if own[COARSE_NOW] == 0:
                near *= FAR_AGAIN
            coarse = not anything_near(box, near, w, v)
        if coarse and own[COARSE_NOW] == 0:
            put_in(box, w)
            for k in range(own[FIRST_MEMBER], own[END_MEMBER]):
                for i in range(h.members[k, 0], h.members[k, 1]):
                    take_out(i, w)
            own[COARSE_NOW] = 1
        elif not coarse and own[COARSE_NOW] != 0:
            detail(g, h, w)


@kernel
def detail(g: int, h: Grips, w: Workspace) -> None:
    """Let its links' own primitives stand for a gripper."""
    own = h.grippers[g]
    for k in range(own[FIRST_MEMBER], own[END_MEMBER]):
        for i in range(h.members[k, 0], h.members[k, 1]):
            put_in(i, w)
    take_out(int(own[BOX]), w)
    own[COARSE_NOW] = 0


@kernel
def anything_near(box: int, near: float, w: Workspace, v: Watch) -> bool:
    """Whether the box of anything a gripper is checked against is within a distance."""
    everyone = w.groups.shape[0]
    if everyone <= FEW or w.settings[INDEX_KIND] == BRUTE_FORCE:
        for j in range(everyone):
            if is_near(box, j, near, w):
                return True
        return False
    for k in range(3):
        w.look_box[k] = w.world.boxes[box, k] - near
        w.look_box[k + 3] = w.world.boxes[box, k + 3] + near
    w.memory[TOKEN] += 1
    token = w.memory[TOKEN]
    found = primitives_in_box(box, w.look_box, w.octree, w.seen, token, w.candidates)
    for k in range(found):
        if is_near(box, int(w.candidates[k]), near, w):
            return True
    return False


@kernel
def is_near(box: int, j: int, near: float, w: Workspace) -> bool:
    """Whether a primitive is there, is checked, and its box is within a distance."""
    if w.octree.residency[j, STATUS] == ABSENT:
        return False
    if w.checked[w.groups[box], w.groups[j]] == 0:
        return False
    return not boxes_apart(w.world.boxes, box, j, near)


@kernel(inline=False)
def put_in(i: int, w: Workspace) -> None:
    """Put a primitive into the index, where it is now."""
    if w.settings[INDEX_KIND] == BRUTE_FORCE:
        w.octree.residency[i, STATUS] = INDEXED
    else:
        octree_insert(i, w.world, w.octree)


@kernel(inline=False)
def take_out(i: int, w: Workspace) -> None:
    """Take a primitive out of the index."""
    if w.settings[INDEX_KIND] == BRUTE_FORCE:
        w.octree.residency[i, STATUS] = ABSENT
    else:
        octree_remove(i, w.world, w.octree)
