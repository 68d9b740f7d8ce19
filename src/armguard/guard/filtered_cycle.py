"""The cycle of a guard that commands go through, in two halves.

Joint angles -> believed? -> stops -> poses -> pairs, proven for what is under way
-> (somebody chooses what to tell the joints) -> proven with that, or less -> sent.
What cannot be proven is not sent. If not even what is under way can be proven any
longer, the robot is stopped, which the last cycle has proven to be in time.
"""

from armguard.guard.change import proves_change
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
from armguard.guard.layout import REASON
from armguard.guard.levels import Reason
from armguard.guard.limits import report_measured_limits
from armguard.guard.observe import now_of
from armguard.guard.stops import set_clocks
from armguard.guard.watch import (
    AT_REST,
    AT_WORK,
    COMMANDED,
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
    SETTLED,
    TESTS,
    Motion,
)
from armguard.motion.stop_path import bound_reaches, plan_stops
from armguard.table import Vector

OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)
TOO_CLOSE = int(Reason.TOO_CLOSE)

# What is wanted is proven, else half of what is new in it, a quarter, and nothing new.
SHARES = (0.5, 0.25, 0.0)


@kernel(separate=True)
def open_cycle(q: Vector, w: Workspace) -> int:
    """First half: judge every pair for what is measured and what is under way.

    Args:
        q: Joint positions, shape (n,) if they are right [rad or m].
        w: The workspace; its state, memory and `out` are updated.

    Returns:
        1 if the input could be judged, else 0.
    """
    v, m = w.watch, w.motion
    v.given[COMMANDED] = 1.0
    for j in range(v.wanted.shape[0]):
        v.wanted[j] = v.commanded[j]
    clear_header(w)
    if not judge_input(q, w):
        return 0
    report_measured_limits(q, w, v, m)
    if w.out[REASON] == OUT_OF_LIMITS:
        refuse(w)
        return 0
    return 1


@kernel(separate=True)
def close_cycle(judged: int, w: Workspace) -> None:
    """Second half: prove what is wanted, or less of it; order stops; send.

    Args:
        judged: What `open_cycle` returned.
        w: The workspace; `wanted` of its watch is what is to
            be proven, and afterwards what is sent.
    """
    v, m = w.watch, w.motion
    if judged != 0:
        begin_recoveries(v, m)
        prove_wanted(w)
        end_recoveries(v)
        for r in range(v.recover.shape[0]):
            if v.recover[r] == GIVES_UP:
                demand_stop(r, TOO_CLOSE, v)
        conclude(w)
    send(v, m)


@kernel
def begin_recoveries(v: Watch, m: Motion) -> None:
    """Let robots at rest try to leave what is too near."""
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
            v.relief_until[r] = now_of(v) + m.span[SETTLED]
        elif recover[r] != GIVES_UP:
            recover[r] = 0


@kernel(separate=True)
def prove_wanted(w: Workspace) -> None:
    """Prove what is wanted, taking it back until that succeeds."""
    v, m = w.watch, w.motion
    begun = False
    for r in range(v.recover.shape[0]):
        # Whether what it is told still opens what is too near is known only now.
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
            # What was spent on more than that is no reason to stop what is under way.
            m.effort[TESTS] = 0
        judge_again(begun, w)


@kernel
def take_back(share: float, v: Watch, m: Motion) -> bool:
    """Take back what robots want that must stop for it.

    Returns:
        Whether there was one.
    """
    found = False
    for r in range(v.must.shape[0]):
        if v.must[r] == 0 or v.recover[r] == GIVES_UP:
            continue
        evades = v.recover[r] == AT_REST or v.recover[r] == AT_WORK
        if v.recover[r] == LEAVES or (evades and share == 0.0):
            # It does not lead away after all; half of it would do so less surely.
            v.phase[r] = RUNNING if v.recover[r] == AT_WORK else RESTING
            v.recover[r] = 0
            keep_under_way(r, 0.0, v, m)
            found = True
        elif v.phase[r] == RECOVERING or (v.phase[r] == RUNNING and v.yields[r] != 0):
            keep_under_way(r, share, v, m)
            found = True
    return found


@kernel(separate=True)
def judge_again(recovers: bool, w: Workspace) -> None:
    """Judge all pairs for what is wanted now.

    Args:
        recovers: Whether a robot was recovering before any command was taken back. If
            none was, a stop ordered now is still as it was planned: only what is
            wanted has changed.
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
def end_recoveries(v: Watch) -> None:
    """Give a robot back to its operator when nothing of it is too near any more."""
    for r in range(v.phase.shape[0]):
        if v.phase[r] == RECOVERING and v.relieved[r] == 0 and v.must[r] == 0:
            v.phase[r] = RUNNING
