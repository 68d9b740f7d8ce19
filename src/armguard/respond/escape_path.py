"""Where a way leads: how near what comes gets to an arm that goes along it.

What is told takes effect after the delays of the robot. Then its joints change, all in
the same time, to the velocities of the way as fast as declared, go on for a while, come
to rest and stay, within their limits. What comes goes on straight at the velocity it
was seen with. All else stands. A foresight, not a proof: a way that leads past
something only slowly is worth no more than what the proof lets through.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.guard.memory import TOKEN
from armguard.guard.motion_pairs import asks_index
from armguard.guard.needs import robot_of, static_need, time_since
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.index.octree_query import primitives_in_box
from armguard.index.octree_state import ABSENT, STATUS
from armguard.kernel import kernel
from armguard.motion.state import NEXT, REACTION, Motion
from armguard.respond.escape_state import (
    APPROACHING_COUNT,
    DELAY,
    FALL,
    GAP,
    GO,
    HALT,
    HORIZON,
    NOW_GAP,
    OBSTACLE_PRIMITIVE,
    OTHER_COUNT,
    OWN_COUNT,
    RATE,
    RISE,
    ROBOT_PRIMITIVE,
    SPENT,
    WHEN,
    Escape,
)
from armguard.respond.state import Response
from armguard.robot.kinematics import forward_kinematics

Floats = NDArray[np.float64]

# A gap of so much beyond what is asked for is enough, and one of less is near [m].
ENOUGH = 0.06
NEAR = 0.03

# With so much less than is asked for it is touched [m].
TOUCHED = -4e-3

# What a way is worth on which the arm is touched: less than any other, the sooner the
# less [m].
HIT, HIT_AT_ONCE = -0.1, -0.2

# Least step in time at which a way is looked at, and most of them.
STEP, STEPS = 0.02, 48

# Share of the bound on how fast points of an arm move with which they are thought to
# approach what comes: joints that all lead the farthest point straight there are rare
# [-].
APPROACHES = 0.5

# Postures of a way that are compared with all else.
POSTURES = 4

# An arm that comes so near to all else is thought not to get farther [m], unless it is
# there already, and comes no nearer than by this [m].
ROOM, GRAZES = 0.012, 2e-3

# So near to a posture the index is asked for primitives [m], and so many of them take
# as long as to place one; to ask takes as long as to place some.
FOUND_WITHIN = 0.03
FOUND_AT_ONCE = 4
ASKING = 4

# How far from its limit a joint is thought to come to rest, beyond errors [rad or m].
LIMIT_ROOM = 2e-3


@kernel(separate=True)
def judge_way(
    r: int, go: float, bound: float, looks: int, a: Response, w: Workspace
) -> float:
    """What a robot's way in `trial` is worth: the least gap to what comes, or less.

    Args:
        r: The robot; `own`, `approaching` and `others` are its.
        go: Time for which it goes before it comes to rest [s].
        bound: Below this nobody needs to know how little it is [m].
        looks: Whether it may also be stopped by all else.
        a: The responses.
        w: The workspace.

    Returns:
        The least gap beyond what is asked for, at most ENOUGH [m]; where it is touched
        a number below HIT.
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
    e.plan[HALT] = halt
    return least_gap(r, bound, e, w, v, m)


@kernel
def plan_way(r: int, go: float, e: Escape, w: Workspace, v: Watch, m: Motion) -> None:
    """Write when a robot does what on the way in `trial`."""
    plan = e.plan
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    rise = fall = 0.0
    for j in range(first, end):
        figures = m.joint_figures[j]
        rise = max(rise, abs(e.trial[j] - v.commanded[j]) / figures.acceleration)
        fall = max(fall, abs(e.trial[j]) / figures.deceleration)
    plan[DELAY] = m.clock[NEXT * m.robot_figures.shape[0] + r, REACTION]
    plan[RISE] = rise
    plan[GO] = max(go, rise)
    plan[FALL] = fall
    plan[HALT] = inf
    fastest = 0.0
    for k in range(e.counts[OWN_COUNT]):
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
    for c in range(e.counts[APPROACHING_COUNT]):
        coming = max(coming, speed_of(int(e.approaching[c]), v))
    plan[RATE] = APPROACHES * fastest + coming


@kernel
def speed_of(j: int, v: Watch) -> float:
    """Speed an object was seen with [m/s]."""
    x, y, z = v.object_velocity[j, 0], v.object_velocity[j, 1], v.object_velocity[j, 2]
    return sqrt(x * x + y * y + z * z)


@kernel
def stand_on_way(
    r: int, time: float, e: Escape, w: Workspace, v: Watch, m: Motion
) -> None:
    """Place a robot's primitives where its way leads it in a time [s]."""
    plan = e.plan
    t = min(time, plan[HALT])
    rise, go, fall = plan[RISE], plan[GO], plan[FALL]
    early = min(t, plan[DELAY])
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
        # Where it stands beyond that already it stays.
        e.q[j] = min(max(q, min(low, m.q[j])), max(high, m.q[j]))
    forward_kinematics(
        e.q, w.parent, w.joint_kind, w.q_index, w.gain, w.T_parent_joint, w.axis, e.T
    )
    for k in range(e.counts[OWN_COUNT]):
        i = e.own[k]
        place_row(w.world.kinds[i], w.local_rows[i], e.T[w.bodies[i]], e.rows[i])
        row_bounds(w.world.kinds[i], e.rows[i], 0.0, e.boxes[i])
    e.counts[SPENT] += e.counts[OWN_COUNT]


@kernel
def least_gap(
    r: int, bound: float, e: Escape, w: Workspace, v: Watch, m: Motion
) -> float:
    """The least gap on the planned way, as `judge_way` returns it."""
    plan = e.plan
    least = ENOUGH
    plan[WHEN], plan[GAP] = inf, inf
    time = 0.0
    for _ in range(STEPS):
        if time > 0.0 or plan[NOW_GAP] != plan[NOW_GAP]:
            stand_on_way(r, time, e, w, v, m)
            gap = gap_to_approaching(time, e, w, v, m)
        else:
            # All ways begin there.
            gap = plan[NOW_GAP]
        if time == 0.0:
            plan[NOW_GAP] = gap
        if gap < NEAR:
            plan[WHEN] = min(plan[WHEN], time)
        least = min(least, gap)
        if not gap > TOUCHED:
            part = min(time / plan[HORIZON], 1.0)
            return float(HIT_AT_ONCE + (HIT - HIT_AT_ONCE) * part)
        if least < bound or time > plan[HORIZON]:
            break
        time += max(STEP, (gap - least) / plan[RATE])
    return least


@kernel
def gap_to_approaching(
    time: float, e: Escape, w: Workspace, v: Watch, m: Motion
) -> float:
    """Least gap of the placed robot to what comes, beyond what is asked for [m].

    Args:
        time: When, from now on [s].
        e: Escape; the closest pair of the way is noted.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    least = inf
    for c in range(e.counts[APPROACHING_COUNT]):
        j = int(e.approaching[c])
        on = time + time_since(v.seen_at[j], v, m)
        for k in range(3):
            e.shift[4 * k + 3] = on * v.object_velocity[j, k]
        place_row(w.world.kinds[j], w.world.rows[j], e.shift, e.obstacle)
        for k in range(e.counts[OWN_COUNT]):
            i = int(e.own[k])
            if w.checked[w.groups[i], w.groups[j]] == 0:
                continue
            need = obstacle_need(i, j, w, v, m)
            if box_gap(e.boxes[i], w.world.boxes[j], e.shift) - need >= least:
                continue
            measure(
                w.world.kinds[i],
                e.rows[i],
                w.world.kinds[j],
                e.obstacle,
                e.witness,
            )
            gap = e.witness[0] - need
            if gap < least:
                least = gap
                if gap < e.plan[GAP]:
                    e.plan[GAP], e.plan[ROBOT_PRIMITIVE], e.plan[OBSTACLE_PRIMITIVE] = (
                        gap,
                        i,
                        j,
                    )
                    for x in range(e.witness.shape[0]):
                        e.closest[x] = e.witness[x]
    return least


@kernel
def obstacle_need(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Distance that is asked for to what comes, without what it may do besides [m]."""
    need = w.buffers[w.groups[i], w.groups[j]] + v.model[i] + v.base[i]
    return float(need + m.blur[i])


@kernel
def box_gap(box: Floats, other: Floats, shift: Floats) -> float:
    """How far a box is from another one that is shifted, on the axis of most [m]."""
    gap = -inf
    for k in range(3):
        on = shift[4 * k + 3]
        gap = max(gap, box[k] - other[k + 3] - on, other[k] + on - box[k + 3])
    return gap


@kernel
def free_until(r: int, e: Escape, w: Workspace, v: Watch, m: Motion) -> float:
    """Until when a robot's way is free of all that does not come [s].

    Returns:
        The last time that was looked at and is free; infinite if the way is.
    """
    plan = e.plan
    end = plan[DELAY] + plan[GO] + plan[FALL]
    last = 0.0
    for k in range(1, POSTURES + 1):
        time = end * k / POSTURES
        stand_on_way(r, time, e, w, v, m)
        if meets_others(r, e, w, v, m):
            return last
        last = time
    return inf


@kernel
def meets_others(r: int, e: Escape, w: Workspace, v: Watch, m: Motion) -> bool:
    """Whether the placed robot is too near to itself or to what does not come."""
    own = e.counts[OWN_COUNT]
    rows, boxes = w.world.rows, w.world.boxes
    by_index = asks_index(w) != 0
    for k in range(own):
        i = int(e.own[k])
        for c in range(k + 1, own):
            j = int(e.own[c])
            if meets(i, j, e.rows[j], e.boxes[j], e, w, v, m):
                return True
        for c in range(e.counts[OTHER_COUNT]):
            j = int(e.others[c])
            if meets(i, j, rows[j], boxes[j], e, w, v, m):
                return True
        for c in range(found_near(i, e, w) if by_index else 0):
            j = int(w.candidates[c])
            if may_be_met(r, j, e, w, v) and meets(i, j, rows[j], boxes[j], e, w, v, m):
                return True
    return False


@kernel
def found_near(i: int, e: Escape, w: Workspace) -> int:
    """How many primitives the index finds near a placed one, in `candidates`."""
    for k in range(3):
        w.look_box[k] = e.boxes[i, k] - FOUND_WITHIN
        w.look_box[k + 3] = e.boxes[i, k + 3] + FOUND_WITHIN
    w.memory[TOKEN] += 1
    token = w.memory[TOKEN]
    found = primitives_in_box(i, w.look_box, w.octree, w.seen, token, w.candidates)
    e.counts[SPENT] += ASKING + found // FOUND_AT_ONCE
    return int(found)


@kernel
def may_be_met(r: int, j: int, e: Escape, w: Workspace, v: Watch) -> bool:
    """Whether a primitive is there, none of a robot's, and does not come at it."""
    if robot_of(j, v) == r or w.octree.residency[j, STATUS] == ABSENT:
        return False
    for c in range(e.counts[APPROACHING_COUNT]):
        if e.approaching[c] == j:
            return False
    return True


@kernel
def meets(
    i: int,
    j: int,
    row: Floats,
    box: Floats,
    e: Escape,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> bool:
    """Whether a primitive of the placed robot is too near to another one.

    Args:
        i: The primitive.
        j: The other one.
        row: Where that is, shape (16,).
        box: Its box, shape (6,).
        e: Escape.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    if w.checked[w.groups[i], w.groups[j]] == 0:
        return False
    need = ROOM + static_need(min(i, j), max(i, j), w, v, m)
    for k in range(3):
        if e.boxes[i, k] - box[k + 3] > need or box[k] - e.boxes[i, k + 3] > need:
            return False
    kinds, rows = w.world.kinds, w.world.rows
    measure(kinds[i], e.rows[i], kinds[j], row, e.witness)
    gap = e.witness[0]
    if not gap < need:
        return False
    measure(kinds[i], rows[i], kinds[j], rows[j], e.witness)
    return bool(gap < e.witness[0] - GRAZES)
