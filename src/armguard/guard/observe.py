"""First step of a cycle with predicted stops: plausibility and velocities of the input.

Every input has its own stamp. A robot's age is the time from its stamp to now; if the
time of the cycle is not given, it is the newest stamp, and the declared delay of
measurements is added. Implausible input gives a reason whose level is a stop. The clock
is judged first, since a stop for any other fault is ordered by it.
"""

from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.agreement import (
    Interval,
    contradiction,
    fits_its_stamp,
    interval_of,
    keep_agreement,
)
from armguard.guard.layout import Header
from armguard.guard.levels import Reason
from armguard.guard.watch import HISTORY, Watch
from armguard.kernel import kernel
from armguard.motion.figures import (
    FIXED,
)
from armguard.motion.state import Motion
from armguard.table import Vector

Floats = NDArray[np.float64]

OK = int(Reason.OK)
STAMP_MISSING = int(Reason.STAMP_MISSING)
TIME_BACKWARDS = int(Reason.TIME_BACKWARDS)
TIME_STILL = int(Reason.TIME_STILL)
STAMP_AHEAD = int(Reason.STAMP_AHEAD)
STATE_STALE = int(Reason.STATE_STALE)
CYCLE_LATE = int(Reason.CYCLE_LATE)
STATE_JUMPED = int(Reason.STATE_JUMPED)
TOO_FAST = int(Reason.TOO_FAST)
NO_VELOCITY = int(Reason.NO_VELOCITY)
NOT_FINITE = int(Reason.NOT_FINITE)
OBJECT_UNSEEN = int(Reason.OBJECT_UNSEEN)
OBJECT_AHEAD = int(Reason.OBJECT_AHEAD)
OBJECT_STALE = int(Reason.OBJECT_STALE)
STAMP_REPEATED = int(Reason.STAMP_REPEATED)

# Relative [-] and absolute [s] rounding of times.
TIME_SHARE = 1e-12
TIME_GRAIN = 1e-6

# Tolerance of a measured speed above the declared one, beside its error: a share, since
# controllers that keep limits overshoot a little [-].
SPEED_SHARE = 0.02


@kernel(separate=True)
def observe(q: Vector, out: Header, v: Watch, m: Motion) -> bool:
    """Store positions and velocity bounds of a cycle, or write what is wrong.

    Args:
        q: Joint positions, all finite, shape (n,) [rad or m].
        out: Header of the answer.
        v: Inputs and memory.
        m: The prediction; `q`, `v_low` and `v_high` are written.

    Returns:
        Whether the input can be judged.
    """
    if not sightings_are_right(v, m, out):
        return False
    for j in range(q.shape[0]):
        m.q[j] = q[j]
    # Until then, the velocity bounds are those of the last accepted sample.
    return sample_is_right(q, v, m, out) and velocities_are_known(q, v, m, out)


@kernel
def now_of(v: Watch) -> float:
    """Time of the cycle as given, else the newest stamp [s]."""
    now = v.given.now
    if now == now:
        return float(now)
    newest = -inf
    for r in range(v.stamps.shape[0]):
        newest = max(newest, v.stamps[r])
    return float(newest)


@kernel
def unannounced_time(v: Watch, m: Motion) -> float:
    """Greatest delay of the cycle after the newest stamp, if its time is unknown [s].

    Every robot's newest measurement is at most `sensing` old, so the newest of all is
    at most the least of these old. Two newest stamps may be farther apart than their
    cycles by as much.
    """
    if v.given.now == v.given.now:
        return 0.0
    least = inf
    for r in range(v.stamps.shape[0]):
        if m.robot_figures[r].mode != FIXED:
            least = min(least, m.robot_figures[r].sensing)
    return float(least) if least < inf else 0.0


@kernel(separate=True)
def clocks_are_right(out: Header, v: Watch, m: Motion) -> bool:
    """Whether all stamps and the time of the cycle are plausible.

    The time of the cycle is accepted, and its orders count as given then, if the cycle
    is in time after the last one, or a stamp agrees with it. Else the time of an order
    is unknown until the next cycle with an accepted time: it was before that.

    Args:
        out: Header of the answer.
        v: Inputs and memory.
        m: The prediction.
    """
    v.last.forced, v.last.ordered_at = OK, inf
    commanded = v.given.now == v.given.now
    for r in range(v.stamps.shape[0]):
        if not (commanded or isfinite(v.stamps[r])):
            return blame_robot(STAMP_MISSING, r, v.stamps[r], out)
    now, last = now_of(v), v.last.now
    if not isfinite(now):
        return blame_robot(STAMP_MISSING, -1, now, out)
    if now < last:
        return blame_robot(TIME_BACKWARDS, -1, now - last, out)
    if now == last:
        return blame_robot(TIME_STILL, -1, now, out)
    grain = TIME_GRAIN + TIME_SHARE * abs(now)
    unannounced = unannounced_time(v, m)
    limit = (
        v.timing.period + v.timing.late + max(unannounced, v.last.unannounced) + grain
    )
    in_time = now - last <= limit
    believed, ahead, right = in_time or not commanded, False, True
    for r in range(v.stamps.shape[0]):
        reason = stamp_fault(r, now, grain, v, m)
        if reason == OK:
            believed |= m.robot_figures[r].mode != FIXED
            continue
        ahead |= reason == STAMP_AHEAD
        if right:
            # The first fault is reported.
            value = v.stamps[r]
            if reason == TIME_BACKWARDS:
                value -= v.last_stamp[r]
            elif reason != STAMP_MISSING:
                value = abs(now - value)
            right = blame_robot(reason, r, value, out)
    if not believed:
        return False
    v.last.now, v.last.unannounced = now, unannounced
    if not ahead:
        v.last.ordered_at = now
        settle_orders(now, v, m)
    if right and not in_time and last != -inf:
        # The stop of the last proof was to be ordered by now.
        v.last.forced = CYCLE_LATE
        out.value = now - last
    return right


@kernel
def stamp_fault(r: int, now: float, grain: float, v: Watch, m: Motion) -> int:
    """Reason to refuse the stamp of a robot; OK if there is none."""
    stamp = v.stamps[r]
    if not isfinite(stamp):
        return STAMP_MISSING
    if m.robot_figures[r].mode == FIXED:
        return OK
    if stamp < v.last_stamp[r]:
        return TIME_BACKWARDS
    if stamp > now + grain:
        return STAMP_AHEAD
    if now - stamp > m.robot_figures[r].stale + grain:
        return STATE_STALE
    return OK


@kernel
def settle_orders(now: float, v: Watch, m: Motion) -> None:
    """Set the unknown times of earlier orders to this time, which is later."""
    for r in range(v.ordered.shape[0]):
        if v.ordered[r] == inf:
            v.ordered[r] = now
            if v.given.now != v.given.now:
                v.ordered[r] += m.robot_figures[r].sensing


@kernel
def sightings_are_right(v: Watch, m: Motion, out: Header) -> bool:
    """Whether every moving object has a plausible and recent sighting."""
    now = now_of(v)
    latest = now + unannounced_time(v, m) + TIME_GRAIN + TIME_SHARE * abs(now)
    for k in range(v.movers.shape[0]):
        j = v.movers[k]
        seen, sighted = v.seen_at[j], v.sighted_at[j]
        if seen == inf:
            # It is not there.
            continue
        if v.doubt[j] != OK:
            return blame_robot(int(v.doubt[j]), -1, j, out)
        if seen == -inf:
            return blame_robot(OBJECT_UNSEEN, -1, j, out)
        if max(seen, sighted) > latest:
            return blame_robot(OBJECT_AHEAD, -1, j, out)
        if not now - max(seen, sighted) <= v.object_stale[j] + TIME_GRAIN:
            return blame_robot(OBJECT_STALE, -1, j, out)
    return True


@kernel
def sample_is_right(q: Floats, v: Watch, m: Motion, out: Header) -> bool:
    """Whether each joint can have moved as measured since its last sample."""
    for r in range(m.robot_figures.shape[0]):
        robot = m.robot_figures[r]
        if robot.mode == FIXED:
            continue
        interval = interval_of(r, v, m)
        for j in range(robot.first_joint, robot.first_joint + robot.joint_count):
            if not joint_sample_is_right(j, q[j], interval, v, m, out):
                if out.reason == STATE_JUMPED:
                    forget_samples(r, v)
                return False
    return True


@kernel
def joint_sample_is_right(
    j: int, position: float, interval: Interval, v: Watch, m: Motion, out: Header
) -> bool:
    """Whether a joint can have moved as measured since its last sample."""
    figures = m.joint_figures[j]
    top = figures.velocity * (1.0 + SPEED_SHARE)
    if interval.known and interval.time > 0.0:
        way = abs(position - v.sample_q[j, 0])
        if not way <= top * interval.time + 2.0 * figures.position_error:
            return blame_joint(STATE_JUMPED, j, way / interval.time, out)
    if interval.has_velocity:
        speed = v.velocity[j]
        if not isfinite(speed):
            return blame_joint(NOT_FINITE, j, speed, out)
        if not abs(speed) <= top + 3.0 * figures.velocity_error:
            return blame_joint(TOO_FAST, j, speed, out)
    if not fits_its_stamp(j, position, interval, v):
        return blame_joint(STAMP_REPEATED, j, interval.stamp, out)
    reason = contradiction(j, position, interval, v, m)
    if reason != OK:
        return blame_joint(reason, j, v.velocity[j], out)
    return True


@kernel
def velocities_are_known(q: Floats, v: Watch, m: Motion, out: Header) -> bool:
    """Write the bounds of each joint's velocity, and store the sample."""
    for j in range(q.shape[0]):
        r = m.robot_of_joint[j]
        if m.robot_figures[r].mode == FIXED:
            continue
        figures = m.joint_figures[j]
        top = figures.velocity * (1.0 + SPEED_SHARE)
        if v.given.has_velocity != 0:
            speed, error = v.velocity[j], figures.velocity_error
            m.v_low[j], m.v_high[j] = speed - error, speed + error
        elif not estimate_velocity(j, r, q[j], v, m):
            keep_samples(q, v, m)
            return blame_robot(NO_VELOCITY, r, 0.0, out)
        # The declared top speed narrows the bounds, unless they lie beyond it.
        if m.v_low[j] <= figures.velocity and m.v_high[j] >= -figures.velocity:
            m.v_low[j] = max(m.v_low[j], -figures.velocity)
            m.v_high[j] = min(m.v_high[j], figures.velocity)
        slack = 2.0 * figures.velocity_error
        if not (m.v_low[j] <= top + slack and m.v_high[j] >= -top - slack):
            return blame_joint(TOO_FAST, j, 0.5 * (m.v_low[j] + m.v_high[j]), out)
    keep_samples(q, v, m)
    return True


@kernel
def estimate_velocity(j: int, r: int, position: float, v: Watch, m: Motion) -> bool:
    """Bound a joint's velocity by its samples.

    The mean velocity since a sample is known within both position errors. The present
    velocity differs from it by at most half of the greatest acceleration times that
    time. A stop may be harder than any known deceleration; it ends at rest.

    Returns:
        Whether there is an earlier sample.
    """
    figures = m.joint_figures[j]
    fresh = 0 if v.stamps[r] > v.last_stamp[r] else 1
    if v.sample_count[r] <= fresh:
        return False
    hardest = max(figures.acceleration, figures.deceleration_most)
    gain = figures.acceleration if hardest == inf else hardest
    low, high = -inf, inf
    for k in range(fresh, v.sample_count[r]):
        time = v.stamps[r] - v.sample_t[r, k]
        mean = (position - v.sample_q[j, k]) / time
        off = 2.0 * figures.position_error / time + 0.5 * gain * time
        least, most = mean - off, mean + off
        if hardest == inf:
            least, most = min(least, 0.0), max(most, 0.0)
        low, high = max(low, least), min(high, most)
    # Bounds that contradict each other prove a wrong figure: keep the whole range.
    m.v_low[j], m.v_high[j] = min(low, high), max(low, high)
    return True


@kernel
def keep_samples(q: Floats, v: Watch, m: Motion) -> None:
    """Prepend new samples to each robot's history."""
    for j in range(q.shape[0]):
        r = m.robot_of_joint[j]
        if v.stamps[r] > v.last_stamp[r]:
            for k in range(min(v.sample_count[r], HISTORY - 1), 0, -1):
                v.sample_q[j, k] = v.sample_q[j, k - 1]
            v.sample_q[j, 0] = q[j]
            keep_agreement(j, v)
    for r in range(v.stamps.shape[0]):
        if v.stamps[r] > v.last_stamp[r]:
            for k in range(min(v.sample_count[r], HISTORY - 1), 0, -1):
                v.sample_t[r, k] = v.sample_t[r, k - 1]
            v.sample_t[r, 0] = v.stamps[r]
            v.sample_count[r] = min(v.sample_count[r] + 1, HISTORY)
            v.last_stamp[r] = v.stamps[r]


@kernel
def forget_samples(r: int, v: Watch) -> None:
    """Clear a robot's history after a jump, which leaves its velocity unknown."""
    v.sample_count[r] = 0


@kernel
def blame_robot(reason: int, r: int, value: float, out: Header) -> bool:
    """Write the reason of a fault of one robot, or of all; returns False."""
    out.reason = reason
    out.robot = r
    out.value = value
    return False


@kernel
def blame_joint(reason: int, j: int, value: float, out: Header) -> bool:
    """Write the reason of a fault of one joint; returns False."""
    out.reason = reason
    out.joint = j
    out.value = value
    return False
