"""Re-use of proofs after a change of command: a bound on the additional travel.

A cycle proves its pairs for the pending commands, and then for the desired ones, which
differ little. If no joint can at any time get farther than δ beyond where it could get
before, no two points can approach by more than the sum of δ times levers. A pair with
more headroom than that is proven by this sum; all others are judged again.

The additional travel of a joint is greatest at the end: a command of greater velocity
leaves the joint faster at every time, as long as the stop takes effect at the same
time. A stop that settles later may swing at times at which the joint rested before.
"""

from math import inf

from armguard.guard.demands import judge_motion
from armguard.guard.layout import NearRow
from armguard.guard.levels import Reason
from armguard.guard.near_pairs import decide
from armguard.guard.needs import object_speed
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.joint_stop import rest_way, whole_way
from armguard.motion.pair_state import PROVEN
from armguard.motion.state import (
    PLANS,
    Motion,
    StopClock,
)
from armguard.robot.kinematics import FIXED as NO_JOINT

CAPACITY = int(Reason.CAPACITY)
NO_DISTANCE = int(Reason.NO_DISTANCE)
OK = int(Reason.OK)

# Row index of a pair that has no row in the answer.
NO_ROW = -1

# Count if there were more pairs than room: some pairs were not recorded.
TOO_MANY = -1


@kernel
def begin_notes(v: Watch, m: Motion) -> None:
    """Record the planned stops before the pairs are judged for them."""
    v.judged_count[0] = TOO_MANY if v.given.commanded == 0 else 0
    if v.judged_count[0] == TOO_MANY:
        return
    n = m.q.shape[0]
    for at in range(PLANS * n):
        for side in range(2):
            stop = m.up[at] if side == 0 else m.down[at]
            judged = v.judged_stops[2 * at + side]
            judged.travel, judged.opposite_speed = whole_way(stop), stop.opposite_speed
            judged.settled, judged.rest_travel = stop.settled, rest_way(stop)
    for at in range(v.judged_clock.shape[0]):
        v.judged_clock[at] = m.clock[at]
    v.judged_settled[0] = m.span.settled


@kernel
def note_pair(i: int, j: int, row: int, near: NearRow, w: Workspace, v: Watch) -> None:
    """Record the headroom of a judged pair."""
    k = v.judged_count[0]
    if k == TOO_MANY:
        return
    if k == v.judged_pairs.shape[0]:
        v.judged_count[0] = TOO_MANY
        return
    m = w.motion
    plain = near.proof == PROVEN and m.effort.beyond_primitives == 0
    v.judged_pairs[k, 0], v.judged_pairs[k, 1], v.judged_pairs[k, 2] = i, j, row
    v.judged_left[k] = near.headroom if plain else -inf
    v.judged_count[0] = k + 1


@kernel(separate=True)
def proves_change(w: Workspace) -> bool:
    """Prove all pairs for stops that changed since they were judged in this cycle.

    Args:
        w: The workspace; the changed stops are planned already.

    Returns:
        Whether every pair is decided; if not, all pairs have to be judged again.
    """
    v, m = w.watch, w.motion
    return bool(is_known(w, v) and bound_growth(w, v, m) and renew(w))


@kernel
def is_known(w: Workspace, v: Watch) -> bool:
    """Whether all judged pairs were recorded, and the answer is complete."""
    reason = int(w.header.reason)
    commanded = reason != CAPACITY and reason != NO_DISTANCE
    return bool(commanded and v.judged_count[0] != TOO_MANY)


@kernel
def bound_growth(w: Workspace, v: Watch, m: Motion) -> bool:
    """Bound the additional travel of each primitive since the pairs were judged.

    Returns:
        Whether no primitive gets farther than the search allowed for.
    """
    moving = m.rate.shape[0]
    for b in range(m.parent.shape[0]):
        m.sizes[b] = 0.0
        if m.joint_kind[b] != NO_JOINT:
            q = m.q_index[b]
            m.sizes[b] = abs(m.gain[b, 0]) * joint_growth(q, v, m)
    for i in range(moving):
        body = w.bodies[i]
        grown = 0.0
        for k in range(m.length[body]):
            size = m.sizes[m.joints[body, k]]
            if size != 0.0:
                grown += size * m.levers[i, k]
        if not grown <= v.ahead[i]:
            return False
        v.grown[i] = grown
    return True


@kernel
def joint_growth(j: int, v: Watch, m: Motion) -> float:
    """Bound on the additional travel of a joint at any time [rad].

    Infinite where that does not follow from its total travel.
    """
    n, robots = m.q.shape[0], m.robot_figures.shape[0]
    growth = 0.0
    for plan in range(PLANS):
        at = plan * robots + m.robot_of_joint[j]
        if not same_clock(m.clock[at], v.judged_clock[at]):
            return inf
        at = plan * n + j
        for side in range(2):
            stop = m.up[at] if side == 0 else m.down[at]
            judged = v.judged_stops[2 * at + side]
            if judged.opposite_speed != stop.opposite_speed:
                # Its motion may now also continue in this direction.
                return inf
            later = stop.settled > judged.settled
            least = min(judged.travel, judged.rest_travel) if later else judged.travel
            growth = max(growth, whole_way(stop) - least)
    return float(growth)


@kernel
def same_clock(a: StopClock, b: StopClock) -> bool:
    """Whether two stops have equal delays."""
    return bool(
        a.age == b.age
        and a.reaction == b.reaction
        and a.passed == b.passed
        and a.braking == b.braking
        and a.still == b.still
        and a.swings == b.swings
    )


@kernel(separate=True)
def renew(w: Workspace) -> bool:
    """Prove the recorded pairs again.

    Returns:
        False if a pair without a row has to be judged, which needs all pairs again.
    """
    v, m = w.watch, w.motion
    longer = max(m.span.settled - v.judged_settled[0], 0.0)
    moving = m.rate.shape[0]
    w.header.reason, w.header.nearest = OK, -1.0
    for k in range(v.judged_count[0]):
        i, j = int(v.judged_pairs[k, 0]), int(v.judged_pairs[k, 1])
        row = int(v.judged_pairs[k, 2])
        left = v.judged_left[k] - v.grown[i]
        left -= v.grown[j] if j < moving else object_speed(j, v) * longer
        if left >= 0.0:
            if row != NO_ROW:
                near = w.near[row]
                near.headroom, near.proof = left, PROVEN
        elif row == NO_ROW:
            return False
        else:
            judge_motion(i, j, w.near[row], w)
    decide(int(w.header.near_count), w)
    return True
