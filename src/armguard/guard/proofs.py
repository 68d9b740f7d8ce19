"""What a pair needs until its robots rest, and which of them must stop for it.

Every cycle proves that a stop ordered in the next one touches nothing. A pair for which
that cannot be proven any longer has been proven in the last cycle for a stop that is
ordered now. If it is enough that one of two robots stops now, the other may go on.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import (
    BUFFER,
    CLEARANCE,
    PROOF,
    TIME_LEFT,
    TIME_TO_CONTACT,
    WITNESS,
)
from armguard.guard.levels import Reason
from armguard.guard.observe import now_of
from armguard.guard.watch import SLOW_TIME
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.figures import FIXED, MODE, SPEED
from armguard.motion.pair_proof import (
    NEEDED,
    PROVEN,
    SPENT,
    path_gap,
    prove_by_spans,
    shared_joints,
)
from armguard.motion.state import HORIZON, NEXT, NOW

Floats = NDArray[np.float64]

TOO_CLOSE = int(Reason.TOO_CLOSE)
NO_PROOF = int(Reason.NO_PROOF)
BUDGET_SPENT = int(Reason.BUDGET_SPENT)

# Slack in time is told this much farther than where the arm is slowed [-].
LOOK_AHEAD = 2.0


@kernel
def robot_of(i: int, w: Workspace) -> int:
    """Robot a primitive rides on, -1 for none."""
    return int(w.watch.robot_of[i]) if i < w.watch.robot_of.shape[0] else -1


@kernel
def pair_sum(i: int, j: int, plan_i: int, plan_j: int, w: Workspace) -> float:
    """How much nearer two primitives can come on their stop paths, by levers [m]."""
    m = w.motion
    moving = m.rate.shape[0]
    way = m.reach[plan_i, i]
    if j >= moving:
        return float(way)
    first = shared_joints(w.bodies[i], w.bodies[j], m)
    if first == 0:
        return float(way + m.reach[plan_j, j])
    return float(
        own_sum(i, first, m.spread[plan_i], w) + own_sum(j, first, m.spread[plan_j], w)
    )


@kernel
def own_sum(i: int, first: int, sizes: Floats, w: Workspace) -> float:
    """Sum of sizes times levers over a primitive's joints from one of them on."""
    m = w.motion
    body = w.bodies[i]
    total = 0.0
    for k in range(first, m.length[body]):
        total += sizes[m.joints[body, k]] * m.levers[i, k]
    return total


@kernel
def closing_speed(i: int, j: int, w: Workspace) -> float:
    """Bound on how fast two primitives can approach as they are moving now [m/s]."""
    m = w.motion
    if j >= m.rate.shape[0]:
        return float(m.rate[i] + object_speed(j, w))
    first = shared_joints(w.bodies[i], w.bodies[j], m)
    if first == 0:
        return float(m.rate[i] + m.rate[j])
    return float(own_sum(i, first, m.speed, w) + own_sum(j, first, m.speed, w))


@kernel
def object_speed(j: int, w: Workspace) -> float:
    """Greatest speed of a primitive that no robot moves [m/s]."""
    return float(w.watch.top_speed[j]) if j < w.watch.top_speed.shape[0] else 0.0


@kernel
def standing_need(i: int, j: int, w: Workspace) -> float:
    """Distance a pair must keep whatever its robots do [m].

    Its buffer, the errors of the model, and an object's way since it was seen.
    """
    v = w.watch
    need = w.buffers[w.groups[i], w.groups[j]] + v.model[i]
    robot_i, robot_j = robot_of(i, w), robot_of(j, w)
    if robot_j >= 0:
        need += v.model[j]
        if robot_i != robot_j:
            need += v.base[i] + v.base[j]
        return float(need)
    need += v.base[i]
    speed = object_speed(j, w)
    if speed > 0.0:
        need += speed * max(now_of(v) - v.seen_at[j], 0.0)
    return float(need)


@kernel
def look_distance(i: int, w: Workspace) -> float:
    """Beyond this distance nothing about a primitive is to be told [m]."""
    m, v = w.motion, w.watch
    ahead = LOOK_AHEAD * v.pace[SLOW_TIME]
    return float(m.reach[NEXT, i] + m.rate[i] * ahead)


@kernel
def judge_motion(i: int, j: int, place: int, w: Workspace) -> None:
    """Write what a measured pair has left beyond what it needs, and how long.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        place: Where the pair's row starts; its witness is written already.
        w: Workspace; robots that must stop are marked.
    """
    out, v, m = w.out, w.watch, w.motion
    robot_i, robot_j = robot_of(i, w), robot_of(j, w)
    proof, spare = prove_pair(i, j, NEXT, NEXT, place, w)
    out[place + CLEARANCE] = spare
    out[place + PROOF] = proof
    closing = closing_speed(i, j, w)
    left = inf
    if not spare > 0.0:
        left = 0.0
    elif closing > 0.0:
        left = spare / closing
    out[place + TIME_LEFT] = left
    out[place + TIME_TO_CONTACT] = time_to_contact(i, j, out[place + WITNESS], w)
    if not left >= v.time_left[robot_i]:
        v.time_left[robot_i] = left
    if robot_j >= 0 and not left >= v.time_left[robot_j]:
        v.time_left[robot_j] = left
    if proof == PROVEN:
        return
    cause = TOO_CLOSE if proof == NEEDED else NO_PROOF
    if proof == SPENT:
        cause = BUDGET_SPENT
    if robot_j < 0 or robot_j == robot_i:
        demand_stop(robot_i, cause, w)
        return
    fixed_i = m.robot_figures[robot_i, MODE] == FIXED
    fixed_j = m.robot_figures[robot_j, MODE] == FIXED
    if fixed_i or fixed_j:
        # A fixed robot stops when its buffer is broken; the other one has to prove.
        broken = not out[place + WITNESS] >= out[place + BUFFER]
        if broken or not fixed_i:
            demand_stop(robot_i, cause, w)
        if broken or not fixed_j:
            demand_stop(robot_j, cause, w)
        return
    one, other = robot_i, robot_j
    if m.rate[j] > m.rate[i]:
        one, other = robot_j, robot_i
    for attempt in range(2):
        # First the one that moves faster, then the other one alone.
        stopped = one if attempt == 0 else other
        plan_i = NOW if stopped == robot_i else NEXT
        plan_j = NOW if stopped == robot_j else NEXT
        if prove_pair(i, j, plan_i, plan_j, place, w)[0] == PROVEN:
            demand_stop(stopped, cause, w)
            return
    demand_stop(one, cause, w)
    demand_stop(other, cause, w)


@kernel
def demand_stop(r: int, cause: int, w: Workspace) -> None:
    """A robot must stop, or stay where it rests."""
    if w.watch.must[r] == 0:
        w.watch.must[r] = 1
        w.watch.cause[r] = cause


@kernel(inline=False)
def prove_pair(
    i: int, j: int, plan_i: int, plan_j: int, place: int, w: Workspace
) -> tuple[int, float]:
    """Prove that a pair keeps what it must on the stop paths of its robots.

    Returns:
        How the proof ended, and what is left or lacks [m].
    """
    out, m = w.out, w.motion
    distance = out[place + WITNESS]
    need, drift = standing_need(i, j, w), object_speed(j, w)
    by_levers = distance - need - drift * m.span[HORIZON]
    by_levers -= pair_sum(i, j, plan_i, plan_j, w)
    if by_levers != by_levers:
        return (NEEDED, by_levers)
    if by_speed(i, j, w):
        return (PROVEN if by_levers >= 0.0 else NEEDED, by_levers)
    look = LOOK_AHEAD * w.watch.pace[SLOW_TIME] * closing_speed(i, j, w)
    if by_levers >= look or not distance > 0.0:
        return (PROVEN if by_levers >= 0.0 else NEEDED, by_levers)
    kinds, rows = w.world.kinds, w.world.rows
    body_i = w.bodies[i]
    body_j = w.bodies[j]
    moving = m.rate.shape[0]
    levers_j = m.levers[min(j, moving - 1)]
    n = (out[place + WITNESS + 7], out[place + WITNESS + 8], out[place + WITNESS + 9])
    by_path = path_gap(
        kinds[i],
        rows[i],
        body_i,
        plan_i,
        m.levers[i],
        kinds[j],
        rows[j],
        body_j,
        plan_j,
        levers_j,
        n,
        m,
    )
    spare = max(by_levers, by_path - need - drift * m.span[HORIZON])
    if spare >= 0.0:
        return (PROVEN, spare)
    proof, by_spans = prove_by_spans(
        kinds[i],
        w.local_rows[i],
        body_i,
        plan_i,
        m.levers[i],
        kinds[j],
        rows[j] if body_j < 0 else w.local_rows[j],
        body_j,
        plan_j,
        levers_j,
        need,
        drift,
        m,
    )
    if proof == PROVEN or proof == SPENT:
        return (proof, by_spans)
    if w.exact_of[i, 1] == 0 and w.exact_of[j, 1] == 0:
        return (proof, by_spans)
    exact, by_exact = prove_exact(i, j, plan_i, plan_j, need, drift, w)
    if exact == PROVEN or by_exact > by_spans:
        return (exact, by_exact)
    return (proof, by_spans)


@kernel(inline=False)
def prove_exact(
    i: int,
    j: int,
    plan_i: int,
    plan_j: int,
    need: float,
    drift: float,
    w: Workspace,
) -> tuple[int, float]:
    """The same for the exact shapes of both sides: each pair of them has to hold."""
    m = w.motion
    least = inf
    for a in range(max(w.exact_of[i, 1], 1)):
        e = w.exact_of[i, 0] + a
        own_i = w.exact_of[i, 1] == 0
        kind_i = w.world.kinds[i] if own_i else w.exact_kinds[e]
        local_i = w.local_rows[i] if own_i else w.exact_rows[e]
        levers_i = m.levers[i] if own_i else m.exact_levers[e]
        for b in range(max(w.exact_of[j, 1], 1)):
            f = w.exact_of[j, 0] + b
            own_j = w.exact_of[j, 1] == 0
            kind_j = w.world.kinds[j] if own_j else w.exact_kinds[f]
            local_j = w.exact_rows[max(f, 0)]
            levers_j = m.exact_levers[max(f, 0)]
            if own_j:
                local_j = w.world.rows[j] if w.bodies[j] < 0 else w.local_rows[j]
                levers_j = m.levers[min(j, m.rate.shape[0] - 1)]
            proof, spare = prove_by_spans(
                kind_i,
                local_i,
                w.bodies[i],
                plan_i,
                levers_i,
                kind_j,
                local_j,
                w.bodies[j],
                plan_j,
                levers_j,
                need,
                drift,
                m,
            )
            if proof != PROVEN:
                return (proof, spare)
            least = min(least, spare)
    return (PROVEN, least)


@kernel
def by_speed(i: int, j: int, w: Workspace) -> bool:
    """Whether a side's robot is to be judged by levers and speed alone."""
    m = w.motion
    for side in range(2):
        r = robot_of(i if side == 0 else j, w)
        if r >= 0 and m.robot_figures[r, MODE] == SPEED:
            return True
    return False


@kernel
def time_to_contact(i: int, j: int, distance: float, w: Workspace) -> float:
    """Least time until a pair can touch, whatever its operators do [s].

    From a bound of its closing speed and of what accelerations can add to that
    (Culley and Kempf).
    """
    if not distance > 0.0:
        return 0.0
    m = w.motion
    speed = closing_speed(i, j, w)
    push = m.push[i] + (m.push[j] if j < m.rate.shape[0] else 0.0)
    # distance = speed · t + ½ · push · t²
    root = sqrt(speed * speed + 2.0 * push * distance)
    return float(2.0 * distance / (speed + root)) if root > 0.0 else inf
