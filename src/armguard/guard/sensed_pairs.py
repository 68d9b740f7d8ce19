"""The walk: near pairs of robots and of the cells that they know or do not know.

For each moving primitive the summaries of the cells are descended. A group or a word
that is farther from the primitive than a stop, the errors, the age of the cells and new
commands can matter is left out with all that is in it. Every other word becomes a box
in a slot, and is judged as a pair of the scene is; a slot stays in use where the answer
has a row of the pair. If the slots do not suffice, the cells of a group near the robot
that takes most of them are judged as one box, then all those on one side of its
primitives.

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
from armguard.guard.judged_pair import judge_pair
from armguard.guard.levels import Reason
from armguard.guard.near_pairs import is_idle
from armguard.guard.needs import robot_of, static_need
from armguard.guard.search_distance import pair_look, way_until_look
from armguard.guard.sensed import SIDES, CellKind, Sensed
from armguard.guard.sensed_boxes import (
    BY_SIDE,
    BY_WORD,
    gather,
    gather_word,
    is_coarse,
    slab_corner,
    slot_of_gathered,
)
from armguard.guard.sensed_search import (
    cells_of,
    has_cells,
    is_beyond,
    within,
    write_search,
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
    if w.motion.span.segment != 0:
        return count
    s = w.sensed
    s.about.boxes = 0
    for kind in range(KINDS):
        if has_cells(cells_of(kind, s)) or s.about.outside == kind:
            count = judge_kind(kind, count, w)
    return count


@kernel(inline=False)
def judge_kind(kind: int, count: int, w: Workspace) -> int:
    """Judge the cells of a kind, near each robot as coarsely as the slots require.

    Where they do not suffice, the robot that has taken most of them is judged more
    coarsely: cells that crowd one robot do not slow another one.

    Returns:
        New count of rows.
    """
    s, v = w.sensed, w.watch
    first, notes = count, v.judged_count[0]
    s.search.kind = kind
    for r in range(s.coarse.shape[0]):
        s.coarse[r] = BY_WORD
    crowded = 0
    while crowded >= 0:
        v.judged_count[0] = notes
        count = judge_all_near(first, w)
        if s.about.spent == 0:
            return count
        crowded = most_crowded(s)
        if crowded >= 0:
            s.coarse[crowded] += 1
    for r in range(v.must.shape[0]):
        demand_stop(r, CROWDED, v)
    w.header.reason = CROWDED
    v.judged_count[0] = TOO_MANY
    return count


@kernel
def judge_all_near(count: int, w: Workspace) -> int:
    """Judge the cells near all primitives, until slots or boxes do not suffice.

    Returns:
        New count of rows.
    """
    s, v = w.sensed, w.watch
    about, slot = s.about, int(s.slots[s.search.kind, 0])
    about.used = about.spent = 0
    s.taken[:] = 0
    for i in range(w.settings.moving_count):
        checked = w.checked[w.groups[i], w.groups[slot]] != 0
        if checked and about.spent == 0 and not is_idle(i, v.robot_of, w):
            r, used = robot_of(i, v), about.used
            s.search.level = s.coarse[r]
            count = judge_near(i, count, w)
            s.taken[r] += about.used - used
    return count


@kernel
def most_crowded(s: Sensed) -> int:
    """Robot with most slots among those that can be judged more coarsely, or -1."""
    found = -1
    for r in range(s.coarse.shape[0]):
        if s.coarse[r] < BY_SIDE and (found < 0 or s.taken[r] > s.taken[found]):
            found = r
    return found


@kernel(inline=False)
def judge_near(i: int, count: int, w: Workspace) -> int:
    """Judge the cells near a primitive.

    Returns:
        New count of rows.
    """
    s = w.sensed
    about, search, lattice = s.about, s.search, s.claims.lattice
    for side in range(SIDES):
        s.gathered[side].count = 0
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
    return judge_gathered(count, w)


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
        g = gather(low, (low[0] + edge, low[1] + edge, low[2] + edge), w)
        g.stamp, g.error = s.about.stamp, max(g.error, s.about.error)
        return count if search.level == BY_SIDE else judge_gathered(count, w)
    edge = WORD_SIDE * cell
    words = within(cells.groups[group], low, edge, search)
    while words != 0:
        member = lowest(words)
        words &= words - bit(0)
        inner = member_corner(low, edge, member)
        if not is_beyond(inner, edge, s):
            number = (group << 6) + member
            gather_word(number, inner, cells.words[number], w)
            if search.level == BY_WORD:
                count = judge_word(number, inner, cells, count, w)
        if s.about.spent != 0:
            return count
    return count if search.level == BY_SIDE else judge_gathered(count, w)


@kernel(inline=False)
def judge_word(word: int, corner: Vec3, cells: Bits, count: int, w: Workspace) -> int:
    """Judge the cells of a word as one box, or by octants where that box blocks.

    Args:
        word: The word, which is gathered.
        corner: Its lower corner [m].
        cells: The cells of the kind that is judged.
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    s = w.sensed
    g = s.gathered[0]
    if g.count == 0 or not is_coarse(cells.words[word], g, s):
        return judge_gathered(count, w)
    g.count = 0
    edge = OCTANT_SIDE * s.claims.lattice.cell
    for k in range(OCTANTS):
        x, y, z = k & 1, k >> 1 & 1, k >> 2
        place = OCTANT_SIDE * (x + WORD_SIDE * y + WORD_SIDE * WORD_SIDE * z)
        chosen = cells.words[word] & (OCTANT << np.uint64(place))
        low = (corner[0] + x * edge, corner[1] + y * edge, corner[2] + z * edge)
        if chosen != 0 and s.about.spent == 0 and not is_beyond(low, edge, s):
            gather_word(word, corner, chosen, w)
            count = judge_gathered(count, w)
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


@kernel
def judge_gathered(count: int, w: Workspace) -> int:
    """Judge the cells that were gathered, those on each side as one box.

    Returns:
        New count of rows.
    """
    s = w.sensed
    for side in range(SIDES):
        if s.gathered[side].count != 0 and s.about.spent == 0:
            count = judge_box(side, count, w)
    return count


@kernel(inline=False)
def judge_box(side: int, count: int, w: Workspace) -> int:
    """Judge the cells on a side of a primitive in their slot, or in a free one.

    Returns:
        New count of rows.
    """
    s, v, m = w.sensed, w.watch, w.motion
    about, search = s.about, s.search
    i, free = search.primitive, int(s.slots[search.kind, 0]) + about.used
    j = slot_of_gathered(s.gathered[side], free, w)
    if j == s.slots[search.kind, 1]:
        about.spent = 1
        return count
    need = static_need(i, j, w, v, m) + way_until_look(j, v, m)
    need, look, known = pair_look(i, j, need, w)
    if look < 0.0:
        w.header.pairs_filtered += 1.0
        return count
    before = count
    count = judge_pair(i, j, need, look, known, count, w)
    if count > before and j == free:
        about.used += 1
    return count


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
            g = gather(
                slab_corner(axis, side, 0, first, last),
                slab_corner(axis, side, 1, first, last),
                w,
            )
            g.stamp = s.about.stamp
            if search.level != BY_SIDE:
                count = judge_gathered(count, w)
    return count
