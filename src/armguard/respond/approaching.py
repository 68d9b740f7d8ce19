"""Obstacles that approach a robot: moving objects, and clusters of sensed cells."""

from math import inf, nan

from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.guard.evaded_cells import is_confirmed
from armguard.guard.needs import robot_of, time_since
from armguard.guard.sensed import CellKind
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.index.octree_state import ABSENT
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.escape_path import speed_of
from armguard.respond.escape_state import MOST_APPROACHING, Approaching, Escape
from armguard.respond.state import Response

# Least speed of an approaching obstacle [m/s].
SLOWEST = 0.01

# Time ahead for which obstacles are sought, as a multiple of `evade_time` [-], and
# greatest distance from their paths [m].
FORESIGHT = 2.0
BESIDE = 0.15

# Distance behind a robot at which an obstacle has passed [m], and greatest horizon of
# the prediction [s].
BEHIND = 0.15
FARTHEST = 8.0

BOX, MOVING = int(ShapeKind.BOX), int(CellKind.MOVING)


@kernel
def look_for_approaching(
    r: int, a: Response, e: Escape, w: Workspace, v: Watch, m: Motion
) -> None:
    """Find the obstacles that approach a robot; write the time until they have passed.

    The robot's own primitives are listed as well. Clusters that approach it are marked
    as evaded by it, others are not.
    """
    plan, reach, boxes = e.plan, e.reach, w.world.boxes
    plan.own_count = plan.approaching_count = 0
    for k in range(3):
        reach[k], reach[k + 3] = inf, -inf
    for i in range(w.settings.moving_count):
        if robot_of(i, v) != r:
            continue
        e.own[plan.own_count] = i
        plan.own_count += 1
        for k in range(3):
            reach[k] = min(reach[k], boxes[i, k])
            reach[k + 3] = max(reach[k + 3], boxes[i, k + 3])
    ahead = FORESIGHT * a.settings[r].evade_time
    plan.horizon = 0.0
    for c in range(v.movers.shape[0]):
        j = int(v.movers[c])
        if plan.approaching_count == MOST_APPROACHING:
            break
        if w.octree.residency[j].status != ABSENT:
            describe_object(j, e.approaching[plan.approaching_count], w, v)
            keep_if_approaching(ahead, e, v, m)
    forget_clusters(r, v)
    for c in range(v.clusters.shape[0]):
        if plan.approaching_count == MOST_APPROACHING:
            break
        if is_confirmed(v.clusters[c], v, m):
            describe_cluster(c, e.approaching[plan.approaching_count], w, v)
            if keep_if_approaching(ahead, e, v, m):
                v.cluster_evaded[c] |= 1 << r
    plan.horizon = min(plan.horizon, FARTHEST)
    plan.present_gap = nan


@kernel
def describe_object(j: int, out: Approaching, w: Workspace, v: Watch) -> None:
    """Describe a primitive of a moving object."""
    out.primitive, out.group, out.kind = j, w.groups[j], w.world.kinds[j]
    for k in range(ROW_WIDTH):
        out.row[k] = w.world.rows[j, k]
    for k in range(6):
        out.box[k] = w.world.boxes[j, k]
    for k in range(3):
        out.velocity[k] = v.object_velocity[j, k]
    out.radius, out.error, out.seen_at = 0.0, 0.0, v.seen_at[j]


@kernel
def forget_clusters(r: int, v: Watch) -> None:
    """Note that a robot evades no cluster."""
    for c in range(v.cluster_evaded.shape[0]):
        v.cluster_evaded[c] &= ~(1 << r)


@kernel
def describe_cluster(c: int, out: Approaching, w: Workspace, v: Watch) -> None:
    """Describe a cluster of sensed cells as a box along the axes of the world."""
    cluster = v.clusters[c]
    out.primitive, out.kind = -1 - c, BOX
    out.group = w.groups[w.sensed.slots[MOVING, 0]]
    for k in range(ROW_WIDTH):
        out.row[k] = 0.0
    for k in range(3):
        low, high = cluster.low[k], cluster.high[k]
        out.row[1 + k], out.row[4 + k] = 0.5 * (low + high), 0.5 * (high - low)
        out.row[7 + 4 * k] = 1.0
        out.box[k], out.box[k + 3] = low, high
        out.velocity[k] = cluster.velocity[k]
    out.radius, out.error = cluster.radius, cluster.error
    out.seen_at = cluster.stamp


@kernel
def keep_if_approaching(ahead: float, e: Escape, v: Watch, m: Motion) -> bool:
    """Keep the last described obstacle if it gets beside the robot soon.

    Args:
        ahead: Time ahead [s].
        e: Escape, with the box around the robot; the horizon is extended.
        v: Watch.
        m: Motion.

    Returns:
        Whether it is kept.
    """
    plan, reach = e.plan, e.reach
    obstacle = e.approaching[plan.approaching_count]
    speed = speed_of(obstacle)
    if not speed > SLOWEST:
        return False
    approaches, way = True, 0.0
    since = time_since(obstacle.seen_at, v, m)
    for k in range(3):
        x = obstacle.velocity[k]
        low, high = obstacle.box[k] + since * x, obstacle.box[k + 3] + since * x
        approaches &= low + min(ahead * x, 0.0) - BESIDE < reach[k + 3]
        approaches &= high + max(ahead * x, 0.0) + BESIDE > reach[k]
        way += x * (reach[k + 3] - low if x > 0.0 else reach[k] - high)
    if approaches:
        plan.approaching_count += 1
        plan.horizon = max(plan.horizon, (way / speed + BEHIND) / speed)
    return bool(approaches)


@kernel
def has_cluster(e: Escape) -> bool:
    """Whether one of the approaching obstacles is a cluster."""
    for c in range(e.plan.approaching_count):
        if e.approaching[c].primitive < 0:
            return True
    return False


@kernel
def is_approaching(j: int, e: Escape, w: Workspace) -> bool:
    """Whether a primitive is an approaching obstacle, or moving cells while one is."""
    slots = w.sensed.slots
    moves = slots[MOVING, 0] <= j < slots[MOVING, 1]
    for c in range(e.plan.approaching_count):
        primitive = e.approaching[c].primitive
        if primitive == j or (primitive < 0 and moves):
            return True
    return False
