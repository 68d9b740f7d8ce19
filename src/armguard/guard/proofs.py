"""What a pair needs until its robots rest, and whether it keeps that."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import dot
from armguard.guard.layout import (
    ENVELOPE,
    WITNESS,
)
from armguard.guard.observe import now_of
from armguard.guard.pair_row import pair_row
from armguard.guard.watch import (
    BRAKING,
    COMMANDED,
    LOST,
    NOW_TIME,
    RECOVERING,
    RUNNING,
    SLOW_TIME,
    Watch,
)
from armguard.guard.workspace import (
    Workspace,
)
from armguard.kernel import kernel
from armguard.motion.figures import (
    SPEED,
)
from armguard.motion.nearest import joint_way
from armguard.motion.pair_proof import (
    LITTLE,
    WHOLE_PATH,
    path_gap,
    prove_by_spans,
    shared_joints,
    span_gap,
)
from armguard.motion.pair_state import (
    NEEDED,
    PROVEN,
    SPENT,
    UNPROVEN,
    Pair,
    new_pair,
)
from armguard.motion.state import (
    BUDGET,
    LOOKED,
    NEXT,
    SEGMENT,
    SETTLED,
    STILL,
    TESTS,
    Motion,
)

Floats = NDArray[np.float64]

# What the bounds of the path of an arm that leaves what is too near may add to it [m].
SINK = 1e-3

# Slack in time is told this much farther than where the arm is slowed [-].
LOOK_AHEAD = 2.0

# A pair that has less than this left beyond what it needs is near [m].
NEAR_CUE = 0.02

# The exact shapes of a pair are asked if its primitives have less than this left [m].
PLENTY = 5e-3

# Which shapes a pair's clearance is of. The place ENVELOPE of its row holds this until
# the cycle concludes.
OF_WITNESS = 0.0
OF_PRIMITIVES = 1.0
OF_EXACT = 2.0


@kernel
def robot_of(i: int, v: Watch) -> int:
    """Robot a primitive rides on, -1 for none."""
    return int(v.robot_of[i]) if i < v.robot_of.shape[0] else -1


@kernel
def own_sum(i: int, body: int, first: int, sizes: Floats, m: Motion) -> float:
    """Sum of sizes times levers over a primitive's joints from one of them on."""
    total = 0.0
    for k in range(first, m.length[body]):
        total += sizes[m.joints[body, k]] * m.levers[i, k]
    return total


@kernel
def closing_speed(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Bound on how fast two primitives can approach as they are moving now [m/s]."""
    if j >= m.rate.shape[0]:
        return float(m.rate[i] + object_speed(j, v))
    first = shared_joints(w.bodies[i], w.bodies[j], m)
    if first == 0:
        return float(m.rate[i] + m.rate[j])
    return float(
        own_sum(i, w.bodies[i], first, m.speed, m)
        + own_sum(j, w.bodies[j], first, m.speed, m)
    )


@kernel
def rate_along_normal(
    i: int, j: int, place: int, w: Workspace, v: Watch, m: Motion
) -> float:
    """How fast a pair may be closing now, by its witness points and normal [m/s].

    Unlike the levers this knows directions: what moves past closes nothing.
    """
    out = w.out
    at = place + WITNESS
    n = (out[at + 7], out[at + 8], out[at + 9])
    moving = m.rate.shape[0]
    body_j = w.bodies[j] if j < moving else -1
    first = shared_joints(w.bodies[i], body_j, m)
    total = 0.0
    for side in range(2):
        k, body = (i, w.bodies[i]) if side == 0 else (j, body_j)
        if k >= moving:
            total += object_speed(k, v)
            continue
        point = (
            out[at + 1 + 3 * side], out[at + 2 + 3 * side], out[at + 3 + 3 * side]
        )  # fmt: skip
        for c in range(first, m.length[body]):
            b = m.joints[body, c]
            q = m.q_index[b]
            if m.clock[m.robot_of_joint[q], STILL] != 0.0:
                continue
            g = m.gain[b, 0] * dot(n, joint_way(point, b, m.axes[b], m))
            if side == 1:
                g = -g
            total += max(g * m.v_low[q], g * m.v_high[q])
    return total


@kernel
def object_speed(j: int, v: Watch) -> float:
    """Greatest speed of a primitive that no robot moves [m/s]."""
    return float(v.top_speed[j]) if j < v.top_speed.shape[0] else 0.0


@kernel
def standing_need(i: int, j: int, w: Workspace, v: Watch, m: Motion) -> float:
    """Distance a pair must keep whatever its robots do [m].

    Its buffer, the errors of the model, and an object's way since it was seen.
    """
    need = w.buffers[w.groups[i], w.groups[j]] + v.model[i]
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    if robot_j >= 0:
        need += v.model[j]
        if robot_i != robot_j:
            need += v.base[i] + v.base[j]
        return float(need)
    need += v.base[i]
    speed = object_speed(j, v)
    if speed > 0.0 and m.span[SEGMENT] == 0.0:
        need += speed * time_since(v.seen_at[j], v, m)
    return float(need)


@kernel
def time_since(seen: float, v: Watch, m: Motion) -> float:
    """Longest time since an object was seen [s].

    Where nobody tells the time of the cycle it is later than the newest stamp by no
    more than a measurement may be old.
    """
    age = now_of(v) - seen
    if v.given[NOW_TIME] != v.given[NOW_TIME]:
        oldest = 0.0
        for r in range(m.robot_figures.shape[0]):
            oldest = max(oldest, m.robot_figures[r].sensing)
        age += oldest
    return float(max(age, 0.0))


@kernel
def look_distance(i: int, v: Watch, m: Motion) -> float:
    """Beyond this distance nothing about a primitive is to be told [m]."""
    return float(m.reach[NEXT, i] + m.rate[i] * LOOK_AHEAD * v.pace[SLOW_TIME])


@kernel(separate=True)
def prove_pair(
    i: int, j: int, plan_i: int, plan_j: int, place: int, w: Workspace
) -> tuple[int, float]:
    """Prove that a pair keeps what it must on the stop paths of its robots.

    Which shapes the answer is of is written to the pair's row. Of an object that comes
    by itself at a robot that leaves it, no more is proven than that the robot comes no
    nearer to where it was seen: such a pair is `UNPROVEN`.

    Returns:
        How the proof ended, and what is left or lacks [m].
    """
    v, m = w.watch, w.motion
    distance = w.out[place + WITNESS]
    w.out[place + ENVELOPE] = OF_WITNESS
    need, drift = standing_need(i, j, w, v, m), object_speed(j, v)
    whole = need + drift * m.span[SETTLED]
    if is_evaded(i, j, v) and m.span[SEGMENT] == 0.0:
        by_levers = distance - whole - m.reach[plan_i, i]
        if not by_levers >= 0.0:
            v.relieved[robot_of(i, v)] = 1
            return (UNPROVEN, by_levers)
        return (PROVEN, by_levers)
    floor = w.buffers[w.groups[i], w.groups[j]]
    relief = relief_of(i, j, place, distance - whole, floor, w, v, m)
    if relief == 0.0:
        return prove_need(i, j, plan_i, plan_j, place, need, False, w)
    m.effort[LOOKED] = 1
    proof, spare = prove_need(i, j, plan_i, plan_j, place, need - relief, True, w)
    if proof == PROVEN and drift > 0.0 and relief > floor:
        w.out[place + ENVELOPE] = OF_WITNESS
        return (UNPROVEN, distance - whole - m.reach[plan_i, i])
    return (proof, spare)


@kernel(separate=True)
def prove_need(
    i: int,
    j: int,
    plan_i: int,
    plan_j: int,
    place: int,
    need: float,
    relieved: bool,
    w: Workspace,
) -> tuple[int, float]:
    """Prove that a pair keeps a distance on the stop paths of its robots.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        plan_i: The stop of its robot, NEXT or NOW.
        plan_j: The same of the other.
        place: Where the pair's row starts.
        need: The distance, without an object's way until all rest [m].
        relieved: Whether it is less than the pair is to have.
        w: The workspace.

    Returns:
        How the proof ended, and what is left or lacks [m].
    """
    v, m = w.watch, w.motion
    out = w.out
    moving = m.rate.shape[0]
    distance, drift = out[place + WITNESS], object_speed(j, v)
    whole = need + drift * m.span[SETTLED]
    shared = shared_joints(w.bodies[i], w.bodies[j], m)
    by_levers = distance - whole
    if shared == 0:
        by_levers -= m.reach[plan_i, i]
        if j < moving:
            by_levers -= m.reach[plan_j, j]
    else:
        by_levers -= own_sum(i, w.bodies[i], shared, m.spread[plan_i], m)
        by_levers -= own_sum(j, w.bodies[j], shared, m.spread[plan_j], m)
    blunt = not distance > 0.0 or coarse(i, v, m) or coarse(j, v, m)
    if not relieved and (blunt or is_plenty(by_levers, i, j, place, w, v, m)):
        return (PROVEN if by_levers >= 0.0 else NEEDED, by_levers)
    if m.effort[TESTS] >= m.effort[BUDGET]:
        return (PROVEN if by_levers >= 0.0 else SPENT, by_levers)
    m.effort[TESTS] += 1
    p = new_pair()
    describe_pair(i, j, plan_i, plan_j, need, drift, w, m, p)
    n = (out[place + WITNESS + 7], out[place + WITNESS + 8], out[place + WITNESS + 9])
    by_path = path_gap(n, p, m) - whole
    spare = max(by_levers, by_path)
    if by_path > by_levers:
        out[place + ENVELOPE] = OF_PRIMITIVES
    has_exact = w.exact_of[i, 1] != 0 or w.exact_of[j, 1] != 0
    if has_exact and not spare >= PLENTY:
        by_shapes = look_at_exact(i, j, w, p)
        if by_shapes > spare:
            m.effort[LOOKED] = 1
            spare = by_shapes
            out[place + ENVELOPE] = OF_EXACT
        describe_pair(i, j, plan_i, plan_j, need, drift, w, m, p)
    if spare >= (LITTLE if m.span[SEGMENT] == 0.0 else 0.0):
        return (PROVEN, spare)
    known = spare if spare >= 0.0 else -inf
    proof, by_spans = prove_by_spans(known, p, m)
    if proof == PROVEN and by_spans > spare:
        m.effort[LOOKED] = 1 if relieved else 0
        out[place + ENVELOPE] = OF_PRIMITIVES
        return (proof, by_spans)
    if spare >= 0.0:
        return (PROVEN, spare)
    if proof == SPENT:
        return (proof, spare)
    out[place + ENVELOPE] = OF_PRIMITIVES
    if not has_exact:
        return (proof, by_spans)
    m.effort[LOOKED] = 1
    exact, by_exact = prove_exact(i, j, w, p)
    if exact == SPENT:
        return (exact, by_spans)
    if exact == PROVEN or by_exact > by_spans:
        out[place + ENVELOPE] = OF_EXACT
        return (exact, by_exact)
    return (proof, by_spans)


@kernel
def is_evaded(i: int, j: int, v: Watch) -> bool:
    """Whether a robot is getting out of the way of an object.

    It comes, whatever the robot does: a stop in its way protects from nothing. Where
    it will be is foreseen, and the robot led by that.

    Args:
        i: Primitive of the robot.
        j: Primitive of the object.
        v: Watch.
    """
    if j >= v.evaded.shape[0] or v.evaded[j] == 0:
        return False
    r = robot_of(i, v)
    if r < 0 or v.phase[r] != RECOVERING:
        return False
    return bool((v.evaded[j] >> r) & 1 != 0)


@kernel
def is_plenty(
    spare: float, i: int, j: int, place: int, w: Workspace, v: Watch, m: Motion
) -> bool:
    """Whether a pair has so much left that nobody needs to know how much."""
    time = LOOK_AHEAD * v.pace[SLOW_TIME]
    if spare >= time * closing_speed(i, j, w, v, m):
        return True
    if not spare >= NEAR_CUE:
        return False
    return bool(spare >= time * rate_along_normal(i, j, place, w, v, m))


@kernel
def relief_of(
    i: int,
    j: int,
    place: int,
    spare: float,
    floor: float,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> float:
    """What is taken off a pair's need while a robot leaves what is too near [m].

    A pair that would be too near at rest as well, or is by so little not that its
    robots cannot be let go, need not be farther than it is, as long as what the robot
    is told surely opens it. What the bounds of its path may add to that is bounded too,
    by where the recovery began, and by how far an object can have come by itself since.
    The pair's other side must not be one that is driven nearer.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        place: Where the pair's row starts.
        spare: Distance beyond what the pair needs besides joints [m].
        floor: What of that need is no error, but asked for [m].
        w: The workspace.
        w: Workspace.
        v: Watch; the deficits of resting robots are noted.
        m: Motion.
    """
    if m.span[SEGMENT] != 0.0:
        return 0.0
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    measured = spare
    spare -= m.blur[i]
    if robot_j >= 0:
        spare -= m.blur[j]
    if not spare < SINK:
        return 0.0
    for side in range(2):
        r = robot_i if side == 0 else robot_j
        if r >= 0:
            v.deficit[r] = max(v.deficit[r], -spare)
    most = 0.0
    for side in range(2):
        r = robot_i if side == 0 else robot_j
        if r < 0:
            continue
        if v.phase[r] == RUNNING and is_driven_nearer(r, i, j, place, w):
            return 0.0
        if v.phase[r] == RECOVERING:
            v.relieved[r] = 1
            if not surely_opens(r, i, j, place, w):
                return 0.0
            # What comes by itself was counted until then when the recovery began.
            later = max(now_of(v) + m.span[SETTLED] - v.relief_until[r], 0.0)
            most = max(most, v.relief[r] + SINK + object_speed(j, v) * later)
    relief = min(SINK - spare, most)
    if relief > floor and measured + floor >= error_along(i, j, place, w, v, m):
        # What surely does not touch has to stay so.
        relief = floor
    return float(relief)


@kernel
def error_along(i: int, j: int, place: int, w: Workspace, v: Watch, m: Motion) -> float:
    """What errors of joint positions take off a pair's distance, to first order [m].

    No more than `blur`, which is the sum of the ways of both sides in any direction.
    """
    pair_row(i, j, place, v.row, w, m)
    total = 0.0
    for q in range(v.row.shape[0]):
        total += abs(v.row[q]) * m.joint_figures[q].position_error
    return total


@kernel(separate=True)
def surely_opens(r: int, i: int, j: int, place: int, w: Workspace) -> bool:
    """Whether what a robot is told opens a pair, wherever in its error each joint is.

    The other robot's errors count as well if it is driven.

    Args:
        r: The robot.
        i: Lower primitive.
        j: Higher primitive.
        place: Where the pair's row starts.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    if v.given[COMMANDED] == 0.0:
        return False
    pair_row(i, j, place, v.row, w, m)
    closing = 0.0
    for q in range(v.row.shape[0]):
        own = int(m.robot_of_joint[q])
        if own == r:
            closing += v.row[q] * v.wanted[q]
        if own == r or v.phase[own] == RUNNING:
            closing += abs(v.row[q]) * m.joint_figures[q].tracking_error
    return closing < 0.0


@kernel(separate=True)
def is_driven_nearer(r: int, i: int, j: int, place: int, w: Workspace) -> bool:
    """Whether anything a robot is or was told, and may do yet, closes a pair.

    Args:
        r: The robot.
        i: Lower primitive.
        j: Higher primitive.
        place: Where the pair's row starts.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    if v.given[COMMANDED] == 0.0:
        return True
    pair_row(i, j, place, v.row, w, m)
    first = m.robot_figures[r].first_joint
    for q in range(first, first + m.robot_figures[r].joint_count):
        low = min(v.under_way[q, 0], v.wanted[q])
        high = max(v.under_way[q, 1], v.wanted[q])
        if max(v.row[q] * low, v.row[q] * high) > 0.0:
            return True
    return False


@kernel
def describe_pair(
    i: int,
    j: int,
    plan_i: int,
    plan_j: int,
    need: float,
    drift: float,
    w: Workspace,
    m: Motion,
    p: Pair,
) -> None:
    """Describe a pair of primitives."""
    moving = m.rate.shape[0]
    for side in range(2):
        k = i if side == 0 else j
        p.kind[side] = w.world.kinds[k]
        local = w.local_rows[k] if k < moving else w.world.rows[k]
        for c in range(ROW_WIDTH):
            p.row[side, c] = w.world.rows[k, c]
            p.local[side, c] = local[c]
        p.body[side] = w.bodies[k]
        p.plan[side] = plan_i if side == 0 else plan_j
        p.primitive[side], p.exact[side] = min(k, moving - 1), -1
    p.shared = shared_joints(w.bodies[i], w.bodies[j], m)
    p.need = need
    p.drift = drift


@kernel(separate=True)
def look_at_exact(i: int, j: int, w: Workspace, p: Pair) -> float:
    """What the exact shapes of both sides surely have left, looked at once [m].

    Args:
        i: Lower primitive.
        j: Higher primitive.
        w: The workspace.
        p: Their pair; its shapes are replaced.
    """
    m = w.motion
    least = inf
    for a in range(max(w.exact_of[i, 1], 1)):
        describe_exact(i, a, 0, w, p)
        for b in range(max(w.exact_of[j, 1], 1)):
            describe_exact(j, b, 1, w, p)
            m.effort[TESTS] += 1
            _, gap, bend = span_gap(WHOLE_PATH, p, m)
            left = gap - bend - p.need - p.drift * m.span[SETTLED]
            if not left >= 0.0:
                return -inf
            least = min(least, left)
    return least


@kernel(separate=True)
def prove_exact(i: int, j: int, w: Workspace, p: Pair) -> tuple[int, float]:
    """The same for the exact shapes of both sides: each pair of them has to hold.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        w: The workspace.
        p: Their pair; its shapes are replaced.
    """
    least = inf
    for a in range(max(w.exact_of[i, 1], 1)):
        describe_exact(i, a, 0, w, p)
        for b in range(max(w.exact_of[j, 1], 1)):
            describe_exact(j, b, 1, w, p)
            proof, spare = prove_by_spans(-inf, p, w.motion)
            if proof != PROVEN:
                return (proof, spare)
            least = min(least, spare)
    return (PROVEN, least)


@kernel
def describe_exact(i: int, which: int, side: int, w: Workspace, p: Pair) -> None:
    """Write one of the exact shapes of a primitive's link into a pair."""
    if w.exact_of[i, 1] == 0:
        return
    e = w.exact_of[i, 0] + which
    p.kind[side] = w.exact_kinds[e]
    for c in range(ROW_WIDTH):
        p.local[side, c] = w.exact_rows[e, c]
    p.exact[side] = e


@kernel
def coarse(i: int, v: Watch, m: Motion) -> bool:
    """Whether a side is to be judged by levers and speed alone.

    Because its robot's mode is "speed"; or because that robot brakes, and no proof
    could ask for more.
    """
    r = robot_of(i, v)
    if r < 0 or m.span[SEGMENT] != 0.0:
        return False
    brakes = v.phase[r] == BRAKING or v.phase[r] == LOST
    return bool(m.robot_figures[r].mode == SPEED or brakes)
