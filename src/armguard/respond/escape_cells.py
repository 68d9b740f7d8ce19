"""Sensed space beside an escape motion: occupied cells, and cells not known free."""

from math import inf

from armguard.cells.clearance import make_nearest, search
from armguard.cells.state import Bits
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.guard.needs import static_need
from armguard.guard.sensed import CellKind, Sensed
from armguard.guard.sensed_search import cells_of, has_cells
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.respond.escape_state import Escape
from armguard.table import Vector

KINDS, MOVING = len(CellKind), int(CellKind.MOVING)

# Number of placed primitives per comparison with the cells, by cost.
CELLS_COST = 4


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
        e: Escape, with the primitive where the motion leads.
        w: The workspace, with the primitive where it is.
    """
    s, v = w.sensed, w.watch
    about, row, now = s.about, e.rows[i], w.world.rows[i]
    e.plan.placed += CELLS_COST
    for kind in range(KINDS):
        slot = int(s.slots[kind, 0])
        if w.checked[w.groups[i], w.groups[slot]] == 0:
            continue
        if about.outside == kind:
            beyond = way_beyond(e.boxes[i], s)
            if not beyond <= max(0.0, way_beyond(w.world.boxes[i], s) + grazes):
                return True
        cells = cells_of(kind, s)
        if not has_cells(cells):
            continue
        v.seen_at[slot] = about.oldest if kind == MOVING else about.stamp
        need = room + static_need(i, slot, w, v, w.motion) + about.error
        gap = cells_gap(w.world.kinds[i], row, need, cells, s)
        if gap >= need:
            continue
        if not gap >= cells_gap(w.world.kinds[i], now, need, cells, s) - grazes:
            return True
    return False


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
