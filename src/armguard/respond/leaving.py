"""Recovery: escape directions out of pairs that are too near, and their least speed.

A joint moves only in the direction that opens every pair that is too near. If it opens
one and closes another, its sign is free, and constraint rows couple the joints.

A joint deviates from its command by its tracking error. The command of a recovery must
open each pair that is too near in spite of that: it begins at a speed that does, and
the robot is held again when its operator requests less.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.guard.commands import time_passed
from armguard.guard.layout import NearRow, point_of
from armguard.guard.needs import object_speed, robot_of, static_need
from armguard.guard.pair_row import pair_row
from armguard.guard.relief import SINK
from armguard.guard.watch import RESTING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.pair_state import ALLOWED
from armguard.motion.state import Motion
from armguard.respond.evasion import gets_out_of_its_way
from armguard.respond.state import EITHER_WAY, Response

Floats = NDArray[np.float64]

# Distance gradient below which a joint does not move a pair [m s/rad].
NO_ROW = 1e-9

# Factor on the least speed that opens a pair, since paths are curved [-].
SURELY = 1.25

# Least cosine between a witness point's velocity and the normal, in a recovery beside a
# moving object: a point that moves sideways could get into the object's path [-].
STRAIGHT = 0.5


@kernel
def spare_at_rest(
    i: int, j: int, near: NearRow, w: Workspace, v: Watch, m: Motion
) -> float:
    """Headroom that a near pair would have if its robots were at rest now [m]."""
    spare = near.distance - static_need(i, j, w, v, m) - m.blur[i]
    if robot_of(j, v) >= 0:
        return float(spare - m.blur[j])
    return float(spare - object_speed(j, v) * m.span.settled)


@kernel
def any_robot_leaves(a: Response) -> bool:
    """Whether any robot recovers from pairs that are too near, or evades."""
    for r in range(a.notes.shape[0]):
        if a.notes[r].recovers != 0:
            return True
    return False


@kernel(separate=True)
def note_ways_out(a: Response, w: Workspace) -> None:
    """Note the escape direction of each joint out of pairs that are too near.

    A joint without a common direction moves as the constraint rows allow.

    Args:
        a: The responses.
        w: The workspace, after a cycle was opened.
    """
    v, m = w.watch, w.motion
    for j in range(a.ways_out.shape[0]):
        a.ways_out[j] = 0
    for k in range(int(w.header.near_count)):
        near = w.near[k]
        i, j = int(near.first), int(near.second)
        intended = near.proof == ALLOWED
        if intended or not spare_at_rest(i, j, near, w, v, m) < SINK:
            continue
        if gets_out_of_its_way(robot_of(i, v), j, v):
            continue
        pair_row(i, j, near, a.raw, w, m)
        for q in range(a.ways_out.shape[0]):
            if abs(a.raw[q]) > NO_ROW:
                way = -1 if a.raw[q] > 0.0 else 1
                known = a.ways_out[q]
                a.ways_out[q] = way if known == 0 or known == way else EITHER_WAY
    for q in range(a.ways_out.shape[0]):
        r = m.robot_of_joint[q]
        if a.ways_out[q] == EITHER_WAY and a.notes[r].recovers != 0:
            a.notes[r].coupled = 1


@kernel
def only_out(r: int, a: Response, m: Motion) -> None:
    """Restrict each joint of a robot to its escape direction."""
    target, low, high = a.target, a.low, a.high
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        if a.ways_out[j] == -1:
            high[j] = min(high[j], 0.0)
        elif a.ways_out[j] == 1:
            low[j] = max(low[j], 0.0)
        if low[j] > high[j]:
            # The return from a joint limit has precedence.
            low[j] = high[j] = high[j] if high[j] < 0.0 else max(low[j], 0.0)
        target[j] = min(max(target[j], low[j]), high[j])


@kernel
def lead_away(r: int, a: Response, w: Workspace, v: Watch, m: Motion) -> bool:
    """Scale a robot's target so that it surely opens all pairs that are too near.

    A recovery begins as slowly as that allows and goes on at the requested speed, or
    faster if that is less than the speed that surely opens the pairs.

    Returns:
        Whether it opens them; if not the target is unchanged.
    """
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    least = sure_share(r, a, w, v, m)
    most, part = inf, 1.0
    for j in range(first, end):
        size = abs(a.target[j])
        if size == 0.0:
            continue
        most = min(most, (a.high[j] if a.target[j] > 0.0 else -a.low[j]) / size)
        part = min(part, m.joint_figures[j].acceleration * time_passed(v) / size)
    if v.phase[r] != RESTING:
        part = 1.0
    if least > part and a.notes[r].requests_motion == 0:
        return False
    part = max(part, least)
    if not part <= most:
        return False
    for j in range(first, end):
        a.target[j] *= part
    return True


@kernel
def sure_share(r: int, a: Response, w: Workspace, v: Watch, m: Motion) -> float:
    """Least share of a robot's target that surely opens all pairs that are too near.

    Returns:
        The share [-]; 0 if no pair is too near, infinite if the target does not open
        all of them.
    """
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    share = 0.0
    for k in range(int(w.header.near_count)):
        near = w.near[k]
        i, j = int(near.first), int(near.second)
        if robot_of(i, v) != r and robot_of(j, v) != r:
            continue
        intended = near.proof == ALLOWED
        if intended or not spare_at_rest(i, j, near, w, v, m) < SINK:
            continue
        pair_row(i, j, near, a.raw, w, m)
        opening = missed = 0.0
        for q in range(first, end):
            opening -= a.raw[q] * a.target[q]
            missed += abs(a.raw[q]) * m.joint_figures[q].tracking_error
        if not opening > 0.0:
            return inf
        if object_speed(j, v) > 0.0 and robot_of(j, v) < 0:
            speed = point_speed(i, near, a.target, w, m)
            if not opening >= STRAIGHT * speed:
                return inf
        share = max(share, SURELY * missed / opening)
    return share


@kernel
def point_speed(
    i: int, near: NearRow, target: Floats, w: Workspace, m: Motion
) -> float:
    """Speed of a pair's witness point on a robot at given joint velocities [m/s]."""
    body = w.bodies[i]
    point = point_of(near, 0)
    x = y = z = 0.0
    for c in range(m.length[body]):
        b = m.joints[body, c]
        rate = m.gain[b, 0] * target[m.q_index[b]]
        way = joint_way(point, b, m.axes[b], m)
        x, y, z = x + rate * way[0], y + rate * way[1], z + rate * way[2]
    return sqrt(x * x + y * y + z * z)
