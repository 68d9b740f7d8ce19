"""Cells of a cluster that a robot evades: they move as the cluster does."""

from armguard.geometry.shapes.kind import ShapeKind
from armguard.guard.clusters import CONFIRMED, FOLLOWED, Cluster
from armguard.guard.needs import time_since
from armguard.guard.sensed import CellBox, CellKind
from armguard.guard.sensed_boxes import put_box
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion

MOVING, BOX = int(CellKind.MOVING), int(ShapeKind.BOX)


@kernel
def is_confirmed(cluster: Cluster, v: Watch, m: Motion) -> bool:
    """Whether a cluster was measured of late."""
    return time_since(cluster.stamp, v, m) <= CONFIRMED


@kernel
def is_of_evaded(r: int, w: Workspace) -> bool:
    """Whether the box is of moving cells of a cluster that a robot evades.

    They are if its box has enclosed them of late: what was seen there has moved on with
    the cluster. It takes some frames that look past a cell until it counts as free, so
    cells that the cluster has left are of it too. A path is checked among obstacles
    that stand still: to it no cells are evaded.

    Args:
        r: The robot.
        w: The workspace.
    """
    moves = w.sensed.search.kind == MOVING and w.motion.span.segment == 0
    return bool(moves and was_enclosed(r, w))


@kernel(inline=False)
def was_enclosed(r: int, w: Workspace) -> bool:
    """Whether a cluster that a robot evades has enclosed the box of late."""
    s, v, m = w.sensed, w.watch, w.motion
    for c in range(v.clusters.shape[0]):
        if (v.cluster_evaded[c] >> r) & 1 == 0 or not is_confirmed(v.clusters[c], v, m):
            continue
        ahead = time_since(v.clusters[c].stamp, v, m)
        if has_enclosed(v.clusters[c], ahead, s.claims.lattice.cell, s.box):
            return True
    return False


@kernel
def has_enclosed(cluster: Cluster, ahead: float, room: float, box: CellBox) -> bool:
    """Whether a cluster has enclosed a box in the time for which its velocity is known.

    Args:
        cluster: The cluster.
        ahead: Time from its stamp until now [s].
        room: How far the box may reach beyond that of the cluster, without errors [m].
        box: The box.
    """
    room += box.error + cluster.error * ahead
    first, last = -FOLLOWED, ahead
    for k in range(3):
        speed = cluster.velocity[k]
        least = box.high[k] - cluster.high[k] - room
        most = box.low[k] - cluster.low[k] + room
        if not least <= most or (speed == 0.0 and not least <= 0.0 <= most):
            return False
        if speed != 0.0:
            one, other = least / speed, most / speed
            first, last = max(first, min(one, other)), min(last, max(one, other))
    return first <= last


@kernel
def mark_slots(r: int, w: Workspace) -> None:
    """Mark the near slots of a robot whose cells are of a cluster that it evades."""
    s, v = w.sensed, w.watch
    s.search.kind = MOVING
    first, end = int(s.slots[MOVING, r]), int(s.slots[MOVING, r + 1])
    for k in range(int(w.header.near_count)):
        j = int(w.near[k].second)
        if not first <= j < end or w.world.kinds[j] != BOX:
            continue
        row = w.world.rows[j]
        low = (row[1] - row[4], row[2] - row[5], row[3] - row[6])
        high = (row[1] + row[4], row[2] + row[5], row[3] + row[6])
        put_box(low, high, v.seen_at[j], s).error = row[0]
        v.evaded[j] = 1 << r if is_of_evaded(r, w) else 0
