"""Cues for operators: urgency, direction of escape, and haptic force.

They sum over all pairs that are near or soon will be, weighted by distance or time: the
joint motion that opens the pair, and a force along its normal at its witness point,
expressed as a wrench at the tool. The urgency of a robot that does not follow its
operator is 1.
"""

from math import sqrt

from armguard.geometry.vec3 import Vec3, cross, sub
from armguard.guard.layout import NearRow, normal_of, point_of
from armguard.guard.levels import Level
from armguard.guard.needs import LOOK_AHEAD, robot_of
from armguard.guard.pair_row import pair_row
from armguard.guard.proofs import NEAR_CUE
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.pair_state import ALLOWED
from armguard.motion.state import Motion
from armguard.robot.kinematics import FIXED as NO_JOINT

STOP = int(Level.STOP)

# Force of a pair without headroom [N].
MOST_FORCE = 10.0

# Least length of a direction before it is normalised [-].
NO_DIRECTION = 1e-9


@kernel
def write_cues(w: Workspace, v: Watch, m: Motion) -> None:
    """Write each robot's cues and its escape direction in joint space."""
    for j in range(m.q.shape[0]):
        w.escape[j] = 0.0
    look = LOOK_AHEAD * v.timing.slow_time
    for r in range(v.phase.shape[0]):
        row = w.robots[r]
        soon = 1.0 - v.time_left[r] / look
        row.urgency = min(max(soon, 0.0), 1.0)
        if row.level >= STOP:
            row.urgency = 1.0
        for k in range(3):
            row.force[k] = row.torque[k] = row.tool[k] = 0.0
    for k in range(int(w.header.near_count)):
        add_cue(w.near[k], look, w, v, m)
    for r in range(v.phase.shape[0]):
        finish_cue(r, w, m, v)


@kernel
def add_cue(near: NearRow, look: float, w: Workspace, v: Watch, m: Motion) -> None:
    """Add the escape direction and the wrench of a near pair to its robots' cues."""
    if near.proof == ALLOWED:
        # An intended contact exerts no force.
        return
    i, j = int(near.first), int(near.second)
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    close = 1.0 - near.headroom / NEAR_CUE
    soon = 1.0 - near.time_left / look
    weight = min(max(close, soon, 0.0), 1.0)
    if weight > 0.0:
        pair_row(i, j, near, v.row, w, m)
        for q in range(m.q.shape[0]):
            w.escape[q] -= weight * v.row[q]
    n = normal_of(near)
    for side in range(2):
        r = robot_i if side == 0 else robot_j
        if r < 0:
            continue
        if robot_i == robot_j:
            continue
        point = point_of(near, side)
        size = -MOST_FORCE * weight if side == 0 else MOST_FORCE * weight
        force = (size * n[0], size * n[1], size * n[2])
        torque = cross(sub(point, tool_point(r, w, v)), force)
        for k in range(3):
            w.robots[r].force[k] += force[k]
            w.robots[r].torque[k] += torque[k]


@kernel
def tool_point(r: int, w: Workspace, v: Watch) -> Vec3:
    """Origin of a robot's tool in the world [m]."""
    T = w.T_world[v.tool_body[r]]
    x, y, z = v.tool_point[r, 0], v.tool_point[r, 1], v.tool_point[r, 2]
    return (
        T[0] * x + T[1] * y + T[2] * z + T[3],
        T[4] * x + T[5] * y + T[6] * z + T[7],
        T[8] * x + T[9] * y + T[10] * z + T[11],
    )


@kernel
def finish_cue(r: int, w: Workspace, m: Motion, v: Watch) -> None:
    """Normalise a robot's escape direction, add that of its tool; bound its wrench."""
    row, escape = w.robots[r], w.escape
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    length = 0.0
    for j in range(first, end):
        # Scaled by top speeds, since metres and radians are not comparable.
        top = m.joint_figures[j].velocity
        escape[j] *= top * top
        length += escape[j] * escape[j]
    length = sqrt(length)
    for j in range(first, end):
        escape[j] = escape[j] / length if length > NO_DIRECTION else 0.0
    force = 0.0
    for k in range(3):
        force += row.force[k] * row.force[k]
    force = sqrt(force)
    if force > MOST_FORCE:
        for k in range(3):
            row.force[k] *= MOST_FORCE / force
            row.torque[k] *= MOST_FORCE / force
    point = tool_point(r, w, v)
    body = int(v.tool_body[r])
    while body >= 0:
        if m.joint_kind[body] != NO_JOINT:
            way = joint_way(point, body, m.axes[body], m)
            speed = m.gain[body, 0] * escape[m.q_index[body]]
            for k in range(3):
                row.tool[k] += speed * way[k]
        body = int(m.parent[body])
