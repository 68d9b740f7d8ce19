"""What is meant is come to along the operator's own way: slower, and nowhere else.

Near what is to be gripped, or put down, a contract asks for ever less speed. A program
would find a velocity that is nearer to what was asked for, and leads aside or tilts the
hand; who corrects that asks for more speed than one who means it. So the arm is slowed
down in proportion, from where the contract begins. Fingers are not: one that has got
there would hold back the other.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.contracts import GRANTED, allowed_speed, contract_of
from armguard.guard.grips import (
    BODY,
    BY_INTENT,
    GRIPPER,
    IN_FORCE,
    KIND,
    STANDING,
    STATE,
    Grips,
    open_grips,
)
from armguard.guard.workspace import GRIPS, INTENT, NOWHERE, Workspace
from armguard.kernel import kernel
from armguard.motion.figures import FIRST_JOINT, JOINT_COUNT
from armguard.motion.state import NEXT, REACTION, Motion
from armguard.respond.state import Response

Floats = NDArray[np.float64]


@kernel(inline=False)
def slow_to_contract(
    r: int,
    part: float,
    i: int,
    j: int,
    distance: float,
    a: Response,
    w: Workspace,
    m: Motion,
) -> None:
    """Slow an arm down to the speed at which a contract lets it close a pair.

    Args:
        r: The robot.
        part: Its share of that speed.
        i: First primitive.
        j: Second primitive.
        distance: Their distance [m].
        a: Responses; `raw` holds how fast each joint closes the pair, `target` is
            changed.
        w: Workspace.
        m: Motion.
    """
    if w.parts[INTENT] == NOWHERE:
        return
    h = open_grips(w.parts[GRIPS])
    k = contract_of(i, j, h)
    if k < 0:
        return
    c = h.contracts[k]
    if c[STATE] != IN_FORCE or not (c[KIND] == BY_INTENT or c[KIND] == STANDING):
        return
    limit = part * granted_speed(r, distance, c, m)
    first = int(m.robot_figures[r, FIRST_JOINT])
    end = first + int(m.robot_figures[r, JOINT_COUNT])
    closing = 0.0
    for q in range(first, end):
        if not is_finger(q, c, h, m):
            closing += a.raw[q] * a.target[q]
    if not closing > limit or not closing > 0.0:
        return
    kept = max(limit, 0.0) / closing
    for q in range(first, end):
        # No joint slows down harder than its stop is declared.
        if not is_finger(q, c, h, m) and a.target[q] * a.brake[q] > 0.0:
            kept = max(kept, min(a.brake[q] / a.target[q], 1.0))
    for q in range(first, end):
        if not is_finger(q, c, h, m):
            a.target[q] = min(max(kept * a.target[q], a.low[q]), a.high[q])


@kernel
def granted_speed(r: int, distance: float, c: Floats, m: Motion) -> float:
    """Closing speed that a response asks for under a contract [m/s]."""
    time = m.clock[NEXT * m.robot_figures.shape[0] + r, REACTION]
    return float(GRANTED * allowed_speed(distance, time, c))


@kernel
def is_finger(q: int, c: Floats, h: Grips, m: Motion) -> bool:
    """Whether a joint moves fingers of a contract's gripper, and not the gripper."""
    if c[KIND] != BY_INTENT:
        return False
    hand = int(h.grippers[int(c[GRIPPER]), BODY])
    for i in range(m.length[hand]):
        if m.q_index[m.joints[hand, i]] == q:
            return False
    return True
