"""Fingers slow down alone: the speed of their arm does not scale with theirs.

To keep an arm on its path all its joints slow down in proportion. A finger that touches
the grasp target would then delay the other finger, which does not touch it yet.
"""

from armguard.guard.grips import Grips
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.grip_keeping import carries
from armguard.respond.state import ROWS, Response


@kernel(inline=False)
def slow_fingers(r: int, a: Response, w: Workspace, m: Motion) -> None:
    """Slow the fingers of a robot if its target violates a row that they can satisfy.

    Args:
        r: The robot.
        a: Responses; `target` is changed, towards `brake`.
        w: Workspace.
        m: Motion.
    """
    h = w.grips
    for g in range(h.grippers.shape[0]):
        for f in range(h.grippers[g].first_finger, h.grippers[g].end_finger):
            slow_finger(r, int(w.bodies[h.fingers[f].first]), g, a, h, m)


@kernel
def slow_finger(r: int, body: int, g: int, a: Response, h: Grips, m: Motion) -> None:
    """Slow the joints that move a finger but not its gripper."""
    for k in range(m.length[body]):
        b = m.joints[body, k]
        j = m.q_index[b]
        if m.robot_of_joint[j] != r or carries(b, h.grippers[g].body, m):
            continue
        for row in range(a.notes[r].row_count):
            slow_joint(j, r, r * ROWS + row, a, m)


@kernel
def slow_joint(j: int, r: int, at: int, a: Response, m: Motion) -> None:
    """Reduce a joint's part in the violation of a row, at most to its declared stop."""
    first = m.robot_figures[r].first_joint
    own, target = a.rows[at, j], a.target[j]
    broken = -a.eased[at]
    for i in range(first, first + m.robot_figures[r].joint_count):
        broken += a.rows[at, i] * a.target[i]
    most = own * (target - a.brake[j])
    if broken > 0.0 and most > 0.0:
        a.target[j] = target - min(broken, most) / own
