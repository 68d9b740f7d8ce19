"""Lasting tracking error of each joint, measured and compensated.

A drive that is always slightly faster than its command moves an arm nearer to a surface
along which it slides than requested. The lasting part of this error can be measured and
compensated.
"""

from math import exp

from armguard.guard.commands import time_passed
from armguard.guard.watch import RECOVERING, RUNNING, Watch
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.state import Response

# Time constant of the filter of the tracking error [s].
MISSING_TIME = 0.05


@kernel
def note_missed(a: Response, v: Watch, m: Motion) -> None:
    """Note how far measured velocities are outside the pending commands.

    Errors of the measurement average out. The result is bounded by the declared
    tracking error.

    Args:
        a: Responses; `missed` is written.
        v: Watch.
        m: Motion.
    """
    part = 1.0 - exp(-time_passed(v) / MISSING_TIME)
    for j in range(a.missed.shape[0]):
        phase = v.phase[m.robot_of_joint[j]]
        if phase != RUNNING and phase != RECOVERING:
            # The robot does not follow commands, so there is no tracking error.
            a.missed[j] = 0.0
            continue
        speed = 0.5 * (m.v_low[j] + m.v_high[j])
        if v.given.has_velocity != 0:
            # Pending commands already narrow the bounds, so use the measurement.
            speed = v.velocity[j]
        low, high = v.under_way[j, 0], v.under_way[j, 1]
        off = speed - min(max(speed, low), high)
        most = m.joint_figures[j].tracking_error
        a.missed[j] += part * (min(max(off, -most), most) - a.missed[j])
