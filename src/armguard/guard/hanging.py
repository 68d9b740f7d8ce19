"""Stuck sensors: positions that stay bit-identical though their joint should move.

A stuck encoder, driver or bus repeats its last position with fresh stamps: the arm
seems to be at rest while it moves. The response time of a joint is not declared, so the
fault is detected only after a while; but positions of a moving joint never stay
bit-identical.
"""

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import Header
from armguard.guard.levels import Reason
from armguard.guard.observe import blame_joint
from armguard.guard.watch import RECOVERING, RUNNING, Watch
from armguard.kernel import kernel
from armguard.motion.figures import FIXED
from armguard.motion.state import Motion

Floats = NDArray[np.float64]

STATE_FROZEN = int(Reason.STATE_FROZEN)

# Longest time that a commanded joint may repeat its position [s].
HANGS_AFTER = 0.08


@kernel
def no_sensor_is_stuck(q: Floats, v: Watch, m: Motion, out: Header) -> bool:
    """Whether no joint repeats its position although its commands should have moved it.

    A joint counts as stuck if every pending command moves it farther than its tracking
    and position errors explain. Joints of fingers are exempt: an object may block them.

    Args:
        q: Measured positions, shape (n,) [rad or m].
        v: Watch; commanded time and travel of every joint are summed in `stuck`.
        m: Motion.
        out: Answer; names a joint with a stuck sensor.
    """
    hanging = -1
    for j in range(q.shape[0]):
        r = int(m.robot_of_joint[j])
        state, time = v.stuck[j], v.stamps[r] - v.looked_at[r]
        driven = v.phase[r] == RUNNING or v.phase[r] == RECOVERING
        watched = driven and m.robot_figures[r].mode != FIXED and v.may_stand[j] == 0
        if not watched or q[j] != state.position or not isfinite(time):
            state.position, state.time, state.travel = q[j], 0.0, 0.0
            continue
        figures = m.joint_figures[j]
        speed = max(v.under_way[j, 0], -v.under_way[j, 1]) - figures.tracking_error
        if time > 0.0 and speed > 0.0:
            state.time += time
            state.travel += speed * time
        far = state.travel > 2.0 * figures.position_error
        if far and state.time > HANGS_AFTER:
            hanging = j
    for r in range(v.looked_at.shape[0]):
        v.looked_at[r] = v.stamps[r]
    return hanging < 0 or blame_joint(
        STATE_FROZEN, hanging, v.stuck[hanging].travel, out
    )
