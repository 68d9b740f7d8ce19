"""Joint limits: refusal of positions that measurement errors do not explain.

A joint at its limit may be measured beyond it by its declared error, and where commands
go through the guard it may creep a little farther: see `motion/outermost.py`. Only
positions farther beyond are refused.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import Header
from armguard.guard.levels import Reason
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.figures import FIXED
from armguard.motion.state import Motion

Floats = NDArray[np.float64]

OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)


@kernel
def report_limits(q: Floats, lower: Floats, upper: Floats, out: Header) -> None:
    """Write the first joint outside its limits; this reason outranks every distance."""
    for k in range(q.shape[0]):
        if not (lower[k] <= q[k] <= upper[k]):
            blame_limits(k, q[k], out)
            return


@kernel
def report_measured_limits(q: Floats, w: Workspace, v: Watch, m: Motion) -> None:
    """Write the first joint that is farther outside its limits than errors explain.

    Joints of robots in mode "fixed" have no declared errors: the measurement is exact.
    """
    for k in range(q.shape[0]):
        beyond = measured_beyond(k, v, m)
        if not (w.lower[k] - beyond <= q[k] <= w.upper[k] + beyond):
            blame_limits(k, q[k], w.header)
            return


@kernel
def measured_beyond(j: int, v: Watch, m: Motion) -> float:
    """Tolerance of a joint's measured position beyond a limit [rad or m].

    The error of its position; where commands go through the guard, plus the creep
    `led_beyond`.
    """
    if m.robot_figures[m.robot_of_joint[j]].mode == FIXED:
        return 0.0
    figures = m.joint_figures[j]
    if v.given.commanded == 0:
        return float(figures.position_error)
    return float(figures.led_beyond + figures.position_error)


@kernel
def blame_limits(j: int, position: float, out: Header) -> None:
    """Write the reason of a joint outside its limits."""
    out.reason = OUT_OF_LIMITS
    out.joint = j
    out.value = position
