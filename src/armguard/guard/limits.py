"""Is every joint within its limits, as far as can be measured?

A joint at its limit is measured beyond it by as much as its declared error, and where
commands go through the guard may creep a little farther: see `motion/outermost.py`.
Only what is farther beyond is refused.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import JOINT, REASON, VALUE
from armguard.guard.levels import Reason
from armguard.guard.watch import COMMANDED, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.figures import FIXED
from armguard.motion.state import Motion

Floats = NDArray[np.float64]

OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)


@kernel
def report_limits(q: Floats, lower: Floats, upper: Floats, out: Floats) -> None:
    """Name the first joint outside its limits; it outranks every distance."""
    for k in range(q.shape[0]):
        if not (lower[k] <= q[k] <= upper[k]):
            blame_limits(k, q[k], out)
            return


@kernel
def report_measured_limits(q: Floats, w: Workspace, v: Watch, m: Motion) -> None:
    """Name the first joint that is farther outside its limits than errors explain.

    Joints of robots in mode "fixed" have no declared errors: they are as measured.
    """
    for k in range(q.shape[0]):
        beyond = measured_beyond(k, v, m)
        if not (w.lower[k] - beyond <= q[k] <= w.upper[k] + beyond):
            blame_limits(k, q[k], w.out)
            return


@kernel
def measured_beyond(j: int, v: Watch, m: Motion) -> float:
    """How far beyond a limit a joint may be measured without being refused [rad].

    The error of its position; where commands go through the guard, as far beyond as it
    may be led, and that.
    """
    if m.robot_figures[m.robot_of_joint[j]].mode == FIXED:
        return 0.0
    figures = m.joint_figures[j]
    if v.given[COMMANDED] == 0.0:
        return float(figures.position_error)
    return float(figures.led_beyond + figures.position_error)


@kernel
def blame_limits(j: int, position: float, out: Floats) -> None:
    """Write that a joint is outside its limits."""
    out[REASON] = OUT_OF_LIMITS
    out[JOINT] = j
    out[VALUE] = position
