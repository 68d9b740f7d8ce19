"""Consistency of measured velocities with measured positions.

Between two samples a joint moves at the velocities measured at both, within these
errors: the declared error of each; what the joint can accelerate in between, and again
in half a period, since controllers often stamp a velocity half a cycle off its
position. A joint may decelerate arbitrarily hard. So the displacement between two
samples is bounded, and so is the sum over any time; positions are off by at most one
error at either end. `AHEAD_SUM` and `BEHIND_SUM` are the largest excess over all
intervals that end now. Within the declared figures neither exceeds its limit, so there
is no false alarm.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Reason
from armguard.guard.settling import hardest_stop, swing_speed
from armguard.guard.watch import BRAKING, LOST, STOPPING, Watch
from armguard.kernel import kernel
from armguard.motion.state import Motion

Floats = NDArray[np.float64]

OK = int(Reason.OK)
STATE_FROZEN = int(Reason.STATE_FROZEN)
STATE_DISAGREES = int(Reason.STATE_DISAGREES)

# Rounding of stamps [s], and round-off of a displacement [rad] or a speed [rad/s].
STAMP_GRAIN = 1e-6
GRAIN = 1e-7


class Interval(NamedTuple):
    """Interval between the last two samples of a robot.

    Attributes:
        stamp: Stamp of the new sample [s].
        time: Time between both stamps [s].
        known: Whether there is an earlier sample.
        has_velocity: Whether the new sample has measured velocities.
        stops: Whether a stop of the robot was ordered and is not yet done.
        r: The robot.
    """

    stamp: float
    time: float
    known: bool
    has_velocity: bool
    stops: bool
    r: int


@kernel
def interval_of(r: int, v: Watch, m: Motion) -> Interval:
    """Interval that ends with the new sample of a robot."""
    phase = v.phase[r]
    return Interval(
        stamp=float(v.stamps[r]),
        time=float(v.stamps[r] - v.last_stamp[r]),
        known=bool(v.sample_count[r] > 0),
        has_velocity=bool(v.given.has_velocity != 0),
        stops=bool(phase == STOPPING or phase == BRAKING or phase == LOST),
        r=r,
    )


@kernel
def contradiction(
    j: int, position: float, interval: Interval, v: Watch, m: Motion
) -> int:
    """Reason why a new sample of a joint contradicts the ones before; OK if none.

    Args:
        j: The joint.
        position: Its new position [rad or m].
        interval: Interval since the sample before.
        v: Watch; the sums that hold if the sample is accepted are written.
        m: Motion.
    """
    sums, figures = v.agreement[j], m.joint_figures[j]
    sums.ahead_next = sums.behind_next = 0.0
    before, speed = sums.latest, v.velocity[j]
    time, stops = interval.time, interval.stops
    known = interval.has_velocity and interval.known and before == before
    if not (known and time > 0.0):
        return OK
    period, error = v.timing.period, figures.velocity_error
    swing = swing_speed(m.robot_figures[interval.r], figures) if stops else 0.0
    gain = 0.5 * figures.acceleration * (time + period)
    faster = max(speed - max(before, 0.0), min(before, 0.0) - speed)
    if stops and not faster <= 2.0 * (gain + error) + swing + GRAIN:
        # No stopping drive accelerates like that: position or velocity is wrong.
        return STATE_DISAGREES
    off = (error + swing + gain) * time
    way = position - v.sample_q[j, 0]
    ahead = max(sums.ahead, 0.0) + way - max(before, speed) * time - off
    behind = max(sums.behind, 0.0) + min(before, speed) * time - way - off
    # In a stop, a velocity stamped half a period off differs from its position.
    limit = 0.25 * hardest_stop(figures) * period * period + GRAIN
    limit += 2.0 * (figures.position_error + figures.velocity * STAMP_GRAIN)
    if not max(ahead, behind) <= limit:
        return STATE_FROZEN if way == 0.0 else STATE_DISAGREES
    sums.ahead_next, sums.behind_next = ahead, behind
    return OK


@kernel
def fits_its_stamp(j: int, position: float, interval: Interval, v: Watch) -> bool:
    """Whether a sample with a repeated stamp also repeats its values."""
    if not interval.known or interval.time != 0.0:
        return True
    before = v.agreement[j].latest
    same = not interval.has_velocity or before != before or v.velocity[j] == before
    return bool(same and position == v.sample_q[j, 0])


@kernel
def keep_agreement(j: int, v: Watch) -> None:
    """Store the sums and the velocity of a joint whose sample was accepted."""
    sums = v.agreement[j]
    sums.ahead, sums.behind = sums.ahead_next, sums.behind_next
    sums.earlier = sums.latest
    sums.latest = v.velocity[j] if v.given.has_velocity != 0 else np.nan
