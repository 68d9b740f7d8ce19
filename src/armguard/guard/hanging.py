"""Positions that stay the same to the last bit though their joint was told to move.

What hangs, an encoder, a driver, a bus, goes on to tell the last position it knew, with
fresh stamps: to whoever believes it the arm stands, while it moves. How soon a joint
speeds up is not declared, so it shows only after a while; but a joint that moves at all
does not measure the very same.
"""

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Reason
from armguard.guard.observe import blame_joint
from armguard.guard.watch import (
    COMMANDED_FOR,
    COMMANDED_WAY,
    RECOVERING,
    RUNNING,
    STUCK_AT,
    Watch,
)
from armguard.kernel import kernel
from armguard.motion.figures import FIXED
from armguard.motion.state import Motion

Floats = NDArray[np.float64]

STATE_FROZEN = int(Reason.STATE_FROZEN)

# A joint may measure the same for so long while it is told to move [s].
HANGS_AFTER = 0.08


@kernel
def no_sensor_is_stuck(q: Floats, v: Watch, m: Motion, out: Floats) -> bool:
    """Whether no joint measures the same though it should have moved by now.

    Every command that may be in effect has to lead it farther than its drive may miss
    and its position be off. Fingers may stand against what they grip.

    Args:
        q: Measured positions.
        v: Watch; what was told of every joint meanwhile is added up.
        m: Motion.
        out: Answer; a joint that hangs is named in it.
    """
    hanging = -1
    for j in range(q.shape[0]):
        r = int(m.robot_of_joint[j])
        state, time = v.stuck[j], v.stamps[r] - v.looked_at[r]
        driven = v.phase[r] == RUNNING or v.phase[r] == RECOVERING
        watched = driven and m.robot_figures[r].mode != FIXED and v.may_stand[j] == 0
        if not watched or q[j] != state[STUCK_AT] or not isfinite(time):
            state[STUCK_AT], state[COMMANDED_FOR], state[COMMANDED_WAY] = q[j], 0.0, 0.0
            continue
        figures = m.joint_figures[j]
        speed = max(v.under_way[j, 0], -v.under_way[j, 1]) - figures.tracking_error
        if time > 0.0 and speed > 0.0:
            state[COMMANDED_FOR] += time
            state[COMMANDED_WAY] += speed * time
        far = state[COMMANDED_WAY] > 2.0 * figures.position_error
        if far and state[COMMANDED_FOR] > HANGS_AFTER:
            hanging = j
    for r in range(v.looked_at.shape[0]):
        v.looked_at[r] = v.stamps[r]
    return hanging < 0 or blame_joint(
        STATE_FROZEN, hanging, v.stuck[hanging, COMMANDED_WAY], out
    )
