"""The pairs of a cycle where contracts may be in force."""

from math import inf

from armguard.address import call_for_nothing
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
from armguard.guard.layout import REASON
from armguard.guard.levels import Reason
from armguard.guard.observe import now_of
from armguard.guard.watch import COMMANDED, Watch, open_watch
from armguard.guard.workspace import (
    GRIPS,
    INTENT,
    JUDGE_ALL,
    MOTION,
    NOWHERE,
    SELF,
    WATCH,
    open_workspace,
)
from armguard.kernel import kernel
from armguard.motion.state import SEGMENT, open_motion

CAPACITY = int(Reason.CAPACITY)


@kernel(inline=False)
def judge_with_contracts(lines: int) -> None:
    """Judge every pair; before, choose the grippers' models, then end what is over.

    Args:
        lines: Address of the ledger of the workspace.
    """
    w = open_workspace(lines)
    v, m = open_watch(w.parts[WATCH]), open_motion(w.parts[MOTION])
    h = open_grips(w.parts[GRIPS])
    if m.span[SEGMENT] != 0.0:
        call_for_nothing(w.parts[JUDGE_ALL], (w.parts[SELF],))
        return
    for k in range(h.contracts.shape[0]):
        h.contracts[k, NEAREST], h.contracts[k, RELIED] = inf, 0.0
    choose_models(lines)
    call_for_nothing(w.parts[JUDGE_ALL], (w.parts[SELF],))
    if w.out[REASON] == CAPACITY:
        # Not all pairs were met: nobody knows which contracts are needed.
        return
    end_contracts(h, v)
    if v.given[COMMANDED] == 0.0 and w.parts[INTENT] != NOWHERE:
        for q in range(h.velocity.shape[0]):
            h.velocity[q] = 0.5 * (m.v_low[q] + m.v_high[q])
        call_for_nothing(w.parts[INTENT], (h.velocity.ctypes.data, w.parts[SELF]))


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
