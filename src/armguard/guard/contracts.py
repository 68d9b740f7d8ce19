"""Intended contacts: proof of a pair under a contact contract.

A contract never requires more than a pair needs without it. It lets the pair be nearer
than its buffer, and overlap by `depth`, as long as its closing speed is at most

    creep + gain · distance

at every distance that may be reached before an order takes effect. The depth is proven
until all robots are at rest, with the declared errors of measurement and tracking. The
speed is the commanded one, or, without a command filter, the measured one; tracking
errors are added to it.
"""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.vec3 import Vec3
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.contact_speed import COMMANDED_ANEW, closing_commanded, speed_at
from armguard.guard.grips import ANYWHERE, WORLD, ContractRow, ContractState, Grips
from armguard.guard.layout import NearRow, point_of
from armguard.guard.needs import object_speed, robot_of, time_since
from armguard.guard.proofs import prove_pair
from armguard.guard.refine import exact_row, refine_pair
from armguard.guard.watch import RECOVERING
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.pair_proof import path_gap, shared_joints
from armguard.motion.pair_state import (
    ALLOWED,
    EXCEEDED,
    PROVEN,
    SPENT,
    UNPROVEN,
    Pair,
    new_pair,
)
from armguard.motion.state import (
    NOW,
    Motion,
)

Floats = NDArray[np.float64]


# Headroom from which on a coarse bound suffices [m].
PLENTY = 0.02

# Round-off of a speed [m/s].
GRAIN = 1e-9


@kernel
def prove(
    i: int, j: int, plan_i: int, plan_j: int, near: NearRow, w: Workspace
) -> tuple[int, float]:
    """Prove that a pair keeps its buffer or contract; see `prove_with_contract`."""
    if w.settings.contracts != 0:
        return prove_with_contract(i, j, plan_i, plan_j, near, w)
    return prove_pair(i, j, plan_i, plan_j, near, w)


@kernel(separate=True, optional=True)
def prove_with_contract(
    i: int, j: int, plan_i: int, plan_j: int, near: NearRow, w: Workspace
) -> tuple[int, float]:
    """Prove that a pair keeps its buffer, or the depth and speed of its contract.

    Args:
        i: First primitive.
        j: Second primitive.
        plan_i: NEXT or NOW, the stop of the robot of the first.
        plan_j: NEXT or NOW, the stop of the robot of the second.
        near: The pair's row.
        w: The workspace.

    Returns:
        How the proof ended, and the headroom, negative for a deficit [m].
    """
    v, m, h = w.watch, w.motion, w.grips
    k = -1
    if h.may[w.groups[i], w.groups[j]] != 0 and m.span.segment == 0:
        k = contract_of(i, j, h)
    if k < 0:
        return prove_pair(i, j, plan_i, plan_j, near, w)
    c = h.contracts[k]
    if c.state == ContractState.DORMANT:
        note_nearest(i, near, c)
        return prove_pair(i, j, plan_i, plan_j, near, w)
    kept, spare = keep_contract(i, j, plan_i, plan_j, near, k, w)
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    if kept and c.state == ContractState.IN_FORCE:
        near.buffer = -c.depth
        return (ALLOWED, spare)
    before_i, deficit_i = v.relieved[robot_i], v.deficit[robot_i]
    before_j, deficit_j = before_i, deficit_i
    v.relieved[robot_i] = 0
    if robot_j >= 0 and robot_j != robot_i:
        before_j, deficit_j = v.relieved[robot_j], v.deficit[robot_j]
        v.relieved[robot_j] = 0
    proof, left = prove_pair(i, j, plan_i, plan_j, near, w)
    eased = v.relieved[robot_i] != 0 or (robot_j >= 0 and v.relieved[robot_j] != 0)
    needs = proof != PROVEN or eased
    if needs:
        c.used = 1
    if kept:
        # A contact under a contract needs no recovery; under an expired one it does.
        eased = c.state == ContractState.EXPIRED and needs
        v.deficit[robot_i] = deficit_i
        if robot_j >= 0 and robot_j != robot_i:
            v.deficit[robot_j] = deficit_j
    v.relieved[robot_i] = 1 if eased else before_i
    if robot_j >= 0 and robot_j != robot_i:
        v.relieved[robot_j] = 1 if eased else before_j
    if not needs:
        return (proof, left)
    if kept and c.state == ContractState.EXPIRED:
        return (PROVEN, spare)
    if kept:
        near.buffer = -c.depth
        return (ALLOWED, spare)
    kept = proof == PROVEN or proof == SPENT or proof == UNPROVEN
    return (proof if kept else EXCEEDED, left)


@kernel
def keep_contract(
    i: int, j: int, plan_i: int, plan_j: int, near: NearRow, k: int, w: Workspace
) -> tuple[bool, float]:
    """Whether a pair keeps depth and speed of its contract on its stop paths.

    Args:
        i: First primitive.
        j: Second primitive.
        plan_i: NEXT or NOW, the stop of the robot of the first.
        plan_j: NEXT or NOW, the stop of the robot of the second.
        near: The pair's row; its witness is refined.
        k: Row of the contract.
        w: The workspace.

    Returns:
        Whether it does, and its headroom above the depth; -inf if the contract does
        not apply [m].
    """
    v, m = w.watch, w.motion
    c = w.grips.contracts[k]
    # The contract has to be checked again whenever commands change.
    m.effort.beyond_primitives = 1
    refine_pair(i, j, near, w)
    note_nearest(i, near, c)
    robot_j = robot_of(j, v)
    recovers = v.phase[robot_of(i, v)] == RECOVERING
    if robot_j >= 0:
        recovers |= v.phase[robot_j] == RECOVERING
    expired = c.state == ContractState.EXPIRED
    if (expired and not recovers) or not is_inside(near, c, w):
        return (False, -inf)
    spare = c.depth + least_gap(i, j, plan_i, plan_j, near, -c.depth, w)
    closing, time = closing_commanded(i, j, plan_i, plan_j, near, w, v, m)
    known, _ = closing_commanded(i, j, NOW, NOW, near, w, v, m)
    share = COMMANDED_ANEW if closing > known + GRAIN else 1.0
    # A moving object may have approached since it was seen, and may approach on.
    drift = object_speed(j, v)
    if drift > 0.0:
        spare -= drift * (time_since(v.seen_at[j], v, m) + m.span.settled)
        closing += drift
    distance = near.distance - max(closing, 0.0) * time
    # An expired contract still lets a pair that is near separate.
    most = 0.0 if expired else share * speed_at(max(distance, 0.0), c)
    return (spare >= 0.0 and closing <= most + GRAIN, spare)


@kernel
def contract_of(i: int, j: int, h: Grips) -> int:
    """Row of the contract of a pair of primitives; -1 if it has none.

    Of several, the one with the lowest state, and of these the greatest depth.
    """
    rows = h.contracts
    found = -1
    for k in range(rows.shape[0]):
        c = rows[k]
        if c.state == ContractState.NONE or not (is_of(i, j, c) or is_of(j, i, c)):
            continue
        # States are numbered in order of precedence.
        if (
            found < 0
            or c.state < rows[found].state
            or (c.state == rows[found].state and c.depth > rows[found].depth)
        ):
            found = k
    return found


@kernel
def is_of(a: int, b: int, c: ContractRow) -> bool:
    """Whether primitive a is part of a contract's body A and b of its body B."""
    return bool(c.first_a <= a < c.end_a and c.first_b <= b < c.end_b)


@kernel
def note_nearest(i: int, near: NearRow, c: ContractRow) -> None:
    """Store distance, normal and witness point of a contract's nearest pair."""
    if not near.distance < c.nearest:
        return
    c.nearest = near.distance
    forward = c.first_a <= i < c.end_a
    for k in range(3):
        c.normal[k] = near.normal[k] if forward else -near.normal[k]
        c.point[k] = near.point_a[k] if forward else near.point_b[k]


@kernel
def is_inside(near: NearRow, c: ContractRow, w: Workspace) -> bool:
    """Whether a pair's two witness points lie in its contract's region."""
    if c.region == ANYWHERE:
        return True
    for side in range(2):
        x, y, z = in_frame(point_of(near, side), c, w)
        if not (abs(x) <= c.half[0] and abs(y) <= c.half[1] and abs(z) <= c.half[2]):
            return False
    return True


@kernel
def in_frame(point: Vec3, c: ContractRow, w: Workspace) -> Vec3:
    """A point of the world, in the frame of a contract's region [m]."""
    x, y, z = point
    if c.region != WORLD:
        x, y, z = back(x, y, z, w.T_world[c.region])
    return back(x, y, z, c.T_region)


@kernel
def back(x: float, y: float, z: float, T: Floats) -> tuple[float, float, float]:
    """A point of the outer frame, in the frame whose pose is T [m]."""
    x, y, z = x - T[3], y - T[7], z - T[11]
    return (
        T[0] * x + T[4] * y + T[8] * z,
        T[1] * x + T[5] * y + T[9] * z,
        T[2] * x + T[6] * y + T[10] * z,
    )


@kernel(separate=True)
def least_gap(
    i: int, j: int, plan_i: int, plan_j: int, near: NearRow, need: float, w: Workspace
) -> float:
    """Lower bound of a pair's signed distance on the stop path, by exact shapes [m].

    Valid apart and overlapping: the gap of two bodies along any direction is at most
    their signed distance.

    Args:
        i: First primitive.
        j: Second primitive.
        plan_i: NEXT or NOW, the stop of the robot of the first.
        plan_j: NEXT or NOW, the stop of the robot of the second.
        near: The pair's row.
        need: Distance to be kept; far beyond it a quick bound suffices [m].
        w: The workspace.
    """
    m = w.motion
    moving = m.rate.shape[0]
    by_levers = near.outer - m.reach[plan_i, i]
    if j < moving:
        by_levers -= m.reach[plan_j, j]
    if by_levers >= need + PLENTY:
        return float(by_levers)
    p = new_pair()
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    p.shared = shared_joints(w.bodies[i], w.bodies[j], m)
    p.need = p.drift = 0.0
    p.plan[0], p.plan[1] = plan_i, plan_j
    least = inf
    for a in range(max(w.exact_of[i, 1], 1)):
        describe_side(i, a, 0, w, m, p)
        for b in range(max(w.exact_of[j, 1], 1)):
            describe_side(j, b, 1, w, m, p)
            measure(p.kind[0], p.row[0], p.kind[1], p.row[1], witness)
            n = (witness[7], witness[8], witness[9])
            gap = path_gap(n, p, m)
            if not gap >= least:
                least = gap
    return float(max(by_levers, least))


@kernel
def describe_side(
    i: int, which: int, side: int, w: Workspace, m: Motion, p: Pair
) -> None:
    """Describe one side of a pair by one of its exact shapes, at its present pose."""
    moving = m.rate.shape[0]
    p.kind[side] = exact_row(i, which, w, p.row[side])
    p.body[side] = w.bodies[i]
    p.primitive[side], p.exact[side] = min(i, moving - 1), -1
    if w.exact_of[i, 1] > 0 and i < moving:
        p.exact[side] = w.exact_of[i, 0] + which


@kernel
def open_contract(k: int, h: Grips) -> None:
    """Put a contract in force, and mark the groups of its bodies."""
    c = h.contracts[k]
    c.state = ContractState.IN_FORCE
    c.nearest, c.used = inf, 0
    a, b = c.group_a, c.group_b
    h.may[a, b] = h.may[b, a] = 1


@kernel
def close_contract(k: int, h: Grips) -> None:
    """End a contract; its groups stay marked if they have another one."""
    c = h.contracts[k]
    c.state = ContractState.NONE
    a, b = c.group_a, c.group_b
    for x in range(h.contracts.shape[0]):
        other = h.contracts[x]
        if other.state == ContractState.NONE:
            continue
        one, two = other.group_a, other.group_b
        if (one == a and two == b) or (one == b and two == a):
            return
    h.may[int(a), int(b)] = h.may[int(b), int(a)] = 0
