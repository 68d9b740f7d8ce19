"""Stop path: ranges of all joint positions from the measurement until rest.

All robots brake on one clock, whose zero is now. A robot was measured its own age
before that.
"""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel
from armguard.motion.joint_stop import (
    JointStop,
    Order,
    farthest,
    plan_stop,
    swing_within,
    whole_way,
)
from armguard.motion.state import (
    NEXT,
    NODES,
    Motion,
)
from armguard.record import clear
from armguard.robot.kinematics import FIXED as NO_JOINT
from armguard.robot.kinematics import forward_kinematics
from armguard.table import IntVector, Matrix, Vector

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@kernel(separate=True)
def plan_stops(plan: int, m: Motion) -> None:
    """Predict the stop of every joint, and bound its whole displacement.

    Args:
        plan: NEXT or NOW; NEXT must be first, its horizon is that of both.
        m: The prediction: figures, measured state and clocks are read, the rest is
            written.
    """
    n = m.q.shape[0]
    horizon = settled = 0.0
    for j in range(n):
        rest = plan_joint(plan, j, m)
        horizon = max(horizon, rest)
        r = m.robot_of_joint[j]
        if rest > 0.0 or m.clock[plan * m.robot_figures.shape[0] + r].swings != 0:
            settled = max(settled, max(rest, 0.0) + m.robot_figures[r].settle_time)
    if plan == NEXT:
        m.effort.stamp += 1
        m.span.horizon = horizon
        m.span.settled = max(horizon, settled)
    middle, width, spread = m.middle[plan], m.width[plan], m.spread[plan]
    for b in range(m.parent.shape[0]):
        middle[b] = width[b] = spread[b] = 0.0
        if m.joint_kind[b] == NO_JOINT:
            continue
        j = m.q_index[b]
        up, down = m.up[plan * n + j], m.down[plan * n + j]
        error = error_of(j, m)
        gain = m.gain[b, 0]
        farthest_up = gain * (error + whole_way(up))
        farthest_down = -gain * (error + whole_way(down))
        middle[b] = 0.5 * (farthest_up + farthest_down)
        width[b] = 0.5 * abs(farthest_up - farthest_down)
        spread[b] = abs(middle[b]) + width[b]


@kernel
def plan_joint(plan: int, j: int, m: Motion) -> float:
    """Plan one joint's stop in both directions.

    Returns:
        Time from now until it rests [s].
    """
    r, n = m.robot_of_joint[j], m.q.shape[0]
    figures, robot = m.joint_figures[j], m.robot_figures[r]
    clock = m.clock[plan * m.robot_figures.shape[0] + r]
    up, down = m.up[plan * n + j], m.down[plan * n + j]
    if clock.still != 0:
        clear(up)
        clear(down)
        return 0.0
    points = m.curves.shape[1] if figures.curve != 0.0 else 0
    brakes = clock.braking != 0
    if brakes:
        points = 0
    order = Order(
        reaction=clock.reaction,
        passed=clock.passed,
        ramp=0.0 if brakes else robot.ramp,
        least=figures.brake_deceleration if brakes else figures.deceleration,
        most=inf if brakes else figures.deceleration_most,
        settled_after=robot.settle_time,
    )
    high, low = m.v_high[j], -m.v_low[j]
    driven, curve = m.driven[plan * n + j], m.curves[j, :points]
    plan_stop(high, low, driven[0], order, figures, curve, up)
    plan_stop(low, high, driven[1], order, figures, curve, down)
    if clock.swings != 0 and points == 0:
        # The speed at the start of the stop is not measured any more but remembered.
        for side in range(2):
            stop = up if side == 0 else down
            swing = m.swings[j].swing
            if stop.opposite_speed == 0.0:
                stop.swing = swing
            # It may swing already, from one side of its rest to the other, but never
            # beyond the proven positions of the stop.
            beyond = m.swings[j].highest - m.q[j]
            if side == 1:
                beyond = m.q[j] - m.swings[j].lowest
            stop.swing_back = max(min(2.0 * swing, beyond), 0.0)
            rest = max(up.rest_time, down.rest_time, 0.0)
            stop.settled = rest + robot.settle_time
    return float(max(up.rest_time, down.rest_time) - clock.age)


@kernel
def error_of(j: int, m: Motion) -> float:
    """Greatest error of a joint's position; 0 if its motion is left out."""
    still = m.clock[m.robot_of_joint[j]].still != 0
    return 0.0 if still else float(m.joint_figures[j].position_error)


@kernel(separate=True)
def write_axes(T_world: Matrix, m: Motion) -> None:
    """Write the axes of all joints at their measured positions.

    Args:
        T_world: Poses of all bodies, shape (b, 12).
        m: The prediction.
    """
    for b in range(m.parent.shape[0]):
        write_axis(T_world[b], m.axis[b], m.axes[b])


@kernel(separate=True)
def plan_segment(first: Vector, last: Vector, m: Motion) -> None:
    """Set the path of both plans to a straight line in joint space.

    Args:
        first: Joint positions at its start, shape (n,) [rad or m].
        last: Joint positions at its end, shape (n,) [rad or m].
        m: The prediction.
    """
    n = m.q.shape[0]
    m.effort.stamp += 1
    m.effort.tests = 0
    m.span.segment = 1
    m.span.horizon = m.span.settled = 0.0
    for j in range(n):
        m.q[j] = 0.5 * (first[j] + last[j])
        m.q_half[j] = 0.5 * (last[j] - first[j])
    for b in range(m.parent.shape[0]):
        size = 0.0
        if m.joint_kind[b] != NO_JOINT:
            size = abs(m.gain[b, 0] * m.q_half[m.q_index[b]])
        m.speed[b] = 0.0
        for plan in range(2):
            m.middle[plan, b] = 0.0
            m.width[plan, b] = m.spread[plan, b] = size


@kernel
def measured_speeds(m: Motion) -> None:
    """Write the greatest speed each body's joint may have now."""
    for b in range(m.parent.shape[0]):
        m.speed[b] = 0.0
        if m.joint_kind[b] != NO_JOINT:
            j = m.q_index[b]
            if m.clock[m.robot_of_joint[j]].still == 0:
                fastest = max(abs(m.v_low[j]), abs(m.v_high[j]))
                m.speed[b] = abs(m.gain[b, 0]) * fastest


@kernel(separate=True)
def bound_reaches(plan: int, ridden: IntVector, m: Motion) -> None:
    """Bound the displacement and the speed of every moving primitive's points.

    Args:
        plan: NEXT or NOW.
        ridden: Body of each primitive, shape (p,); the moving ones are first.
        m: The prediction.
    """
    count = m.reach.shape[1]
    for i in range(count):
        chain, levers = m.joints[ridden[i]], m.levers[i]
        way = rate = 0.0
        for k in range(m.length[ridden[i]]):
            way += m.spread[plan, chain[k]] * levers[k]
            rate += m.speed[chain[k]] * levers[k]
        m.reach[plan, i] = way
        m.rate[i] = rate


@kernel
def write_axis(T: Floats, axis: Floats, out: Floats) -> None:
    """Write a joint's axis in the world, direction and a point of it, shape (6,)."""
    for r in range(3):
        out[r] = T[4 * r] * axis[0] + T[4 * r + 1] * axis[1] + T[4 * r + 2] * axis[2]
        out[r + 3] = T[4 * r + 3]


@kernel(separate=True)
def make_node(plan: int, node: int, m: Motion) -> None:
    """Write an interval of the stop path, once per cycle.

    Within it each joint's position is `middle + u · way ± (wide + u · grow)` for one u
    in [-1, 1] that is common to all joints.
    """
    at = plan * NODES + node
    if m.node_stamp[at] == m.effort.stamp:
        return
    m.node_stamp[at] = m.effort.stamp
    start, end = span_of(node, m.span.horizon)
    bodies = m.parent.shape[0]
    way, wide, grow = m.node_way[at], m.node_wide[at], m.node_grow[at]
    if m.span.segment != 0:
        start, end = span_of(node, 1.0)
    for j in range(m.q.shape[0]):
        if m.span.segment != 0:
            middle = m.q_half[j] * (start + end - 1.0)
            half, first, last = m.q_half[j] * (end - start), 0.0, 0.0
        else:
            middle, half, first, last = joint_span(plan, j, start, end, m)
        m.q_node[j] = m.node_q[at, j] = m.q[j] + middle
        m.q_way[j] = half
        m.q_wide[j], m.q_grow[j] = 0.5 * (first + last), 0.5 * (last - first)
    for b in range(bodies):
        way[b] = wide[b] = grow[b] = 0.0
        if m.joint_kind[b] != NO_JOINT:
            j, gain = m.q_index[b], m.gain[b, 0]
            way[b] = gain * m.q_way[j]
            wide[b], grow[b] = abs(gain) * m.q_wide[j], abs(gain) * m.q_grow[j]
    T = m.node_T[at * bodies : (at + 1) * bodies]
    forward_kinematics(
        m.q_node,
        m.parent,
        m.joint_kind,
        m.q_index,
        m.gain,
        m.T_parent_joint,
        m.axis,
        T,
    )
    for b in range(bodies):
        write_axis(T[b], m.axis[b], m.node_axes[at * bodies + b])


@kernel
def span_of(node: int, horizon: float) -> tuple[float, float]:
    """Start and end of a node's interval [s]."""
    level = 0
    while (2 << level) <= node:
        level += 1
    first = 1 << level
    return (horizon * (node - first) / first, horizon * (node - first + 1) / first)


@kernel
def joint_span(
    plan: int, j: int, start: float, end: float, m: Motion
) -> tuple[float, float, float, float]:
    """Range of a joint's positions in an interval, relative to the measured one.

    Args:
        plan: NEXT or NOW.
        j: The joint.
        start: Start of the interval, from now on [s].
        end: End of the interval, from now on [s].
        m: Planned stops.

    Returns:
        Middle of the straight line from the middle position at the start to that at
        the end; half of its length, signed; greatest deviation from the line at the
        start, and at the end [rad].
    """
    n, robots = m.q.shape[0], m.robot_figures.shape[0]
    up, down = m.up[plan * n + j], m.down[plan * n + j]
    age = m.clock[plan * robots + m.robot_of_joint[j]].age
    start += age
    end += age
    high_0, high_1 = farthest(start, up), farthest(end, up)
    low_0, low_1 = -farthest(start, down), -farthest(end, down)
    swing_up = swing_within(start, end, high_0, high_1, up)
    swing_down = swing_within(start, end, -low_0, -low_1, down)
    # A curve deviates from its chord by at most an eighth of its second derivative
    # times the square of the interval; a monotonic one by at most its rise.
    eighth = 0.125 * (end - start) * (end - start)
    above = min(curve_bow(start, up) * eighth, abs(high_1 - high_0))
    below = min(curve_bow(start, down) * eighth, abs(low_1 - low_0))
    high_0, high_1 = high_0 + swing_up[0] + above, high_1 + swing_up[1] + above
    low_0, low_1 = low_0 - swing_down[0] - below, low_1 - swing_down[1] - below
    first, last = 0.5 * (high_0 + low_0), 0.5 * (high_1 + low_1)
    error = error_of(j, m)
    return (
        0.5 * (first + last),
        0.5 * (last - first),
        0.5 * (high_0 - low_0) + error,
        0.5 * (high_1 - low_1) + error,
    )


@kernel
def curve_bow(start: float, stop: JointStop) -> float:
    """Bound on the second derivative of one side of a stop from a time on [rad/s²]."""
    if stop.opposite_speed > 0.0 and stop.opposite_deceleration == inf:
        return 0.0
    if stop.opposite_speed == 0.0 and start >= stop.reaction and stop.curvature != inf:
        return float(stop.deceleration)
    return float(stop.curvature)
