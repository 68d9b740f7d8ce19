"""Bounds of the displacement and speed of primitives, by the twists of their bodies.

The levers of `Chains` hold in every configuration, and their sum leaves out that joints
may work against one another. About the measured configuration a tighter bound follows
from a twist. Let Δ_k = μ_k ± w_k be the displacement of joint k. A point p of a body
moves by

    Σ Δ_k u_k(p) + terms of higher order,    u_k = axis_k x (p - origin_k),

and Σ μ_k u_k(p) = t + φ x p is the motion of one rigid body: its twist (φ, t). Over a
ball with centre c and radius r round the primitive the motion is thus at most

    |t + φ x c| + r |φ| + Σ w_k min(lever_k, |u_k(c)| + r) + higher order.

The derivatives of a point by several joints are no longer than the lever about the
outermost of them (see `gap_bound`), which bounds the terms of higher order. Of two
bodies the difference of their twists counts, so motion common to both is left out.

For long motions a third bound is tighter: about the middles of the joints' ranges,
where displacements are ± w_k and half as large. A ball moves as its centre does,
whatever its rotation. So two balls that are a gap apart there, in a direction n, stay
apart by

    gap - Σ w_k |n · u_k| + higher order, of both sides.
"""

from math import sqrt

from armguard.geometry.vec3 import Vec3, add, cross, dot, norm, scaled, sub
from armguard.kernel import kernel
from armguard.motion.state import NEXT, Motion
from armguard.motion.stop_path import write_axis
from armguard.robot.kinematics import FIXED as NO_JOINT
from armguard.robot.kinematics import REVOLUTE, forward_kinematics
from armguard.table import IntVector, Matrix, Vector

# Blocks of `Motion.twists` and rows of `Motion.loose`.
TRAVEL = 0  # on the path of the plan NEXT
SPEED = 1  # now


@kernel(separate=True)
def bound_twists(boxes: Matrix, bodies: IntVector, m: Motion) -> None:
    """Write the twist of each body, and the ball and bounds of each primitive.

    Args:
        boxes: Bounding boxes of the primitives, shape (p, 6) [m].
        bodies: Body of each primitive, shape (p,); the moving ones are first.
        m: The prediction; its axes and plans are written already.
    """
    m.effort.at_middle = 0
    for b in range(m.parent.shape[0]):
        write_twists(b, m)
    for i in range(m.reach.shape[1]):
        ball = m.balls[i]
        square = 0.0
        for k in range(3):
            half = 0.5 * (boxes[i, k + 3] - boxes[i, k])
            ball.centre[k] = boxes[i, k] + half
            square += half * half
        ball.radius = sqrt(square)
        write_loose(i, bodies[i], m)


@kernel(separate=True)
def place_at_middle(bodies: IntVector, T_world: Matrix, m: Motion) -> None:
    """Place axes and balls at the middles of the joints' ranges of the plan NEXT.

    Args:
        bodies: Body of each primitive, shape (p,); the moving ones are first.
        T_world: Measured poses of the bodies, shape (b, 12).
        m: The prediction; its balls are written already.
    """
    m.effort.at_middle = 1
    for j in range(m.q.shape[0]):
        m.q_node[j] = m.q[j]
    for b in range(m.parent.shape[0]):
        if m.joint_kind[b] != NO_JOINT and m.gain[b, 0] != 0.0:
            j = m.q_index[b]
            m.q_node[j] = m.q[j] + m.middle[NEXT, b] / m.gain[b, 0]
    forward_kinematics(
        m.q_node,
        m.parent,
        m.joint_kind,
        m.q_index,
        m.gain,
        m.T_parent_joint,
        m.axis,
        m.middle_T,
    )
    for b in range(m.parent.shape[0]):
        write_axis(m.middle_T[b], m.axis[b], m.middle_axes[b])
    for i in range(m.reach.shape[1]):
        b = bodies[i]
        carry(m.balls[i].centre, T_world[b], m.middle_T[b], m.middle_balls[i])


@kernel
def carry(p: Vector, before: Vector, after: Vector, out: Vector) -> None:
    """Carry a point along with a body from one pose to another, shape (3,) [m]."""
    x, y, z = p[0] - before[3], p[1] - before[7], p[2] - before[11]
    a = before[0] * x + before[4] * y + before[8] * z
    b = before[1] * x + before[5] * y + before[9] * z
    c = before[2] * x + before[6] * y + before[10] * z
    for k in range(3):
        row = 4 * k
        out[k] = (
            after[row] * a + after[row + 1] * b + after[row + 2] * c + after[row + 3]
        )


@kernel
def middle_gap(
    i: int,
    j: int,
    body_i: int,
    body_j: int,
    shared: int,
    boxes: Matrix,
    m: Motion,
) -> float:
    """Lower bound of a pair's distance on the path of NEXT, about its middle [m].

    Args:
        i: A moving primitive.
        j: Another primitive, which may be static.
        body_i: Body of the first.
        body_j: Body of the second, -1 if it is static.
        shared: Number of joints that move both alike.
        boxes: Bounding boxes of the primitives, shape (p, 6) [m].
        m: The prediction.

    Returns:
        The bound; not positive where balls show nothing.
    """
    c = m.middle_balls[i]
    p = (c[0], c[1], c[2])
    moves = j < m.loose.shape[1]
    if moves:
        c = m.middle_balls[j]
        way = sub((c[0], c[1], c[2]), p)
    else:
        box = boxes[j]
        way = (
            min(max(p[0], box[0]), box[3]) - p[0],
            min(max(p[1], box[1]), box[4]) - p[1],
            min(max(p[2], box[2]), box[5]) - p[2],
        )
    distance = norm(way)
    if not distance > 0.0:
        return 0.0
    n = scaled(1.0 / distance, way)
    gap = distance - m.balls[i].radius - deviation(i, n, shared, body_i, m)
    if moves:
        gap -= m.balls[j].radius + deviation(j, n, shared, body_j, m)
    return float(gap)


@kernel
def deviation(i: int, n: Vec3, first: int, body: int, m: Motion) -> float:
    """Greatest way of a ball's centre along a direction from the middles [m].

    Args:
        i: The primitive in the ball.
        n: Unit direction, or its opposite.
        first: First joint that counts.
        body: Body of the primitive.
        m: The prediction.
    """
    c = m.middle_balls[i]
    way = turned = 0.0
    for k in range(first, m.length[body]):
        b = m.joints[body, k]
        size, row = m.width[NEXT, b], m.middle_axes[b]
        u = (row[0], row[1], row[2])
        if m.joint_kind[b] == REVOLUTE:
            u = cross(u, (c[0] - row[3], c[1] - row[4], c[2] - row[5]))
            more = turned + size
            way += higher_orders(turned, more, m.levers[i, k])
            turned = more
        else:
            way += size * turned * (1.0 + 0.5 * turned)
        way += size * abs(dot(n, u))
    return way


@kernel
def higher_orders(before: float, after: float, lever: float) -> float:
    """Bound of the terms of second and third order whose outermost joint turns [m].

    Args:
        before: Sum of the angles of the joints before it [rad].
        after: That sum and its own angle [rad].
        lever: Its lever [m].
    """
    second = 0.5 * (after * after - before * before)
    third = (after * after * after - before * before * before) / 6.0
    return lever * (second + third)


@kernel
def write_twists(b: int, m: Motion) -> None:
    """Write the twists of a body at the middles of its joints' ranges."""
    bodies, above = m.parent.shape[0], m.parent[b]
    for block in range(2):
        row = m.twists[block * bodies + b]
        for k in range(6):
            row[k] = 0.0 if above < 0 else m.twists[block * bodies + above, k]
    if m.joint_kind[b] == NO_JOINT:
        return
    axis, origin = m.axes[b, 0:3], m.axes[b, 3:6]
    d = (axis[0], axis[1], axis[2])
    arm = cross((origin[0], origin[1], origin[2]), d)
    for block in range(2):
        middle, _ = joint_range(block, b, m)
        row = m.twists[block * bodies + b]
        for k in range(3):
            if m.joint_kind[b] == REVOLUTE:
                row[k] += middle * d[k]
                row[k + 3] += middle * arm[k]
            else:
                row[k + 3] += middle * d[k]


@kernel
def joint_range(block: int, b: int, m: Motion) -> tuple[float, float]:
    """Middle of the range of a body's joint, and its greatest deviation from it.

    Args:
        block: TRAVEL or SPEED.
        b: The body.
        m: The prediction.
    """
    if block == TRAVEL:
        return (m.middle[NEXT, b], m.width[NEXT, b])
    if m.speed[b] == 0.0:
        return (0.0, 0.0)
    j, gain = m.q_index[b], m.gain[b, 0]
    low, high = m.v_low[j], m.v_high[j]
    return (0.5 * gain * (low + high), 0.5 * abs(gain) * (high - low))


@kernel
def write_loose(i: int, body: int, m: Motion) -> None:
    """Write what may add to the twists of a primitive: deviations, higher orders."""
    centre, radius = m.balls[i].centre, m.balls[i].radius
    travel = speed = turned = 0.0
    for k in range(m.length[body]):
        b = m.joints[body, k]
        lever = m.levers[i, k]
        size = m.spread[NEXT, b]
        near = lever
        if m.joint_kind[b] == REVOLUTE:
            axis = m.axes[b]
            arm = (centre[0] - axis[3], centre[1] - axis[4], centre[2] - axis[5])
            u = cross((axis[0], axis[1], axis[2]), arm)
            near = min(lever, norm(u) + radius)
            more = turned + size
            travel += higher_orders(turned, more, lever)
            turned = more
        else:
            travel += size * turned * (1.0 + 0.5 * turned)
        travel += joint_range(TRAVEL, b, m)[1] * near
        speed += joint_range(SPEED, b, m)[1] * near
    m.loose[TRAVEL, i], m.loose[SPEED, i] = travel, speed


@kernel
def own_bound(block: int, i: int, body: int, m: Motion) -> tuple[float, Vec3, Vec3]:
    """Bounds of the displacement or speed of a primitive's points [m or m/s].

    Args:
        block: TRAVEL or SPEED.
        i: The primitive.
        body: Its body.
        m: The prediction.

    Returns:
        The greatest size; the motion of the centre of its ball, and how far that of any
        of its points may differ, along each axis of the world.
    """
    turn, shift = twist_at(block, i, body, m)
    radius, loose = m.balls[i].radius, m.loose[block, i]
    x, y, z = turn[0] * turn[0], turn[1] * turn[1], turn[2] * turn[2]
    more = (
        radius * sqrt(y + z) + loose,
        radius * sqrt(z + x) + loose,
        radius * sqrt(x + y) + loose,
    )
    return (norm(shift) + radius * sqrt(x + y + z) + loose, shift, more)


@kernel
def relative_bound(
    block: int, i: int, j: int, body_i: int, body_j: int, shared: int, m: Motion
) -> float:
    """Bound of the relative displacement or speed of two primitives [m or m/s].

    Args:
        block: TRAVEL or SPEED.
        i: First primitive.
        j: Second primitive.
        body_i: Body of the first.
        body_j: Body of the second.
        shared: Number of joints that move both alike.
        m: The prediction.
    """
    turn_i, shift_i = twist_at(block, i, body_i, m)
    turn_j, shift_j = twist_at(block, j, body_j, m)
    if shared > 0:
        common = m.joints[body_i, shared - 1]
        turn, shift = twist_at(block, i, common, m)
        turn_i, shift_i = sub(turn_i, turn), sub(shift_i, shift)
        turn, shift = twist_at(block, j, common, m)
        turn_j, shift_j = sub(turn_j, turn), sub(shift_j, shift)
    return float(
        norm(sub(shift_i, shift_j))
        + m.balls[i].radius * norm(turn_i)
        + m.balls[j].radius * norm(turn_j)
        + m.loose[block, i]
        + m.loose[block, j]
    )


@kernel
def bound_along(
    block: int,
    n: Vec3,
    i: int,
    j: int,
    body_i: int,
    body_j: int,
    shared: int,
    m: Motion,
) -> float:
    """Bound of how far or fast two primitives approach along a direction [m or m/s].

    Args:
        block: TRAVEL or SPEED.
        n: Unit direction, from i to j.
        i: A moving primitive.
        j: Another primitive, which may be static.
        body_i: Body of the first.
        body_j: Body of the second, -1 if it is static.
        shared: Number of joints that move both alike.
        m: The prediction.
    """
    turn_i, shift_i = twist_at(block, i, body_i, m)
    if shared > 0:
        turn, shift = twist_at(block, i, m.joints[body_i, shared - 1], m)
        turn_i, shift_i = sub(turn_i, turn), sub(shift_i, shift)
    found = dot(n, shift_i) + m.loose[block, i]
    found += m.balls[i].radius * norm(cross(n, turn_i))
    if j >= m.loose.shape[1]:
        return float(found)
    turn_j, shift_j = twist_at(block, j, body_j, m)
    if shared > 0:
        turn, shift = twist_at(block, j, m.joints[body_j, shared - 1], m)
        turn_j, shift_j = sub(turn_j, turn), sub(shift_j, shift)
    found += m.balls[j].radius * norm(cross(n, turn_j))
    return float(found - dot(n, shift_j) + m.loose[block, j])


@kernel
def twist_at(block: int, i: int, body: int, m: Motion) -> tuple[Vec3, Vec3]:
    """Twist of a body: its rotation, and the motion of the centre of a ball."""
    row, ball = m.twists[block * m.parent.shape[0] + body], m.balls[i].centre
    turn = (row[0], row[1], row[2])
    swing = cross(turn, (ball[0], ball[1], ball[2]))
    return (turn, add((row[3], row[4], row[5]), swing))
