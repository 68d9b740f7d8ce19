"""Stop of a joint: greatest displacement over time if a stop is ordered after a delay.

Every motion within the declared figures lies between two curves over time. On the upper
one the joint speeds up at its greatest acceleration until the stop takes effect at the
latest, and then brakes at its least deceleration. A joint that moves the other way gets
least far back if it brakes at once at its greatest deceleration. Both are functions of
the measured velocity alone, in closed form.

A phase of full deceleration may have begun already: `passed` is the time since a stop
surely took effect, and shortens the ramp.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel
from armguard.motion.figures import CURVE_POINTS, JointFigures
from armguard.record import record

Floats = NDArray[np.float64]


@record
class JointStop:
    """Stop of a joint in one direction.

    Attributes:
        speed: Speed in this direction now, not negative [rad/s].
        reaction: Time until the stop takes effect at the latest [s].
        acceleration: Greatest acceleration until then [rad/s²].
        top_speed: Speed it cannot exceed [rad/s].
        effect_speed: Speed when the stop takes effect [rad/s].
        effect_way: Displacement until the stop takes effect [rad].
        ramp_left: Time from then on until the deceleration is full [s].
        ramp_share: Share of the deceleration when the stop takes effect [-].
        deceleration: Full deceleration [rad/s²].
        rest_time: Time until it rests [s].
        travel: Displacement until it rests [rad].
        opposite_deceleration: Greatest deceleration of a joint that moves the other
            way, before the stop takes effect [rad/s²].
        opposite_speed: Speed in the other direction; 0 if the joint does not surely
            move that way [rad/s].
        swing: Greatest swing beyond the rest position [rad].
        curvature: Bound on the second derivative of the curve; infinite at a kink
            [rad/s²].
        deceleration_most: Greatest deceleration once the stop has taken effect
            [rad/s²].
        settled: Time until its swing has ended [s].
        swing_back: Greatest displacement by a swing about its rest position, for motion
            in either direction now [rad].
    """

    speed: float
    reaction: float
    acceleration: float
    top_speed: float
    effect_speed: float
    effect_way: float
    ramp_left: float
    ramp_share: float
    deceleration: float
    rest_time: float
    travel: float
    opposite_deceleration: float
    opposite_speed: float
    swing: float
    curvature: float
    deceleration_most: float
    settled: float
    swing_back: float


class Order(NamedTuple):
    """Order to stop a joint, by the controller or the brake.

    Attributes:
        reaction: Time at which the stop takes effect at the latest [s].
        passed: Time since the stop surely took effect [s].
        ramp: Time in which deceleration rises to its full value [s].
        least: Least full deceleration [rad/s²].
        most: Greatest deceleration; may be infinite [rad/s²].
        settled_after: Greatest duration of the swing about its rest [s].
    """

    reaction: float
    passed: float
    ramp: float
    least: float
    most: float
    settled_after: float


@kernel
def plan_stop(
    velocity: float,
    against: float,
    driven: float,
    order: Order,
    figures: JointFigures,
    curve: Floats,
    out: JointStop,
) -> None:
    """Write the stop of a joint in its positive direction.

    Args:
        velocity: Greatest velocity it may have now, of either sign [rad/s].
        against: Greatest speed it may have in the other direction now [rad/s].
        driven: Greatest velocity it may be commanded, of either sign [rad/s].
        order: When and how hard it brakes.
        figures: Its figures; a measured velocity above its top speed counts as
            measured.
        curve: Measured stops, times [s] then displacements [rad], shape
            (2 · CURVE_POINTS,), or empty.
        out: Overwritten.
    """
    reaction, acceleration = order.reaction, figures.acceleration
    least, most, ramp = order.least, order.most, order.ramp
    out.top_speed = max(driven, velocity, 0.0)
    out.reaction = reaction
    out.acceleration = acceleration
    out.deceleration = least
    out.opposite_deceleration = max(acceleration, most)
    out.deceleration_most = most
    soonest = min(velocity + acceleration * reaction, max(driven, velocity))
    backwards = soonest <= 0.0 and velocity < 0.0
    out.opposite_speed = -velocity if backwards else 0.0
    out.speed = max(velocity, 0.0)
    against = max(against, 0.0)
    out.swing_back = swing_back(velocity, against, figures, out)
    # A joint that moves the other way may speed up, and then rests and swings later.
    out.settled = reaction + ramp + (against + acceleration * reaction) / least
    out.settled += order.settled_after
    if backwards:
        # It cannot reverse before the stop takes effect: it only moves back.
        out.effect_speed = out.effect_way = out.travel = out.swing = 0.0
        if curve.shape[0] > 0:
            out.swing_back = -inf
        out.ramp_left = out.ramp_share = 0.0
        out.rest_time = reaction - velocity / least + ramp
        out.curvature = 0.0 if most == inf else out.opposite_deceleration
        return
    plan_braking(figures, order, curve, out)


@kernel
def plan_braking(
    figures: JointFigures, order: Order, curve: Floats, out: JointStop
) -> None:
    """Write the stop of a joint from the order to its rest.

    Args:
        figures: Its figures.
        order: When and how hard it brakes.
        curve: Measured stops as in `plan_stop`.
        out: Its speeds and accelerations are read; times and travels are written.
    """
    reaction, ramp, top = order.reaction, order.ramp, figures.velocity
    acceleration, least = figures.acceleration, order.least
    out.effect_way = accelerated_way(reaction, out)
    out.effect_speed = min(out.speed + acceleration * reaction, out.top_speed)
    out.ramp_left = max(ramp - order.passed, 0.0)
    out.ramp_share = 1.0 - out.ramp_left / ramp if ramp > 0.0 else 1.0
    out.swing = figures.settle * out.effect_speed / top
    out.curvature = max(acceleration, least)
    if curve.shape[0] > 0:
        time, way = curve_at(curve, out.effect_speed / top)
        out.swing = 0.0
        out.swing_back = -inf
        out.rest_time = out.settled = reaction + time
        out.travel = out.effect_way + way
        # Full speed until the displacement is used up bounds every such stop.
        out.deceleration = inf
        out.curvature = inf
        return
    out.rest_time = reaction + rest_time(
        out.effect_speed, out.ramp_left, out.ramp_share, least
    )
    out.travel = out.effect_way + braked_way(out.rest_time - reaction, out)
    out.settled = max(out.settled, out.rest_time + order.settled_after)


@kernel
def swing_back(
    velocity: float, against: float, figures: JointFigures, out: JointStop
) -> float:
    """Displacement to which a joint that moves the other way may swing back.

    It swings about its rest in proportion to the speed at which its stop begins. So the
    worst stop begins at once, or later from a greater speed if the swing grows more
    than the distance until then. The distance to rest is at least that of the hardest
    braking.

    Args:
        velocity: Greatest velocity it may have now, of either sign [rad/s].
        against: Greatest speed it may have in the other direction now [rad/s].
        figures: Its figures.
        out: The joint's stop; reaction and greatest accelerations are read.

    Returns:
        Displacement; negative if its distance to rest exceeds its swing [rad].
    """
    slowest = max(-velocity, 0.0)
    way = 0.5 * slowest * slowest / out.opposite_deceleration if slowest > 0.0 else 0.0
    gain, speed = out.acceleration * out.reaction, against
    share, longer = figures.swing_share, 0.0
    if gain > 0.0:
        # A brake has no greatest deceleration.
        braked = out.deceleration_most == inf
        cost = figures.speed_up_way if braked else figures.return_way
        speed = min(max(against, share / cost), against + gain)
        longer = 0.5 * (speed * speed - against * against) * cost
    return float(share * speed - longer - way)


@kernel
def whole_way(stop: JointStop) -> float:
    """Greatest displacement in the planned direction, swing included [rad]."""
    return float(max(stop.travel + stop.swing, stop.swing_back))


@kernel
def farthest(t: float, stop: JointStop) -> float:
    """Greatest displacement in the planned direction at a time, without the swing.

    Args:
        t: Time from the measurement on [s].
        stop: Written by `plan_stop`.

    Returns:
        Displacement; negative for a joint that surely moves the other way [rad].
    """
    if stop.opposite_speed > 0.0:
        return float(-least_way(t, stop))
    if t <= stop.reaction:
        return float(accelerated_way(t, stop))
    since = min(t, stop.rest_time) - stop.reaction
    if stop.deceleration == inf:
        return float(min(stop.effect_way + stop.effect_speed * since, stop.travel))
    return float(stop.effect_way + braked_way(since, stop))


@kernel
def rest_way(stop: JointStop) -> float:
    """Greatest displacement once the joint rests, without the swing [rad]."""
    if stop.opposite_speed > 0.0 or stop.deceleration == inf:
        return farthest(inf, stop)
    return float(stop.travel)


@kernel
def swing_within(
    start: float, end: float, first: float, last: float, stop: JointStop
) -> tuple[float, float]:
    """Addition of the swing to the greatest displacement in an interval [rad].

    A swing back, or one in progress, leads no farther than `swing_back`: a straight
    line that reaches it at both ends of the interval also reaches it in between.

    Args:
        start: Start of the interval, from the measurement on [s].
        end: End of the interval [s].
        first: Greatest displacement at the start, without the swing [rad].
        last: Greatest displacement at the end, without the swing [rad].
        stop: Written by `plan_stop`.

    Returns:
        The additions at the start and at the end [rad].
    """
    if start >= stop.settled:
        return (0.0, 0.0)
    onward, bounce = onward_swing(start, end, first, last, stop), stop.swing_back
    return (max(onward, bounce - first), max(onward, bounce - last))


@kernel
def onward_swing(
    start: float, end: float, first: float, last: float, stop: JointStop
) -> float:
    """Addition of a swing in the direction of the motion in an interval [rad].

    A joint that brakes harder rests earlier, and then swings. But it rests so much
    nearer that its swing stays below the greatest displacement, except at the start of
    a stop and towards its end. A joint at rest by a time has moved no farther than at
    half its speed until then plus half the ramp. The difference to that is a concave
    function of time, so both ends of the interval suffice.
    """
    swing = stop.swing
    if swing == 0.0 or start < stop.reaction or end > stop.rest_time:
        return float(swing)
    for k in range(2):
        since = (start if k == 0 else end) - stop.reaction
        nearer = stop.effect_way + 0.5 * stop.effect_speed * (since + stop.ramp_left)
        if not (first if k == 0 else last) >= nearer + swing:
            return float(swing)
    return 0.0


@kernel
def least_way(t: float, stop: JointStop) -> float:
    """Least distance of a joint that moves the other way, at hardest braking [rad]."""
    v, hard = stop.opposite_speed, stop.opposite_deceleration
    if hard == inf:
        return 0.0
    free = min(t, stop.reaction)
    if v <= hard * free:
        return float(0.5 * v * v / hard)
    way = free * (v - 0.5 * hard * free)
    v -= hard * free
    left = min(t - free, v / stop.deceleration_most)
    return float(way + left * (v - 0.5 * stop.deceleration_most * left))


@kernel
def accelerated_way(t: float, stop: JointStop) -> float:
    """Distance of a joint that speeds up until its top speed [rad]."""
    v, a, top = stop.speed, stop.acceleration, stop.top_speed
    gain = top - v
    if a * t <= gain:
        return float(t * (v + 0.5 * a * t))
    until = gain / a
    return float(until * (v + 0.5 * gain) + (t - until) * top)


@kernel
def braked_way(since: float, stop: JointStop) -> float:
    """Distance from the moment the stop takes effect, at most until rest [rad]."""
    v, d = stop.effect_speed, stop.deceleration
    ramp, share = stop.ramp_left, stop.ramp_share
    rising = min(since, ramp)
    way = rising * v
    if rising > 0.0:
        # Deceleration d · (share + (1 - share) · s / ramp).
        way -= d * rising * rising * (0.5 * share + (1.0 - share) * rising / ramp / 6.0)
    if since > ramp:
        v -= 0.5 * d * ramp * (1.0 + share)
        after = since - ramp
        way += after * (v - 0.5 * d * after)
    return float(way)


@kernel
def rest_time(v: float, ramp: float, share: float, d: float) -> float:
    """Time from the moment the stop takes effect until rest [s]."""
    lost = 0.5 * d * ramp * (1.0 + share)
    if v > lost:
        return float(ramp + (v - lost) / d)
    if not v > 0.0:
        return 0.0
    # d · (share · s + (1 - share) · s² / (2 · ramp)) = v
    b = d * share
    a = 0.5 * d * (1.0 - share) / ramp
    return float(2.0 * v / (b + sqrt(b * b + 4.0 * a * v)))


@kernel
def curve_at(curve: Floats, share: float) -> tuple[float, float]:
    """Time [s] and distance [rad] of a measured stop from a share of the top speed.

    Beyond the top speed the time grows with the speed, the distance with its square.
    """
    over = max(share, 1.0)
    place = share / over * (CURVE_POINTS - 1)
    k = min(int(place), CURVE_POINTS - 2)
    part = place - k
    time = curve[k] + part * (curve[k + 1] - curve[k])
    way = curve[CURVE_POINTS + k]
    way += part * (curve[CURVE_POINTS + k + 1] - way)
    return (time * over, way * over * over)


@kernel
def speed_lost(since: float, ramp: float, d: float) -> float:
    """Least speed lost by a stop that surely took effect some time ago [rad/s].

    Args:
        since: Time since it took effect [s].
        ramp: Time in which deceleration rises to its full value [s].
        d: Least full deceleration [rad/s²].
    """
    if since <= 0.0:
        return 0.0
    rising = min(since, ramp)
    lost = d * (since - rising)
    if rising > 0.0:
        lost += 0.5 * d * rising * rising / ramp
    return float(lost)
