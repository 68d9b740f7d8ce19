"""Judging all pairs of a cycle, with contact contracts where a scene may have any."""

from math import inf

from armguard.guard.contracts import close_contract
from armguard.guard.gripper_model import choose_models
from armguard.guard.grips import ContractKind, ContractState, Grips
from armguard.guard.intent import read_intents
from armguard.guard.levels import Reason
from armguard.guard.motion_pairs import judge_motions
from armguard.guard.observe import now_of
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel

CAPACITY = int(Reason.CAPACITY)


@kernel
def judge_all(w: Workspace) -> None:
    """Judge every pair, with contracts where there may be any.

    Args:
        w: The workspace.
    """
    if w.settings.contracts != 0:
        judge_with_contracts(w)
    else:
        judge_motions(w)


@kernel(separate=True, optional=True)
def judge_with_contracts(w: Workspace) -> None:
    """Choose the grippers' models, judge every pair, end contracts that are over.

    Args:
        w: The workspace.
    """
    v, m = w.watch, w.motion
    h = w.grips
    if m.span.segment != 0:
        judge_motions(w)
        return
    for k in range(h.contracts.shape[0]):
        h.contracts[k].nearest, h.contracts[k].used = inf, 0
    choose_models(w)
    judge_motions(w)
    if w.header.reason == CAPACITY:
        # Not all pairs were judged: it is unknown which contracts are needed.
        return
    end_contracts(h, v)
    if v.given.commanded == 0 and w.settings.intents != 0:
        for q in range(h.velocity.shape[0]):
            h.velocity[q] = 0.5 * (m.v_low[q] + m.v_high[q])
        read_intents(h.velocity, w)


@kernel
def end_contracts(h: Grips, v: Watch) -> None:
    """End contracts that are over, as soon as no pair needs them any more."""
    now = now_of(v)
    for k in range(h.contracts.shape[0]):
        c = h.contracts[k]
        if c.state == ContractState.IN_FORCE:
            if now > c.until:
                c.state = ContractState.EXPIRED
            elif c.nearest > c.end_distance:
                c.state = ContractState.ENDING
        elif c.state == ContractState.ENDING or c.state == ContractState.EXPIRED:
            if c.used != 0:
                continue
            if c.kind == ContractKind.SUPPORT:
                # The object may be put down there again.
                c.state = ContractState.DORMANT
            else:
                close_contract(k, h)
