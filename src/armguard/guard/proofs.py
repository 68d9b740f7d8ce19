"""Proof that a pair keeps its buffer until its robots rest, and its headroom."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.guard.layout import NearRow, normal_of
from armguard.guard.needs import (
    LOOK_AHEAD,
    closing_speed,
    object_speed,
    own_sum,
    rate_along_normal,
    robot_of,
    static_need,
)
from armguard.guard.relief import relief_of
from armguard.guard.watch import BRAKING, LOST, RECOVERING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.figures import (
    SPEED,
)
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
    Motion,
)

Floats = NDArray[np.float64]


# Headroom below which a pair contributes to cues and is proven in full [m].
NEAR_CUE = 0.02

# Headroom of the primitives below which the exact shapes of a pair are tested [m].
PLENTY = 5e-3

# Shapes that a pair's headroom was computed with. The column ENVELOPE of its row holds
# this until the cycle concludes.
OF_WITNESS = 0.0
OF_PRIMITIVES = 1.0
OF_EXACT = 2.0


@kernel(separate=True)
def prove_pair(
    i: int, j: int, plan_i: int, plan_j: int, near: NearRow, w: Workspace
) -> tuple[int, float]:
    """Prove that a pair keeps its required separation on the stop paths of its robots.

    The judged shapes are written to the pair's row. For a robot that leaves a moving
    object, it is only proven that the robot does not approach the place where the
    object was seen: such a pair is `UNPROVEN`.

    Returns:
        How the proof ended, and the headroom, negative for a deficit [m].
    """
    v, m = w.watch, w.motion
    distance = near.distance
    near.envelope = OF_WITNESS
    need, drift = static_need(i, j, w, v, m), object_speed(j, v)
    whole = need + drift * m.span.settled
    evaded = is_evaded(i, j, v) or rests_among_cells(i, j, plan_i, w)
    if evaded and m.span.segment == 0:
        by_levers = distance - whole - m.reach[plan_i, i]
        if not by_levers >= 0.0:
            v.relieved[robot_of(i, v)] = 1
            return (UNPROVEN, by_levers)
        return (PROVEN, by_levers)
    floor = w.buffers[w.groups[i], w.groups[j]]
    relief = relief_of(i, j, near, distance - whole, floor, w, v, m)
    if relief == 0.0:
        return prove_need(i, j, plan_i, plan_j, near, need, False, w)
    m.effort.beyond_primitives = 1
    proof, spare = prove_need(i, j, plan_i, plan_j, near, need - relief, True, w)
    if proof == PROVEN and drift > 0.0 and relief > floor:
        near.envelope = OF_WITNESS
        return (UNPROVEN, distance - whole - m.reach[plan_i, i])
    return (proof, spare)


@kernel(separate=True)
def prove_need(
    i: int,
    j: int,
    plan_i: int,
    plan_j: int,
    near: NearRow,
    need: float,
    relieved: bool,
    w: Workspace,
) -> tuple[int, float]:
    """Prove that a pair keeps a distance on the stop paths of its robots.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        plan_i: The stop of the robot of i, NEXT or NOW.
        plan_j: The stop of the robot of j, NEXT or NOW.
        near: The pair's row.
        need: The distance, without an object's travel until all rest [m].
        relieved: Whether it was reduced for a recovery.
        w: The workspace.

    Returns:
        How the proof ended, and the headroom, negative for a deficit [m].
    """
    v, m = w.watch, w.motion
    distance, drift = near.distance, object_speed(j, v)
    whole = need + drift * m.span.settled
    by_levers = less_reach(distance - whole, i, j, plan_i, plan_j, w)
    blunt = not distance > 0.0 or coarse(i, v, m) or coarse(j, v, m)
    if not relieved and (blunt or is_plenty(by_levers, i, j, near, w, v, m)):
        return (PROVEN if by_levers >= 0.0 else NEEDED, by_levers)
    if m.effort.tests >= m.effort.budget:
        return (PROVEN if by_levers >= 0.0 else SPENT, by_levers)
    m.effort.tests += 1
    p = new_pair()
    p.need, p.drift = need, drift
    describe_pair(i, j, plan_i, plan_j, w, m, p)
    n = normal_of(near)
    by_path = path_gap(n, p, m) - whole
    spare = max(by_levers, by_path)
    if by_path > by_levers:
        near.envelope = OF_PRIMITIVES
    has_exact = w.exact_of[i, 1] != 0 or w.exact_of[j, 1] != 0
    if has_exact and not spare >= PLENTY:
        by_shapes = look_at_exact(i, j, w, p)
        if by_shapes > spare:
            m.effort.beyond_primitives = 1
            spare = by_shapes
            near.envelope = OF_EXACT
        describe_pair(i, j, plan_i, plan_j, w, m, p)
    if spare >= (LITTLE if m.span.segment == 0 else 0.0):
        return (PROVEN, spare)
    return prove_halved(i, j, near, spare, relieved, w, p)


@kernel
def less_reach(
    left: float, i: int, j: int, plan_i: int, plan_j: int, w: Workspace
) -> float:
    """A length less how far two primitives may approach on their stop paths [m].

    It bounds the travel of each by the levers of the joints that move it against the
    other one. The arguments are those of `prove_need`.
    """
    m = w.motion
    shared = shared_joints(w.bodies[i], w.bodies[j], m)
    if shared == 0:
        left -= m.reach[plan_i, i]
        if j < m.rate.shape[0]:
            left -= m.reach[plan_j, j]
    else:
        left -= own_sum(i, w.bodies[i], shared, m.spread[plan_i], m)
        left -= own_sum(j, w.bodies[j], shared, m.spread[plan_j], m)
    return left


@kernel
def prove_halved(
    i: int, j: int, near: NearRow, spare: float, relieved: bool, w: Workspace, p: Pair
) -> tuple[int, float]:
    """Prove a pair by spans of its stop paths, first of primitives, then exact.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        near: The pair's row.
        spare: Headroom over the whole paths, negative for a deficit [m].
        relieved: Whether the distance to keep was reduced for a recovery.
        w: The workspace.
        p: The pair, described.

    Returns:
        How the proof ended, and the headroom, negative for a deficit [m].
    """
    m = w.motion
    known = spare if spare >= 0.0 else -inf
    proof, by_spans = prove_by_spans(known, p, m)
    if proof == PROVEN and by_spans > spare:
        m.effort.beyond_primitives = 1 if relieved else 0
        near.envelope = OF_PRIMITIVES
        return (proof, by_spans)
    if spare >= 0.0:
        return (PROVEN, spare)
    if proof == SPENT:
        return (proof, spare)
    near.envelope = OF_PRIMITIVES
    if w.exact_of[i, 1] == 0 and w.exact_of[j, 1] == 0:
        return (proof, by_spans)
    m.effort.beyond_primitives = 1
    exact, by_exact = prove_exact(i, j, w, p)
    if exact == SPENT:
        return (exact, by_spans)
    if exact == PROVEN or by_exact > by_spans:
        near.envelope = OF_EXACT
        return (exact, by_exact)
    return (proof, by_spans)


@kernel
def is_evaded(i: int, j: int, v: Watch) -> bool:
    """Whether a robot is evading an object.

    The object approaches even if the robot stops, so a stop in its path gives no
    protection. The robot is led by the predicted path of the object.

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
def evaded_clusters(r: int, v: Watch) -> int:
    """Bit set of the clusters that a robot evades."""
    found = 0
    for c in range(v.cluster_evaded.shape[0]):
        found |= ((v.cluster_evaded[c] >> r) & 1) << c
    return found


@kernel
def rests_among_cells(i: int, j: int, plan_i: int, w: Workspace) -> bool:
    """Whether no stop changes a pair of an evading robot and of cells that grow.

    A stop of the robot does not move the primitive, nor protect it. The evasion of a
    cluster need not end for that.

    Args:
        i: Primitive of the robot.
        j: The cells.
        plan_i: The stop of the robot, NEXT or NOW.
        w: The workspace.
    """
    v, r = w.watch, robot_of(i, w.watch)
    grows = j >= w.settings.modelled and object_speed(j, v) > 0.0
    if not grows or r < 0 or v.phase[r] != RECOVERING:
        return False
    return bool(w.motion.reach[plan_i, i] == 0.0 and evaded_clusters(r, v) != 0)


@kernel
def is_plenty(
    spare: float, i: int, j: int, near: NearRow, w: Workspace, v: Watch, m: Motion
) -> bool:
    """Whether a pair's headroom is so large that a coarse bound suffices."""
    time = LOOK_AHEAD * v.timing.slow_time
    if spare >= time * closing_speed(i, j, w, v, m):
        return True
    if not spare >= NEAR_CUE:
        return False
    return bool(spare >= time * rate_along_normal(i, j, near, w, v, m))


@kernel
def describe_pair(
    i: int,
    j: int,
    plan_i: int,
    plan_j: int,
    w: Workspace,
    m: Motion,
    p: Pair,
) -> None:
    """Write a pair of primitives into a `Pair`, all but what it needs."""
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


@kernel(separate=True)
def look_at_exact(i: int, j: int, w: Workspace, p: Pair) -> float:
    """Lower bound of the headroom of the exact shapes of both sides, by one test [m].

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
            m.effort.tests += 1
            _, gap, bend = span_gap(WHOLE_PATH, p, m)
            left = gap - bend - p.need - p.drift * m.span.settled
            if not left >= 0.0:
                return -inf
            least = min(least, left)
    return least


@kernel(separate=True)
def prove_exact(i: int, j: int, w: Workspace, p: Pair) -> tuple[int, float]:
    """Prove by spans that all pairs of exact shapes of both sides keep the distance.

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
    """Write one exact shape of a primitive's link into a side of a `Pair`."""
    if w.exact_of[i, 1] == 0:
        return
    e = w.exact_of[i, 0] + which
    p.kind[side] = w.exact_kinds[e]
    for c in range(ROW_WIDTH):
        p.local[side, c] = w.exact_rows[e, c]
    p.exact[side] = e


@kernel
def coarse(i: int, v: Watch, m: Motion) -> bool:
    """Whether a side is judged by levers and speed alone.

    True if its robot's mode is "speed", or if that robot brakes, since no proof could
    demand more.
    """
    r = robot_of(i, v)
    if r < 0 or m.span.segment != 0:
        return False
    brakes = v.phase[r] == BRAKING or v.phase[r] == LOST
    return bool(m.robot_figures[r].mode == SPEED or brakes)
