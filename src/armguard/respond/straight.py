"""Straight approach under a contract: an arm slows down along its requested direction.

Near a grasp target, or a place where an object is put down, a contract bounds the speed
more and more. A quadratic program would find a velocity nearer to the request that
moves aside or tilts the hand, and the operator would have to correct that. So the whole
arm slows down in proportion from where the contract begins. Fingers do not: a finger
that touches already would delay the other one.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import norm
from armguard.guard.contact_speed import GRANTED, allowed_speed
from armguard.guard.contracts import contract_of
from armguard.guard.grips import ContractKind, ContractRow, ContractState
from armguard.guard.intent import TOWARDS, velocity_of
from armguard.guard.needs import robot_of
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import NEXT, Motion
from armguard.respond.state import ROWS, Response

Floats = NDArray[np.float64]


@kernel(inline=False)
def reaches_anything(w: Workspace) -> bool:
    """Whether any contract is in force; else no pair has to be checked for one."""
    if w.settings.intents == 0:
        return False
    h = w.grips
    for k in range(h.contracts.shape[0]):
        if h.contracts[k].state == ContractState.IN_FORCE:
            return True
    return False


@kernel(inline=False)
def straight_contract(
    r: int, i: int, j: int, a: Response, w: Workspace, v: Watch, m: Motion
) -> int:
    """Contract under which a robot approaches a body straight; -1 if none.

    A robot that slides along a body is bounded by its program instead.

    Args:
        r: The robot.
        i: First primitive.
        j: Second primitive.
        a: Responses; `raw` holds the distance gradient of the pair.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    if a.settings[r].solves == 0:
        return -1
    h = w.grips
    k = contract_of(i, j, h)
    if k < 0:
        return -1
    c = h.contracts[k]
    if c.state != ContractState.IN_FORCE or not (
        c.kind == ContractKind.INTENT or c.kind == ContractKind.SUPPORT
    ):
        return -1
    if robot_of(c.first_a, v) != r:
        # Only the robot of the contract's first side approaches under it.
        return -1
    point = (c.point[0], c.point[1], c.point[2])
    velocity = velocity_of(point, int(w.bodies[c.first_a]), a.requested, m)
    first = m.robot_figures[r].first_joint
    closing = 0.0
    for q in range(first, first + m.robot_figures[r].joint_count):
        closing += a.raw[q] * a.requested[q]
    return k if closing >= TOWARDS * norm(velocity) else -1


@kernel(inline=False)
def slow_to_contract(
    r: int, k: int, part: float, distance: float, a: Response, w: Workspace, m: Motion
) -> None:
    """Slow an arm down to the closing speed that its contract permits.

    Args:
        r: The robot.
        k: Index of the contract.
        part: Share of the robot in that speed [-].
        distance: Signed distance of the pair [m].
        a: Responses; `raw` holds the distance gradient of the pair, `target` is
            changed.
        w: Workspace.
        m: Motion.
    """
    h = w.grips
    c = h.contracts[k]
    limit = part * granted_speed(r, distance, c, m)
    slow_arm(r, share_kept(r, a.raw, limit, c, a, w, m), c, a, w, m)


@kernel(inline=False)
def slow_to_rows(
    r: int, k: int, begin: int, a: Response, w: Workspace, m: Motion
) -> None:
    """Slow an arm down until it satisfies the rows of a pair, at most to standstill.

    Args:
        r: The robot.
        k: Index of the contract of the pair.
        begin: First row of the pair; its rows are the last ones of the program.
        a: Responses; `target` is changed.
        w: Workspace.
        m: Motion.
    """
    h = w.grips
    c = h.contracts[k]
    kept = 1.0
    for row in range(begin, a.notes[r].row_count):
        at = r * ROWS + row
        kept = min(kept, share_kept(r, a.rows[at], a.limits[at], c, a, w, m))
    slow_arm(r, kept, c, a, w, m)


@kernel
def share_kept(
    r: int,
    row: Floats,
    limit: float,
    c: ContractRow,
    a: Response,
    w: Workspace,
    m: Motion,
) -> float:
    """Share of an arm's target that satisfies a row, in [0, 1] [-]."""
    first = m.robot_figures[r].first_joint
    reached = 0.0
    for q in range(first, first + m.robot_figures[r].joint_count):
        if not is_finger(q, c, w, m):
            reached += row[q] * a.target[q]
    if not reached > limit or not reached > 0.0:
        return 1.0
    return float(max(limit, 0.0) / reached)


@kernel
def slow_arm(
    r: int, kept: float, c: ContractRow, a: Response, w: Workspace, m: Motion
) -> None:
    """Scale an arm's target by a share, but brake no harder than its declared stop."""
    if kept >= 1.0:
        return
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    share = kept
    for q in range(first, end):
        # No joint brakes harder than its declared stop.
        if not is_finger(q, c, w, m) and a.target[q] * a.brake[q] > 0.0:
            share = max(share, min(a.brake[q] / a.target[q], 1.0))
    for q in range(first, end):
        if not is_finger(q, c, w, m):
            a.target[q] = min(max(share * a.target[q], a.low[q]), a.high[q])


@kernel
def granted_speed(r: int, distance: float, c: ContractRow, m: Motion) -> float:
    """Closing speed that a response uses under a contract [m/s]."""
    time = m.clock[NEXT * m.robot_figures.shape[0] + r].reaction
    return float(GRANTED * allowed_speed(distance, time, c))


@kernel
def is_finger(q: int, c: ContractRow, w: Workspace, m: Motion) -> bool:
    """Whether a joint moves a finger of a contract's gripper, but not the gripper."""
    if c.kind != ContractKind.INTENT:
        return False
    h = w.grips
    own = h.grippers[c.gripper]
    if moves(q, own.body, m):
        return False
    for f in range(own.first_finger, own.end_finger):
        if moves(q, int(w.bodies[h.fingers[f].first]), m):
            return True
    return False


@kernel
def moves(q: int, body: int, m: Motion) -> bool:
    """Whether a joint moves a body."""
    for i in range(m.length[body]):
        if m.q_index[m.joints[body, i]] == q:
            return True
    return False
