"""Cues for operators: urgency, direction of escape, and haptic force.

They sum over all pairs that are near or soon will be, weighted by distance or time: the
joint motion that opens the pair, and a force along its normal at its witness point,
expressed as a wrench at the tool. The urgency of a robot that does not follow its
operator is 1.
"""

from math import sqrt

from armguard.geometry.vec3 import Vec3, cross, sub
from armguard.guard.layout import (
    FIRST,
    HEADER,
    HEADROOM,
    NEAR_COUNT,
    PROOF,
    ROBOT_FORCE,
    ROBOT_LEVEL,
    ROBOT_TOOL,
    ROBOT_TORQUE,
    ROBOT_URGENCY,
    ROBOT_WIDTH,
    SECOND,
    TIME_LEFT,
    WITNESS,
)
from armguard.guard.levels import Level
from armguard.guard.near_pairs import row_place
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
    out, robots = w.out, v.phase.shape[0]
    escape = HEADER + robots * ROBOT_WIDTH
    for j in range(m.q.shape[0]):
        out[escape + j] = 0.0
    look = LOOK_AHEAD * v.timing.slow_time
    for r in range(robots):
        place = HEADER + r * ROBOT_WIDTH
        soon = 1.0 - v.time_left[r] / look
        out[place + ROBOT_URGENCY] = min(max(soon, 0.0), 1.0)
        if out[place + ROBOT_LEVEL] >= STOP:
            out[place + ROBOT_URGENCY] = 1.0
        for k in range(3):
            out[place + ROBOT_FORCE + k] = out[place + ROBOT_TORQUE + k] = 0.0
            out[place + ROBOT_TOOL + k] = 0.0
    for k in range(int(out[NEAR_COUNT])):
        add_cue(row_place(k, w), look, w, v, m)
    for r in range(robots):
        finish_cue(r, escape, w, m, v)


@kernel
def add_cue(place: int, look: float, w: Workspace, v: Watch, m: Motion) -> None:
    """Add the escape direction and the wrench of a near pair to its robots' cues."""
    out = w.out
    if out[place + PROOF] == ALLOWED:
        # An intended contact exerts no force.
        return
    i, j = int(out[place + FIRST]), int(out[place + SECOND])
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    near = 1.0 - out[place + HEADROOM] / NEAR_CUE
    soon = 1.0 - out[place + TIME_LEFT] / look
    weight = min(max(near, soon, 0.0), 1.0)
    escape = HEADER + v.phase.shape[0] * ROBOT_WIDTH
    if weight > 0.0:
        pair_row(i, j, place, v.row, w, m)
        for q in range(m.q.shape[0]):
            out[escape + q] -= weight * v.row[q]
    at = place + WITNESS
    n = (out[at + 7], out[at + 8], out[at + 9])
    for side in range(2):
        r = robot_i if side == 0 else robot_j
        if r < 0:
            continue
        own = HEADER + r * ROBOT_WIDTH
        if robot_i == robot_j:
            continue
        point = (
            out[at + 1 + 3 * side], out[at + 2 + 3 * side], out[at + 3 + 3 * side]
        )  # fmt: skip
        size = -MOST_FORCE * weight if side == 0 else MOST_FORCE * weight
        force = (size * n[0], size * n[1], size * n[2])
        torque = cross(sub(point, tool_point(r, w, v)), force)
        for k in range(3):
            out[own + ROBOT_FORCE + k] += force[k]
            out[own + ROBOT_TORQUE + k] += torque[k]


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
def finish_cue(r: int, escape: int, w: Workspace, m: Motion, v: Watch) -> None:
    """Normalise a robot's escape direction, add that of its tool; bound its wrench."""
    out = w.out
    place = HEADER + r * ROBOT_WIDTH
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    length = 0.0
    for j in range(first, end):
        # Scaled by top speeds, since metres and radians are not comparable.
        top = m.joint_figures[j].velocity
        out[escape + j] *= top * top
        length += out[escape + j] * out[escape + j]
    length = sqrt(length)
    for j in range(first, end):
        out[escape + j] = out[escape + j] / length if length > NO_DIRECTION else 0.0
    force = 0.0
    for k in range(3):
        force += out[place + ROBOT_FORCE + k] * out[place + ROBOT_FORCE + k]
    force = sqrt(force)
    if force > MOST_FORCE:
        for k in range(3):
            out[place + ROBOT_FORCE + k] *= MOST_FORCE / force
            out[place + ROBOT_TORQUE + k] *= MOST_FORCE / force
    point = tool_point(r, w, v)
    body = int(v.tool_body[r])
    while body >= 0:
        if m.joint_kind[body] != NO_JOINT:
            way = joint_way(point, body, m.axes[body], m)
            speed = m.gain[body, 0] * out[escape + m.q_index[body]]
            for k in range(3):
                out[place + ROBOT_TOOL + k] += speed * way[k]
        body = int(m.parent[body])
