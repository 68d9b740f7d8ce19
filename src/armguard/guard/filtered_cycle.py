"""The cycle of a guard that filters commands, in two halves.

Joint angles -> plausible? -> stops -> poses -> pairs, proven for the pending commands
-> (a response chooses the desired velocities) -> proven for these, or less -> sent.
A command without a proof is not sent. If not even the pending commands can be proven
any longer, the robot is stopped, which the last cycle has proven to be in time.
"""

from armguard.guard.change import TOO_MANY, proves_change
from armguard.guard.commands import (
    hold_still,
    is_new,
    keep_under_way,
    send,
    set_drives,
)
from armguard.guard.contract_cycle import judge_all
from armguard.guard.cycle import clear_header
from armguard.guard.demands import demand_stop
from armguard.guard.guarded_cycle import conclude, judge_input, refuse
from armguard.guard.levels import Reason
from armguard.guard.limits import report_measured_limits
from armguard.guard.observe import now_of
from armguard.guard.proofs import evaded_clusters
from armguard.guard.sensed_search import begin_again, begin_work
from armguard.guard.stops import set_clocks
from armguard.guard.watch import (
    AT_REST,
    AT_WORK,
    GIVES_UP,
    LEAVES,
    RECOVERING,
    RESTING,
    RUNNING,
    Watch,
)
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import (
    NEXT,
    NOW,
    Motion,
)
from armguard.motion.stop_path import bound_reaches, plan_stops
from armguard.table import Vector

OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)
TOO_CLOSE = int(Reason.TOO_CLOSE)

# Shares of the part beyond the pending commands that are tried in turn [-].
SHARES = (0.5, 0.25, 0.0)


@kernel(separate=True)
def open_cycle(q: Vector, w: Workspace) -> int:
    """First half: judge every pair for the measured state and the pending commands.

    Args:
        q: Joint positions, shape (n,) if the input is valid [rad or m].
        w: The workspace; its state, memory and `out` are updated.

    Returns:
        1 if the input could be judged, else 0.
    """
    v, m = w.watch, w.motion
    v.given.commanded = 1
    for j in range(v.wanted.shape[0]):
        v.wanted[j] = v.commanded[j]
    clear_header(w)
    if not judge_input(q, w):
        return 0
    report_measured_limits(q, w, v, m)
    if w.header.reason == OUT_OF_LIMITS:
        refuse(w)
        return 0
    return 1


@kernel(separate=True)
def close_cycle(judged: int, w: Workspace) -> None:
    """Second half: prove the desired velocities, or a part; order stops; send.

    Args:
        judged: Result of `open_cycle`.
        w: The workspace; `wanted` of its watch holds the desired velocities, and
            afterwards the ones that are sent.
    """
    v, m = w.watch, w.motion
    if judged != 0:
        begin_recoveries(w, v, m)
        prove_wanted(w)
        end_recoveries(w, v)
        for r in range(v.recover.shape[0]):
            if v.recover[r] == GIVES_UP:
                demand_stop(r, TOO_CLOSE, v)
        conclude(w)
    send(v, m)


@kernel
def begin_recoveries(w: Workspace, v: Watch, m: Motion) -> None:
    """Start the recoveries and evasions that the response has requested."""
    recover = v.recover
    for r in range(recover.shape[0]):
        phase = v.phase[r]
        may = recover[r] == LEAVES and phase == RESTING and v.must[r] != 0
        may |= recover[r] == AT_REST and phase == RESTING
        may |= recover[r] == AT_WORK and phase == RUNNING
        if may:
            if phase == RESTING:
                hold_still(r, v, m)
            v.phase[r] = RECOVERING
            v.relief[r] = v.deficit[r]
            v.relief_until[r] = now_of(v) + m.span.settled
            if evaded_clusters(r, v) != 0:
                # Cells that it need not keep away from any more have used up the work,
                # and half-spaces may stand for them.
                m.effort.tests = 0
                v.judged_count[0] = TOO_MANY
                begin_again(r, w.sensed)
        elif recover[r] != GIVES_UP:
            recover[r] = 0


@kernel(separate=True)
def prove_wanted(w: Workspace) -> None:
    """Prove the desired velocities; reduce them until the proof succeeds."""
    v, m = w.watch, w.motion
    begun = False
    for r in range(v.recover.shape[0]):
        # Whether its command still opens the pair that is too near is known only now.
        begun |= v.phase[r] == RECOVERING
        stops = v.phase[r] != RUNNING and v.phase[r] != RECOVERING
        if stops or v.recover[r] == GIVES_UP:
            keep_under_way(r, 0.0, v, m)
    if not (begun or is_new(v)):
        return
    judge_again(begun, w)
    for k in range(len(SHARES)):
        if not take_back(SHARES[k], v, m):
            return
        if SHARES[k] == 0.0:
            # What was spent on greater commands must not stop the pending ones.
            m.effort.tests = 0
            begin_work(w.sensed)
        judge_again(begun, w)


@kernel
def take_back(share: float, v: Watch, m: Motion) -> bool:
    """Reduce the desired velocities of robots that would have to stop for them.

    Returns:
        Whether there was such a robot.
    """
    found = False
    for r in range(v.must.shape[0]):
        if v.must[r] == 0 or v.recover[r] == GIVES_UP:
            continue
        evades = v.recover[r] == AT_REST or v.recover[r] == AT_WORK
        if v.recover[r] == LEAVES or (evades and share == 0.0):
            # This motion does not lead away; half of it would do so less surely.
            v.phase[r] = RUNNING if v.recover[r] == AT_WORK else RESTING
            v.recover[r] = 0
            if evaded_clusters(r, v) != 0:
                # Cells that it evaded may have no row.
                v.judged_count[0] = TOO_MANY
            keep_under_way(r, 0.0, v, m)
            found = True
        elif v.phase[r] == RECOVERING or (v.phase[r] == RUNNING and v.yields[r] != 0):
            keep_under_way(r, share, v, m)
            found = True
    return found


@kernel(separate=True)
def judge_again(recovers: bool, w: Workspace) -> None:
    """Judge all pairs for the present desired velocities.

    Args:
        recovers: Whether a robot was recovering before any command was reduced. If
            none was, the plan of a stop ordered now is still valid: only the desired
            velocities have changed.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    set_clocks(v, m)
    set_drives(v, m)
    for r in range(v.must.shape[0]):
        v.must[r] = v.relieved[r] = 0
        v.deficit[r] = 0.0
    for plan in (NEXT, NOW):
        if plan == NEXT or recovers:
            plan_stops(plan, m)
            bound_reaches(plan, w.bodies, m)
    if not proves_change(w):
        judge_all(w)


@kernel
def end_recoveries(w: Workspace, v: Watch) -> None:
    """End the recovery of a robot when no pair of it is too near any more.

    An evasion goes on while cells that the robot evades are near.
    """
    for r in range(v.phase.shape[0]):
        near = v.relieved[r] != 0 or v.must[r] != 0 or w.sensed.evaded[r] != 0
        if v.phase[r] == RECOVERING and not near:
            v.phase[r] = RUNNING
