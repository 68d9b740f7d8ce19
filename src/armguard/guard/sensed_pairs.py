"""The walk: near pairs of robots and of the cells that they know or do not know.

For each moving primitive the summaries of the cells are descended. A group or a word
that is farther from the primitive than a stop, the errors, the age of the cells and new
commands can matter is left out with all that is in it. Every other word becomes a box
in a slot, and is judged as a pair of the scene is; a slot stays in use where the answer
has a row of the pair. If the slots do not suffice, or it is too much work, half-spaces
stand for the boxes.

Slots are functions of the cells and of the cycle's input alone.
"""

import numpy as np

from armguard.cells.state import (
    ALL,
    BLOCK_SIDE,
    GROUP_SIDE,
    MEMBERS,
    WORD_SIDE,
    Bits,
)
from armguard.cells.words import (
    bit,
    corner_of,
    member_corner,
    place_of_block,
)
from armguard.geometry.vec3 import Vec3
from armguard.guard.change import TOO_MANY
from armguard.guard.demands import demand_stop
from armguard.guard.levels import Reason
from armguard.guard.near_pairs import is_idle
from armguard.guard.needs import robot_of
from armguard.guard.sensed import BY_PLANE, BY_WORD, GIVEN_UP, CellKind
from armguard.guard.sensed_boxes import (
    box_cells,
    first_slot,
    is_filled,
    put_box,
    slab_corner,
)
from armguard.guard.sensed_search import (
    cells_of,
    has_cells,
    is_beyond,
    limit_work,
    within,
    write_search,
)
from armguard.guard.sensed_slots import (
    judge_box,
    judge_by_planes,
    judge_whole,
    note_demand,
    restore_demand,
)
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.lanes import lowest

UNSEEN, KINDS = int(CellKind.UNSEEN), len(CellKind)

CROWDED = int(Reason.CROWDED)

# Cells of the first octant of a word, the edge of an octant [cells], and their count.
OCTANT, OCTANT_SIDE, OCTANTS = np.uint64(0x330033), 2, 8


@kernel(separate=True, optional=True)
def judge_sensed(count: int, w: Workspace) -> int:
    """Measure and prove the pairs of robots and sensed cells that may matter to a stop.

    Args:
        count: Count of rows of the answer.
        w: The workspace, after `write_looks`.

    Returns:
        New count of rows.
    """
    s = w.sensed
    for r in range(s.work.shape[0]):
        given_up = False
        for kind in range(KINDS):
            near = has_cells(cells_of(kind, s)) or s.about.outside == kind
            if near and not given_up:
                s.search.robot, s.search.kind = r, kind
                count = judge_robot(count, w)
                given_up = s.coarse[kind, r] == GIVEN_UP
    return count


@kernel(inline=False)
def judge_robot(count: int, w: Workspace) -> int:
    """Judge the cells of a kind near a robot, as coarsely as slots and work require.

    Where they do not suffice, half-spaces stand for the cells, and if that is not
    enough, the robot stops. Each robot has its own slots and work: cells that crowd one
    neither slow nor stop another one. A later judgement of the cycle does not try again
    what did not suffice, but for giving up: a slower motion may need less.

    Returns:
        New count of rows.
    """
    s, v = w.sensed, w.watch
    first, kind, r = count, int(s.search.kind), int(s.search.robot)
    note_demand(r, s.before, w)
    level = min(int(s.coarse[kind, r]), BY_PLANE)
    s.about.spent = 1
    while s.about.spent != 0 and level != GIVEN_UP:
        s.coarse[kind, r] = s.search.level = level
        # The rest is for half-spaces, and for cells of other kinds.
        limit_work(3 if level == BY_WORD else 2, s)
        count = judge_all_near(first, w)
        if s.about.spent != 0:
            count, level = first, level + 1
            restore_demand(r, s.before, w)
    if level == GIVEN_UP:
        s.coarse[kind, r] = GIVEN_UP
        if w.motion.span.segment == 0:
            demand_stop(r, CROWDED, v)
        v.judged_count[0] = TOO_MANY
        w.header.reason = CROWDED
    return count


@kernel
def judge_all_near(count: int, w: Workspace) -> int:
    """Judge the cells near all primitives of a robot, until slots or work run out.

    Returns:
        New count of rows.
    """
    s, v = w.sensed, w.watch
    s.about.used = s.about.spent = 0
    slot = first_slot(s)
    for i in range(w.settings.moving_count):
        checked = w.checked[w.groups[i], w.groups[slot]] != 0
        if robot_of(i, v) != s.search.robot or not checked or s.about.spent != 0:
            continue
        if not is_idle(i, v.robot_of, w):
            count = judge_near(i, count, w)
    return count


@kernel(inline=False)
def judge_near(i: int, count: int, w: Workspace) -> int:
    """Judge the cells near a primitive.

    Returns:
        New count of rows.
    """
    s = w.sensed
    about, search, lattice = s.about, s.search, s.claims.lattice
    about.listed = 0
    if not write_search(i, w):
        about.spent = 1
        return count
    if about.outside == search.kind:
        count = judge_outside(count, w)
    cells = cells_of(search.kind, s)
    for root in range(cells.roots.shape[0]):
        blocks = cells.roots[root]
        while blocks != 0:
            block = (root << 6) + lowest(blocks)
            blocks &= blocks - bit(0)
            place = place_of_block(block, lattice.blocks)
            corner = corner_of(place, BLOCK_SIDE, lattice)
            groups = within(
                cells.blocks[block], corner, GROUP_SIDE * lattice.cell, search
            )
            while groups != 0:
                member = lowest(groups)
                groups &= groups - bit(0)
                count = judge_group((block << 6) + member, corner, count, cells, w)
                if about.spent != 0:
                    return count
    return judge_by_planes(count, w)


@kernel(inline=False)
def judge_group(group: int, corner: Vec3, count: int, cells: Bits, w: Workspace) -> int:
    """Judge the cells of a group near a primitive; corner is that of its block [m].

    Returns:
        New count of rows.
    """
    s = w.sensed
    search, cell = s.search, s.claims.lattice.cell
    edge = GROUP_SIDE * cell
    low = member_corner(corner, edge, group & 63)
    if is_beyond(low, edge, s):
        return count
    if search.kind >= UNSEEN and is_full(group, cells):
        high = (low[0] + edge, low[1] + edge, low[2] + edge)
        put_box(low, high, s.about.stamp, s).error = s.about.error
        return judge_box(count, w)
    edge = WORD_SIDE * cell
    words = within(cells.groups[group], low, edge, search)
    while words != 0:
        member = lowest(words)
        words &= words - bit(0)
        inner = member_corner(low, edge, member)
        if not is_beyond(inner, edge, s):
            number = (group << 6) + member
            count = judge_word(number, inner, cells, count, w)
        if s.about.spent != 0:
            return count
    return count


@kernel(inline=False)
def judge_word(word: int, corner: Vec3, cells: Bits, count: int, w: Workspace) -> int:
    """Judge the cells of a word as one box, or by octants where that box blocks.

    Args:
        word: The word.
        corner: Its lower corner [m].
        cells: The cells of the kind that is judged.
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    s = w.sensed
    if not box_cells(word, corner, cells.words[word], w):
        return count
    if is_filled(cells.words[word], s):
        return judge_box(count, w)
    found = judge_whole(count, w)
    if found >= 0:
        return found
    edge = OCTANT_SIDE * s.claims.lattice.cell
    for k in range(OCTANTS):
        x, y, z = k & 1, k >> 1 & 1, k >> 2
        place = OCTANT_SIDE * (x + WORD_SIDE * y + WORD_SIDE * WORD_SIDE * z)
        chosen = cells.words[word] & (OCTANT << np.uint64(place))
        low = (corner[0] + x * edge, corner[1] + y * edge, corner[2] + z * edge)
        if chosen != 0 and s.about.spent == 0 and not is_beyond(low, edge, s):
            count = judge_octant(word, corner, chosen, count, w)
    return count


@kernel(inline=False)
def judge_octant(
    word: int, corner: Vec3, chosen: np.uint64, count: int, w: Workspace
) -> int:
    """Judge cells of an octant as one box, or each where that box blocks.

    Args:
        word: The word.
        corner: Its lower corner [m].
        chosen: The cells.
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    s = w.sensed
    if not box_cells(word, corner, chosen, w):
        return count
    if is_filled(chosen, s):
        return judge_box(count, w)
    found = judge_whole(count, w)
    if found >= 0:
        return found
    cell = s.claims.lattice.cell
    while chosen != 0 and s.about.spent == 0:
        place = lowest(chosen)
        one = bit(place)
        chosen &= ~one
        low = member_corner(corner, cell, place)
        if not is_beyond(low, cell, s) and box_cells(word, corner, one, w):
            count = judge_box(count, w)
    return count


@kernel
def is_full(group: int, cells: Bits) -> bool:
    """Whether all cells of a group are set."""
    if cells.groups[group] != ALL:
        return False
    for k in range(MEMBERS):
        if cells.words[(group << 6) + k] != ALL:
            return False
    return True


@kernel(inline=False)
def judge_outside(count: int, w: Workspace) -> int:
    """Judge the space outside the region, one slab beyond each of its faces.

    Returns:
        New count of rows.
    """
    s = w.sensed
    lattice, search = s.claims.lattice, s.search
    edge = lattice.side * lattice.cell
    first = (lattice.low[0], lattice.low[1], lattice.low[2])
    last = (first[0] + edge, first[1] + edge, first[2] + edge)
    for axis in range(3):
        for side in range(2):
            inside = search.high[axis] <= last[axis]
            if side == 0:
                inside = search.low[axis] >= first[axis]
            if inside or s.about.spent != 0:
                continue
            put_box(
                slab_corner(axis, side, 0, first, last),
                slab_corner(axis, side, 1, first, last),
                s.about.stamp,
                s,
            ).error = s.about.error
            count = judge_box(count, w)
    return count
