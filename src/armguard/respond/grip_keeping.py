"""Finger joints that hold an object: only their operator moves them."""

from armguard.guard.grips import Grips
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.state import Response


@kernel(inline=False)
def keep_grips(a: Response, w: Workspace, m: Motion) -> None:
    """Bound fingers that hold an object to velocities between brake and target.

    So a program may only slow them down: it neither drops nor squeezes the held object
    in order to move a finger away from another body.

    Args:
        a: Responses; `target` and `brake` are written, `low` and `high` are narrowed.
        w: Workspace.
        m: Motion.
    """
    h = w.grips
    for g in range(h.grippers.shape[0]):
        if h.grippers[g].held_count == 0:
            continue
        for f in range(h.grippers[g].first_finger, h.grippers[g].end_finger):
            keep_finger(int(w.bodies[h.fingers[f].first]), g, a, h, m)


@kernel
def keep_finger(body: int, g: int, a: Response, h: Grips, m: Motion) -> None:
    """Narrow the bounds of the joints that move a finger but not its gripper."""
    for k in range(m.length[body]):
        b = m.joints[body, k]
        if carries(b, h.grippers[g].body, m):
            continue
        j = m.q_index[b]
        a.low[j] = min(a.brake[j], a.target[j])
        a.high[j] = max(a.brake[j], a.target[j])


@kernel
def carries(b: int, hand: int, m: Motion) -> bool:
    """Whether a joint moves a whole gripper, not only one of its fingers.

    Args:
        b: Body that the joint moves.
        hand: Body of the gripper's link.
        m: Motion.
    """
    for i in range(m.length[hand]):
        if m.joints[hand, i] == b:
            return True
    return False
