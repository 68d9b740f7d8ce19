"""What cells near a primitive are compared with, and which of them cannot matter."""

from math import inf, sqrt

import numpy as np

from armguard.cells.clearance import ALONG_X, ALONG_Y, ALONG_Z, range_bits
from armguard.cells.state import Bits
from armguard.geometry.cell_gap import is_farther
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3
from armguard.guard.needs import static_need
from armguard.guard.search_distance import lever_look, way_until_look
from armguard.guard.sensed import BY_WORD, CellKind, Search, Sensed
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.twist_bound import deviation, place_at_middle

STILL, MOVING, UNSEEN = int(CellKind.STILL), int(CellKind.MOVING), int(CellKind.UNSEEN)

# Most work of a cycle on the cells near a robot, in comparisons of two bounds, at some
# 15 nanoseconds each, 24 with the proofs. What is spent on greater commands does not
# count for the pending ones.
MOST_WORK = 120_000

# Work of an exact distance to a box.
EXACT = 10


@kernel
def cells_of(kind: int, s: Sensed) -> Bits:
    """Cells of a kind."""
    if kind == STILL:
        return s.still
    if kind == MOVING:
        return s.moving
    return s.unseen if kind == UNSEEN else s.growing


@kernel
def has_cells(cells: Bits) -> bool:
    """Whether a set of cells is not empty."""
    for root in range(cells.roots.shape[0]):
        if cells.roots[root] != 0:
            return True
    return False


@kernel
def write_search(i: int, w: Workspace) -> bool:
    """Write what the cells near a primitive are compared with.

    Returns:
        Whether all of it is finite.
    """
    s, v, m = w.sensed, w.watch, w.motion
    about, search, query = s.about, s.search, s.query
    slot = int(s.slots[search.kind, 0])
    v.seen_at[slot] = about.oldest if search.kind == MOVING else about.stamp
    need = static_need(i, slot, w, v, m) + way_until_look(slot, v, m) + about.error
    way, look = need + 0.5 * w.settings.margin, need + v.look[i]
    opens = w.settings.contracts != 0 and w.grips.may[w.groups[i], w.groups[slot]] != 0
    if opens:
        look = need + lever_look(i, v, m)
    search.primitive, search.look = i, max(w.settings.margin, look)
    search.need = need
    finite = search.look < inf
    for k in range(3):
        if opens:
            search.low[k] = w.world.boxes[i, k] - search.look
            search.high[k] = w.world.boxes[i, k + 3] + search.look
        else:
            search.low[k] = v.swept[k, i] - way
            search.high[k] = v.swept[k + 3, i] + way
        finite &= search.low[k] <= search.high[k]
    search.clear = inf
    if v.tight[i] != 0 and not opens:
        write_clear(i, w)
    query.kind = w.world.kinds[i]
    for c in range(ROW_WIDTH):
        query.row[c] = w.world.rows[i, c]
    return bool(finite)


@kernel(inline=False)
def write_clear(i: int, w: Workspace) -> None:
    """Write beyond which distance cells cannot matter, by the middles of the stops.

    What it leaves out `pair_look` leaves out too, one box at a time.
    """
    s, m = w.sensed, w.motion
    search, body = s.search, w.bodies[i]
    if m.effort.at_middle == 0:
        place_at_middle(w.bodies, w.T_world, m)
    kept = max(search.need + w.watch.reserve[i], w.settings.margin + s.about.error)
    search.clear = m.balls[i].radius + kept
    search.astray[0] = deviation(i, (1.0, 0.0, 0.0), 0, body, m)
    search.astray[1] = deviation(i, (0.0, 1.0, 0.0), 0, body, m)
    search.astray[2] = deviation(i, (0.0, 0.0, 1.0), 0, body, m)
    for k in range(3):
        search.middle[k] = m.middle_balls[i, k]
        way = search.clear + search.astray[k]
        search.low[k] = max(search.low[k], search.middle[k] - way)
        search.high[k] = min(search.high[k], search.middle[k] + way)


@kernel
def is_passed_clear(low: Vec3, high: Vec3, search: Search) -> bool:
    """Whether the ball round the primitive stays clear of a box during the stops.

    Its centre moves along a unit direction n by at most Σ |n_k| astray_k. A NaN
    compares false, so that the box is judged and the NaN is seen.
    """
    if search.clear == inf:
        return False
    square = along = 0.0
    for k in range(3):
        middle = search.middle[k]
        way = abs(min(max(middle, low[k]), high[k]) - middle)
        square += way * way
        along += way * search.astray[k]
    return bool(square - along > search.clear * sqrt(square))


@kernel
def within(members: np.uint64, corner: Vec3, edge: float, search: Search) -> np.uint64:
    """Members of a group or block that meet the search box of a primitive.

    Args:
        members: The members.
        corner: Lower corner of the group or block [m].
        edge: Edge of a member [m].
        search: The search.
    """
    scale = 1.0 / edge
    low, high = search.low[0] - corner[0], search.high[0] - corner[0]
    members &= range_bits(low * scale, high * scale, ALONG_X, 1)
    low, high = search.low[1] - corner[1], search.high[1] - corner[1]
    members &= range_bits(low * scale, high * scale, ALONG_Y, 4)
    low, high = search.low[2] - corner[2], search.high[2] - corner[2]
    return members & range_bits(low * scale, high * scale, ALONG_Z, 16)


@kernel
def begin_cells(s: Sensed) -> None:
    """Start a cycle, or the check of a line, for cells."""
    s.coarse[:] = BY_WORD
    s.evaded[:] = 0
    begin_work(s)


@kernel
def begin_work(s: Sensed) -> None:
    """Start the work on cells."""
    s.work[:] = 0


@kernel
def begin_again(r: int, s: Sensed) -> None:
    """Start the work on the cells near a robot again, as finely as at first."""
    s.work[r] = 0
    for kind in range(s.coarse.shape[0]):
        s.coarse[kind, r] = BY_WORD


@kernel
def limit_work(parts: int, s: Sensed) -> None:
    """Allow one of some parts of the work that is left to the robot that is judged."""
    done = s.work[s.search.robot]
    s.about.limit = done + max(0, MOST_WORK - done) // parts


@kernel
def count_work(boxes: int, s: Sensed) -> None:
    """Count work for the robot that is judged, and note when it is too much."""
    s.work[s.search.robot] += boxes
    if s.work[s.search.robot] > s.about.limit:
        s.about.spent = 1


@kernel
def is_beyond(low: Vec3, edge: float, s: Sensed) -> bool:
    """Whether a cube with a lower corner is too far from the primitive to matter."""
    count_work(1, s)
    high = (low[0] + edge, low[1] + edge, low[2] + edge)
    if is_passed_clear(low, high, s.search):
        return True
    query = s.query
    return bool(
        is_farther(query.kind, query.row, low, high, s.search.look + query.row[0])
    )
