"""The pairs of a cycle where contracts may be in force."""

from math import inf

from armguard.guard.contracts import close_contract
from armguard.guard.gripper_model import choose_models
from armguard.guard.grips import (
    DORMANT,
    ENDING,
    EXPIRED,
    IN_FORCE,
    KIND,
    NEAREST,
    REARM,
    RELIED,
    STANDING,
    STATE,
    UNTIL,
    Grips,
    open_grips,
)
from armguard.guard.intent import read_intents
from armguard.guard.layout import REASON
from armguard.guard.levels import Reason
from armguard.guard.motion_pairs import judge_motions
from armguard.guard.observe import now_of
from armguard.guard.watch import COMMANDED, Watch, open_watch
from armguard.guard.workspace import (
    CONTRACTS,
    GRIPS,
    INTENTS,
    MOTION,
    WATCH,
    open_workspace,
)
from armguard.kernel import kernel
from armguard.motion.state import SEGMENT, open_motion

CAPACITY = int(Reason.CAPACITY)


@kernel
def judge_all(lines: int) -> None:
    """Judge every pair.

    Args:
        lines: Address of the ledger of the workspace.
    """
    if open_workspace(lines).settings[CONTRACTS] != 0:
        judge_with_contracts(lines)
    else:
        judge_motions(lines)


@kernel(separate=True)
def judge_with_contracts(lines: int) -> None:
    """Judge every pair; before, choose the grippers' models, then end what is over.

    Args:
        lines: Address of the ledger of the workspace.
    """
    w = open_workspace(lines)
    v, m = open_watch(w.parts[WATCH]), open_motion(w.parts[MOTION])
    h = open_grips(w.parts[GRIPS])
    if m.span[SEGMENT] != 0.0:
        judge_motions(lines)
        return
    for k in range(h.contracts.shape[0]):
        h.contracts[k, NEAREST], h.contracts[k, RELIED] = inf, 0.0
    choose_models(lines)
    judge_motions(lines)
    if w.out[REASON] == CAPACITY:
        # Not all pairs were met: nobody knows which contracts are needed.
        return
    end_contracts(h, v)
    if v.given[COMMANDED] == 0.0 and w.settings[INTENTS] != 0:
        for q in range(h.velocity.shape[0]):
            h.velocity[q] = 0.5 * (m.v_low[q] + m.v_high[q])
        read_intents(h.velocity.ctypes.data, lines)


@kernel
def end_contracts(h: Grips, v: Watch) -> None:
    """End what is over: at once where no pair needs it, else as soon as none does."""
    now = now_of(v)
    for k in range(h.contracts.shape[0]):
        c = h.contracts[k]
        if c[STATE] == IN_FORCE:
            if now > c[UNTIL]:
                c[STATE] = EXPIRED
            elif c[NEAREST] > c[REARM]:
                c[STATE] = ENDING
        elif (c[STATE] == ENDING or c[STATE] == EXPIRED) and c[RELIED] == 0.0:
            if c[KIND] == STANDING:
                # The object may be put down there again.
                c[STATE] = DORMANT
            else:
                close_contract(k, h)
