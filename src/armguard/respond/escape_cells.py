"""Sensed space beside an escape motion: occupied cells, and cells not known free.

Cells of clusters that the robot evades are left out: it is the motion of the clusters
by which an escape motion is judged.
"""

from math import inf

from armguard.cells.clearance import make_nearest, search
from armguard.cells.state import BLOCK_SIDE, GROUP_SIDE, WORD_SIDE, Bits
from armguard.cells.words import bit, corner_of, member_corner, place_of_block
from armguard.geometry.cell_gap import cell_gap
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3
from armguard.guard.evaded_cells import is_of_evaded
from armguard.guard.needs import static_need, time_since
from armguard.guard.sensed import LISTED, CellKind, Sensed
from armguard.guard.sensed_boxes import box_cells
from armguard.guard.sensed_search import cells_of, has_cells
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.lanes import lowest
from armguard.record import copy
from armguard.respond.escape_state import Escape
from armguard.table import Vector

KINDS, MOVING = len(CellKind), int(CellKind.MOVING)

# Number of placed primitives per comparison with the cells, by cost.
CELLS_COST = 4

# Distance from a robot within which moving cells are considered [m].
REACH = 0.6


@kernel(separate=True, optional=True)
def list_moving(r: int, e: Escape, w: Workspace) -> None:
    """List boxes around moving cells near a robot that are of no cluster it evades.

    Args:
        r: The robot.
        e: Escape, with the box around the robot; the count is written.
        w: The workspace; the boxes are in `listed` of its sensed space.
    """
    s = w.sensed
    lattice, cells = s.claims.lattice, s.moving
    s.search.kind = MOVING
    e.plan.moving_count = 0
    for root in range(cells.roots.shape[0]):
        blocks = cells.roots[root]
        while blocks != 0:
            block = (root << 6) + lowest(blocks)
            blocks &= blocks - bit(0)
            place = place_of_block(block, lattice.blocks)
            corner = corner_of(place, BLOCK_SIDE, lattice)
            groups = cells.blocks[block]
            while groups != 0:
                member = lowest(groups)
                groups &= groups - bit(0)
                low = member_corner(corner, GROUP_SIDE * lattice.cell, member)
                list_group((block << 6) + member, low, r, e, w)


@kernel(inline=False)
def list_group(group: int, low: Vec3, r: int, e: Escape, w: Workspace) -> None:
    """List the boxes of a group, see `list_moving`; low is its lower corner [m]."""
    s = w.sensed
    edge = WORD_SIDE * s.claims.lattice.cell
    words = s.moving.groups[group]
    while words != 0:
        member = lowest(words)
        words &= words - bit(0)
        corner = member_corner(low, edge, member)
        near = True
        for k in range(3):
            near &= corner[k] < e.reach[k + 3] + REACH
            near &= corner[k] + edge > e.reach[k] - REACH
        if near:
            list_word((group << 6) + member, corner, r, e, w)


@kernel(inline=False)
def list_word(word: int, corner: Vec3, r: int, e: Escape, w: Workspace) -> None:
    """List the box around cells of a word, see `list_moving`; corner is its own [m]."""
    s = w.sensed
    left = s.moving.words[word]
    if not box_cells(word, corner, left, w) or is_of_evaded(r, w):
        return
    each = left
    while each != 0:
        one = bit(lowest(each))
        each &= ~one
        if not box_cells(word, corner, one, w) or is_of_evaded(r, w):
            left &= ~one
    if left == 0 or not box_cells(word, corner, left, w):
        return
    if e.plan.moving_count < LISTED:
        copy(s.box, s.listed[e.plan.moving_count])
    e.plan.moving_count += 1


@kernel(separate=True, optional=True)
def meets_cells(
    i: int, room: float, grazes: float, e: Escape, w: Workspace
) -> bool:  # fmt: skip
    """Whether a primitive of the placed robot is too near to sensed cells.

    To those that are occupied, and to those that are not known free, as they are now.
    Those that grow have grown since they were seen.

    Args:
        i: Primitive of the robot.
        room: Distance to keep beside the static need [m].
        grazes: If it is nearer already, the distance may fall by no more than this [m].
        e: Escape, with the primitive where the motion leads, after `list_moving`.
        w: The workspace, with the primitive where it is.
    """
    s, v = w.sensed, w.watch
    about, row, now = s.about, e.rows[i], w.world.rows[i]
    e.plan.placed += CELLS_COST
    for kind in range(KINDS):
        slot = int(s.slots[kind, 0])
        if w.checked[w.groups[i], w.groups[slot]] == 0:
            continue
        if kind == MOVING:
            if meets_moving(i, slot, room, grazes, e, w):
                return True
            continue
        if about.outside == kind:
            beyond = way_beyond(e.boxes[i], s)
            if not beyond <= max(0.0, way_beyond(w.world.boxes[i], s) + grazes):
                return True
        cells = cells_of(kind, s)
        if not has_cells(cells):
            continue
        v.seen_at[slot] = about.stamp
        need = room + static_need(i, slot, w, v, w.motion) + about.error
        gap = cells_gap(w.world.kinds[i], row, need, cells, s)
        if gap >= need:
            continue
        if not gap >= cells_gap(w.world.kinds[i], now, need, cells, s) - grazes:
            return True
    return False


@kernel(inline=False)
def meets_moving(
    i: int, slot: int, room: float, grazes: float, e: Escape, w: Workspace
) -> bool:
    """Whether a primitive of the placed robot is too near to listed moving cells.

    Args:
        i: Primitive of the robot.
        slot: A slot of moving cells.
        room: See `meets_cells`.
        grazes: Likewise.
        e: Likewise.
        w: Likewise.
    """
    s, v = w.sensed, w.watch
    if e.plan.moving_count > LISTED:
        return True
    own = w.buffers[w.groups[i], w.groups[slot]] + v.link_error[i] + v.robot_error[i]
    for k in range(e.plan.moving_count):
        box = s.listed[k]
        grown = s.about.speed * time_since(box.stamp, v, w.motion)
        need = room + own + grown + box.error
        gap = box_gap_of(w.world.kinds[i], e.rows[i], k, s)
        if gap >= need:
            continue
        if not gap >= box_gap_of(w.world.kinds[i], w.world.rows[i], k, s) - grazes:
            return True
    return False


@kernel
def box_gap_of(kind: int, row: Vector, k: int, s: Sensed) -> float:
    """Distance of a primitive to a listed box [m]."""
    box = s.listed[k]
    gap = cell_gap(
        kind, row, box.low[0], box.low[1], box.low[2], box.high[0], box.high[1],
        box.high[2],
    )  # fmt: skip
    return float(gap - row[0])


@kernel
def way_beyond(box: Vector, s: Sensed) -> float:
    """How far a bounding box reaches beyond the region [m]."""
    lattice, beyond = s.claims.lattice, -inf
    for k in range(3):
        low, high = lattice.low[k], lattice.low[k] + lattice.side * lattice.cell
        beyond = max(beyond, low - box[k], box[k + 3] - high)
    return beyond


@kernel(inline=False)
def cells_gap(kind: int, row: Vector, most: float, cells: Bits, s: Sensed) -> float:
    """Distance of a primitive to the nearest cell of a set, `most` beyond it [m].

    Args:
        kind: ShapeKind.
        row: Row of the primitive, world, shape (16,).
        most: Distance up to which cells count [m].
        cells: The set.
        s: Sensed space.
    """
    query, best = s.query, make_nearest()
    query.kind = kind
    for c in range(ROW_WIDTH):
        query.row[c] = row[c]
    best.gap, best.word, best.cell = most + row[0], -1, -1
    best.visited = best.measured = 0
    search(query, -1, s.claims.lattice, cells, best)
    return float(best.gap - row[0])
