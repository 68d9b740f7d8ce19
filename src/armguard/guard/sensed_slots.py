"""Pairs of a primitive and a slot: a box of cells, or a half-space for many boxes."""

from armguard.guard.evaded_cells import is_of_evaded
from armguard.guard.judged_pair import judge_pair
from armguard.guard.needs import static_need
from armguard.guard.search_distance import pair_look, way_until_look
from armguard.guard.sensed import BY_PLANE, CellKind, Demand
from armguard.guard.sensed_boxes import (
    end_of_slots,
    first_slot,
    is_coarse,
    slot_of_box,
)
from armguard.guard.sensed_planes import list_box, nearest_open, slot_of_nearest
from armguard.guard.sensed_search import count_work
from armguard.guard.watch import RECOVERING
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel

UNSEEN = int(CellKind.UNSEEN)

# Work of judging a box as a pair: the look, and the measurement, see `count_work`. The
# tests of a proof have a budget of their own.
LOOKED_AT, MEASURED = 25, 90


@kernel
def note_demand(r: int, out: Demand, w: Workspace) -> None:
    """Note what a robot must do, and how much was tested and noted for that."""
    v = w.watch
    out.must, out.cause, out.time_left = v.must[r], v.cause[r], v.time_left[r]
    out.tests, out.notes = w.motion.effort.tests, v.judged_count[0]


@kernel
def restore_demand(r: int, before: Demand, w: Workspace) -> None:
    """Take back what was demanded, tested and noted since `note_demand`."""
    v = w.watch
    v.must[r], v.cause[r], v.time_left[r] = before.must, before.cause, before.time_left
    w.motion.effort.tests, v.judged_count[0] = before.tests, before.notes


@kernel(inline=False)
def judge_box(count: int, w: Workspace) -> int:
    """Judge the box in its slot, or in a free one; or list it, to be judged by planes.

    One of a cluster that the robot evades is not listed: its proof would not count.

    Returns:
        New count of rows.
    """
    s, v = w.sensed, w.watch
    r = s.search.robot
    evaded = is_of_evaded(r, w)
    if evaded and v.phase[r] == RECOVERING:
        s.evaded[r] = 1
        if s.search.level == BY_PLANE:
            return count
    if s.search.level == BY_PLANE:
        list_box(s)
        return count
    free = first_slot(s) + s.about.used
    slot = slot_of_box(free, w)
    if evaded and slot < end_of_slots(s):
        v.evaded[slot] = 1 << r
    return judge_slot(slot, free, count, w)


@kernel(inline=False)
def judge_whole(count: int, w: Workspace) -> int:
    """Judge the box, unless it is too coarse: as a box it would stop a robot.

    One of space not known free is too coarse if it is near a stop: such space is on all
    sides of an arm, and its boxes would take all slots. One of a cluster that the robot
    evades stops it in no case.

    Returns:
        New count of rows, -1 if the box is to be divided. Nothing of it is left then.
    """
    s = w.sensed
    r, used = s.search.robot, s.about.used
    if w.watch.phase[r] == RECOVERING and is_of_evaded(r, w):
        return judge_box(count, w)
    if is_coarse(s):
        return -1
    note_demand(r, s.demand, w)
    kept = w.settings.margin if s.search.kind >= UNSEEN else 0.0
    found = judge_box(count, w)
    if found == count or w.near[count].headroom >= kept:
        return found
    restore_demand(r, s.demand, w)
    s.about.used = used
    return -1


@kernel(inline=False)
def judge_by_planes(count: int, w: Workspace) -> int:
    """Judge the listed boxes, those behind a plane as one half-space.

    Returns:
        New count of rows.
    """
    s = w.sensed
    nearest = nearest_open(s)
    while nearest >= 0 and s.about.spent == 0:
        free = first_slot(s) + s.about.used
        count = judge_slot(slot_of_nearest(nearest, free, w), free, count, w)
        count_work(s.about.listed, s)
        nearest = nearest_open(s)
    return count


@kernel(inline=False)
def judge_slot(j: int, free: int, count: int, w: Workspace) -> int:
    """Judge the pair of the primitive and a slot.

    Args:
        j: The slot.
        free: First slot that was not in use.
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    s, v, m = w.sensed, w.watch, w.motion
    i = s.search.primitive
    if j == end_of_slots(s):
        s.about.spent = 1
        return count
    need = static_need(i, j, w, v, m) + way_until_look(j, v, m)
    need, look, known = pair_look(i, j, need, w)
    count_work(LOOKED_AT, s)
    if look < 0.0:
        w.header.pairs_filtered += 1.0
        return count
    count_work(MEASURED, s)
    before = count
    count = judge_pair(i, j, need, look, known, count, w)
    if count > before and j == free:
        s.about.used += 1
    return count
