"""By how much each drive misses what it is told, as far as that lasts.

A drive that runs ahead of what it is told by a little, all the time, brings an arm
nearer to what it slides along than anybody asked for. What lasts can be measured and
taken off.
"""

from math import exp

from armguard.guard.commands import time_passed
from armguard.guard.watch import HAS_VELOCITY, RECOVERING, RUNNING, Watch
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.state import Response

# Time in which all but 1/e of what a drive missed is forgotten [s].
MISSING_TIME = 0.05


@kernel
def note_missed(a: Response, v: Watch, m: Motion) -> None:
    """Note how far measured velocities are outside the commands under way.

    Errors of their measurement average out; more than the declared error of tracking
    no drive misses.

    Args:
        a: Responses; `missed` is written.
        v: Watch.
        m: Motion.
    """
    part = 1.0 - exp(-time_passed(v) / MISSING_TIME)
    for j in range(a.missed.shape[0]):
        phase = v.phase[m.robot_of_joint[j]]
        if phase != RUNNING and phase != RECOVERING:
            # It is not told anything that it could miss.
            a.missed[j] = 0.0
            continue
        speed = 0.5 * (m.v_low[j] + m.v_high[j])
        if v.given[HAS_VELOCITY] != 0.0:
            # The bounds are narrowed by what is under way already.
            speed = v.velocity[j]
        low, high = v.under_way[j, 0], v.under_way[j, 1]
        off = speed - min(max(speed, low), high)
        most = m.joint_figures[j].tracking_error
        a.missed[j] += part * (min(max(off, -most), most) - a.missed[j])
