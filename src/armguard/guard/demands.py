"""Choice of the robots that must stop for a pair.

Every cycle proves that a stop ordered in the next cycle is still in time. Where that
proof fails for a pair, the last cycle has proven it for a stop that is ordered now. If
it suffices that one of two robots stops now, the other may go on.
"""

from math import inf

from armguard.guard.contracts import prove
from armguard.guard.layout import NearRow
from armguard.guard.levels import Reason
from armguard.guard.needs import closing_speed, rate_along_normal, robot_of
from armguard.guard.proofs import OF_WITNESS, coarse
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.figures import FIXED
from armguard.motion.pair_state import (
    ALLOWED,
    EXCEEDED,
    NEEDED,
    PROVEN,
    SPENT,
    UNPROVEN,
)
from armguard.motion.state import NEXT, NOW

TOO_CLOSE = int(Reason.TOO_CLOSE)
NO_PROOF = int(Reason.NO_PROOF)
BUDGET_SPENT = int(Reason.BUDGET_SPENT)
CONTRACT_EXCEEDED = int(Reason.CONTRACT_EXCEEDED)

# Least share of a closing speed from which on a robot takes part in it [-].
OWN_SHARE = 0.25


@kernel(separate=True)
def judge_motion(i: int, j: int, near: NearRow, w: Workspace) -> None:
    """Write headroom and time left of a measured pair; demand stops without a proof.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        near: The pair's row; its witness is written already.
        w: The workspace; robots that must stop are marked.
    """
    v, m = w.watch, w.motion
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    m.effort.beyond_primitives = 0
    near.envelope = OF_WITNESS
    proof, spare = prove(i, j, NEXT, NEXT, near, w)
    judged = near.envelope
    near.headroom = spare
    near.proof = proof
    if proof == ALLOWED:
        return
    closing = closing_speed(i, j, w, v, m)
    left = 0.0
    if spare > 0.0:
        speed = closing
        if not (coarse(i, v, m) or coarse(j, v, m)):
            speed = min(closing, rate_along_normal(i, j, near, w, v, m))
        left = spare / speed if speed > 0.0 else inf
    near.time_left = left
    # The time is short only for an approaching robot, not for a parked one.
    for side in range(2):
        k, r = (i, robot_i) if side == 0 else (j, robot_j)
        if r >= 0 and not left >= v.time_left[r]:
            if robot_j < 0 or robot_i == robot_j or m.rate[k] >= OWN_SHARE * closing:
                v.time_left[r] = left
    if proof != PROVEN and proof != UNPROVEN and m.span.segment == 0:
        demand_stops(i, j, near, proof, w)
        near.envelope = judged


@kernel
def demand_stops(i: int, j: int, near: NearRow, proof: int, w: Workspace) -> None:
    """Demand a stop of the robots by which a pair without a proof can have one again.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        near: The pair's row; its envelope may be overwritten.
        proof: How its proof ended.
        w: The workspace; robots that must stop are marked.
    """
    v, m = w.watch, w.motion
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    cause = TOO_CLOSE if proof == NEEDED else NO_PROOF
    if proof == SPENT:
        cause = BUDGET_SPENT
    if proof == EXCEEDED:
        cause = CONTRACT_EXCEEDED
    if robot_j < 0 or robot_j == robot_i:
        demand_stop(robot_i, cause, v)
        return
    fixed_i = m.robot_figures[robot_i].mode == FIXED
    fixed_j = m.robot_figures[robot_j].mode == FIXED
    if fixed_i or fixed_j:
        # A fixed robot stops when its buffer is broken; the other needs a proof.
        broken = not near.distance >= near.buffer
        if broken or not fixed_i:
            demand_stop(robot_i, cause, v)
        if broken or not fixed_j:
            demand_stop(robot_j, cause, v)
        return
    one, other = robot_i, robot_j
    if m.rate[j] > m.rate[i]:
        one, other = robot_j, robot_i
    for attempt in range(2):
        # First the one that moves faster, then the other one alone.
        stopped = one if attempt == 0 else other
        plan_i = NOW if stopped == robot_i else NEXT
        plan_j = NOW if stopped == robot_j else NEXT
        found = prove(i, j, plan_i, plan_j, near, w)
        if found[0] == PROVEN or found[0] == ALLOWED:
            demand_stop(stopped, cause, v)
            return
    demand_stop(one, cause, v)
    demand_stop(other, cause, v)


@kernel
def demand_stop(r: int, cause: int, v: Watch) -> None:
    """Demand that a robot stops, or stays at rest; the first cause is kept."""
    if v.must[r] == 0:
        v.must[r] = 1
        v.cause[r] = cause
