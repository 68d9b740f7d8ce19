"""Prediction of an escape motion: least gap between an arm and approaching obstacles.

A command takes effect after the delays of the robot. Then its joints accelerate as
declared, all in the same time, to the velocities of the motion. They go on for a while,
brake to rest and stay, within their limits. An obstacle moves on straight at its
observed velocity. All other bodies are static. This is a prediction, not a proof: the
proof may still slow the robot where the motion passes other bodies closely.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.needs import time_since
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import NEXT, Motion
from armguard.respond.escape_others import meets_others
from armguard.respond.escape_state import Approaching, Escape
from armguard.respond.state import Response
from armguard.robot.kinematics import forward_kinematics

Floats = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)

# Gap beyond the required separation that is enough, and gap below which an obstacle
# counts as near [m].
ENOUGH = 0.06
NEAR = 0.03

# Gap at which the obstacle counts as touching the arm [m].
TOUCHED = -4e-3

# Time after which newer frames correct a velocity, so that its error grows no more [s].
CORRECTED = 0.25

# Value of a motion on which an obstacle touches the arm, at the end of the horizon and
# at once: less than any other value [m].
HIT, HIT_AT_ONCE = -0.1, -0.2

# Least time step of the prediction [s], and greatest number of steps.
STEP, STEPS = 0.02, 48

# Share of the speed bound of an arm's points that counts as approach: all joints rarely
# move the farthest point straight to the obstacle [-].
APPROACHES = 0.5

# Configurations of a motion that are checked against other bodies.
POSTURES = 4

# Distance from its limit at which a joint is predicted to stop, beyond position errors
# [rad or m].
LIMIT_ROOM = 2e-3


@kernel(separate=True)
def judge_way(
    r: int, go: float, bound: float, looks: int, a: Response, w: Workspace
) -> float:
    """Value of a robot's escape motion in `trial`: least gap to approaching obstacles.

    Args:
        r: The robot; `own`, `approaching` and `others` are already its primitives.
        go: Time for which the motion goes on before the joints brake [s].
        bound: Value below which the search may end early [m].
        looks: Whether other bodies may also stop the motion.
        a: The responses.
        w: The workspace.

    Returns:
        The least gap beyond the required separation, at most ENOUGH [m]; if an obstacle
        touches the arm, a number of at most HIT.
    """
    v, m = w.watch, w.motion
    e = a.escape
    plan_way(r, go, e, w, v, m)
    worth = least_gap(r, bound, e, w, v, m)
    if looks == 0 or worth < bound:
        return worth
    halt = free_until(r, e, w, v, m)
    if halt == inf:
        return worth
    e.plan.halt_at = halt
    return least_gap(r, bound, e, w, v, m)


@kernel
def plan_way(r: int, go: float, e: Escape, w: Workspace, v: Watch, m: Motion) -> None:
    """Write the times and the greatest closing speed of the motion in `trial`."""
    plan = e.plan
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    rise = fall = 0.0
    for j in range(first, end):
        figures = m.joint_figures[j]
        rise = max(rise, abs(e.trial[j] - v.commanded[j]) / figures.acceleration)
        fall = max(fall, abs(e.trial[j]) / figures.deceleration)
    plan.delay = m.clock[NEXT * m.robot_figures.shape[0] + r].reaction
    plan.rise = rise
    plan.brake_at = max(go, rise)
    plan.fall = fall
    plan.halt_at = inf
    fastest = 0.0
    for k in range(plan.own_count):
        i = e.own[k]
        body = w.bodies[i]
        rate = 0.0
        for c in range(m.length[body]):
            b = m.joints[body, c]
            j = m.q_index[b]
            speed = max(abs(e.trial[j]), abs(v.commanded[j]))
            rate += abs(m.gain[b, 0]) * speed * m.levers[i, c]
        fastest = max(fastest, rate)
    coming = 0.0
    for c in range(plan.approaching_count):
        coming = max(coming, speed_of(e.approaching[c]))
    plan.closing_speed = APPROACHES * fastest + coming


@kernel
def speed_of(obstacle: Approaching) -> float:
    """Observed speed of an approaching obstacle [m/s]."""
    x, y, z = obstacle.velocity[0], obstacle.velocity[1], obstacle.velocity[2]
    return sqrt(x * x + y * y + z * z)


@kernel
def stand_on_way(
    r: int, time: float, e: Escape, w: Workspace, v: Watch, m: Motion
) -> None:
    """Place a robot's primitives where its motion leads until a time [s]."""
    plan = e.plan
    t = min(time, plan.halt_at)
    rise, go, fall = plan.rise, plan.brake_at, plan.fall
    early = min(t, plan.delay)
    on = t - early
    rising = min(on, rise)
    going = min(max(on - rise, 0.0), go - rise)
    falling = min(max(on - go, 0.0), fall)
    part = 0.5 * rising * rising / rise if rise > 0.0 else 0.0
    whole = going + falling - (0.5 * falling * falling / fall if fall > 0.0 else 0.0)
    for j in range(e.q.shape[0]):
        e.q[j] = m.q[j]
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        last, next_ = v.commanded[j], e.trial[j]
        q = m.q[j] + last * (early + rising - part) + next_ * (part + whole)
        away = 2.0 * m.joint_figures[j].position_error + LIMIT_ROOM
        low, high = w.lower[j] + away, w.upper[j] - away
        # A joint that is already beyond this bound stays.
        e.q[j] = min(max(q, min(low, m.q[j])), max(high, m.q[j]))
    forward_kinematics(
        e.q, w.parent, w.joint_kind, w.q_index, w.gain, w.T_parent_joint, w.axis, e.T
    )
    for k in range(plan.own_count):
        i = e.own[k]
        place_row(w.world.kinds[i], w.local_rows[i], e.T[w.bodies[i]], e.rows[i])
        row_bounds(w.world.kinds[i], e.rows[i], 0.0, e.boxes[i])
    plan.placed += plan.own_count


@kernel
def least_gap(
    r: int, bound: float, e: Escape, w: Workspace, v: Watch, m: Motion
) -> float:
    """Least gap on the planned motion, as `judge_way` returns it [m]."""
    plan = e.plan
    least = ENOUGH
    plan.near_at, plan.gap = inf, inf
    time = 0.0
    for _ in range(STEPS):
        if time > 0.0 or plan.present_gap != plan.present_gap:
            stand_on_way(r, time, e, w, v, m)
            gap = gap_to_approaching(time, e, w, v, m)
        else:
            # All motions begin at the present positions.
            gap = plan.present_gap
        if time == 0.0:
            plan.present_gap = gap
        if gap < NEAR:
            plan.near_at = min(plan.near_at, time)
        least = min(least, gap)
        if not gap > TOUCHED:
            part = min(time / plan.horizon, 1.0)
            return float(HIT_AT_ONCE + (HIT - HIT_AT_ONCE) * part)
        if least < bound or time > plan.horizon:
            break
        time += max(STEP, (gap - least) / plan.closing_speed)
    return least


@kernel
def gap_to_approaching(
    time: float, e: Escape, w: Workspace, v: Watch, m: Motion
) -> float:
    """Least gap of the placed robot to obstacles, beyond the required separation [m].

    Args:
        time: Time from now on [s].
        e: Escape; the closest pair of the motion is noted.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    plan, least = e.plan, inf
    for c in range(plan.approaching_count):
        obstacle = e.approaching[c]
        on = time + time_since(obstacle.seen_at, v, m)
        for k in range(3):
            e.shift[4 * k + 3] = on * obstacle.velocity[k]
        place_row(obstacle.kind, obstacle.row, e.shift, e.obstacle)
        for k in range(plan.own_count):
            i = int(e.own[k])
            if w.checked[w.groups[i], obstacle.group] == 0:
                continue
            need = obstacle_need(i, obstacle.group, w, v, m)
            need += obstacle.error * min(on, CORRECTED)
            if box_gap(e.boxes[i], obstacle.box, e.shift) - need >= least:
                continue
            measure(
                w.world.kinds[i],
                e.rows[i],
                obstacle.kind,
                e.obstacle,
                e.witness,
            )
            gap = max(e.witness[0], ball_gap(i, obstacle, e, w)) - need
            if gap < least:
                least = gap
                if gap < plan.gap:
                    plan.gap = gap
                    plan.robot_primitive, plan.obstacle = i, c
                    for x in range(e.witness.shape[0]):
                        e.closest[x] = e.witness[x]
    return least


@kernel(inline=False)
def ball_gap(i: int, obstacle: Approaching, e: Escape, w: Workspace) -> float:
    """Distance of a placed primitive to the ball that holds an obstacle [m].

    Minus infinity without a ball. The corners of a box are farther out than those of
    the body in it.
    """
    if not obstacle.radius > 0.0:
        return -inf
    row = array_at(stack(ROW_WIDTH), (ROW_WIDTH,), np.float64)
    witness = array_at(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    row[:] = 0.0
    row[0] = obstacle.radius
    for k in range(3):
        row[1 + k] = e.obstacle[1 + k]
    measure(w.world.kinds[i], e.rows[i], SPHERE, row, witness)
    return float(witness[0])


@kernel
def obstacle_need(i: int, group: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Required separation from an obstacle that keeps its velocity [m].

    Args:
        i: Primitive of the robot.
        group: Group of the obstacle.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    need = w.buffers[w.groups[i], group] + v.link_error[i]
    return float(need + v.robot_error[i] + m.blur[i])


@kernel
def box_gap(box: Floats, other: Floats, shift: Floats) -> float:
    """Greatest separation of a box and a shifted box along an axis [m]."""
    gap = -inf
    for k in range(3):
        on = shift[4 * k + 3]
        gap = max(gap, box[k] - other[k + 3] - on, other[k] + on - box[k + 3])
    return gap


@kernel
def free_until(r: int, e: Escape, w: Workspace, v: Watch, m: Motion) -> float:
    """Time until which a robot's motion is free of all other bodies [s].

    Returns:
        The last checked time that is free; infinite if the whole motion is free.
    """
    plan = e.plan
    end = plan.delay + plan.brake_at + plan.fall
    last = 0.0
    for k in range(1, POSTURES + 1):
        time = end * k / POSTURES
        stand_on_way(r, time, e, w, v, m)
        if meets_others(r, e, w, v, m):
            return last
        last = time
    return inf
