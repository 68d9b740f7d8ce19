"""From what was measured and wished for to what robots are told."""

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.watch import Watch
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.recording.frames import Form as Asked
from armguard.respond.state import POSITIONS as TO_POSITIONS
from armguard.respond.state import STANDSTILL as TO_STAND_STILL
from armguard.respond.state import (
    TOOL_TWIST,
    TWIST_ROW,
    open_response,
)
from armguard.respond.state import TWISTS as BY_TWISTS
from armguard.respond.state import VELOCITIES as BY_VELOCITIES
from armguard.respond.whole_cycle import begin_filtered_cycle, end_filtered_cycle
from armguard.service.desk.desk import (
    AS_WISHED,
    ASK,
    ASKED_COUNT,
    ASKED_FORM,
    MEASURED,
    NOTHING,
    START,
    TWIST_AT,
    USED,
    WISH_COUNT,
    WISH_FORM,
    Desk,
    open_desk,
)
from armguard.service.desk.telling import write_answer
from armguard.service.wire.layout import Form

Longs = NDArray[np.int64]

VELOCITIES, POSITIONS, TWISTS = (int(form) for form in Form)
STOP = int(Asked.STOP)


@kernel(inline=False, entry=True)
def judge(address: int, response: Longs, lines: Longs) -> None:
    """A cycle of the guard, and its answer; where programs are solved by kernels.

    Args:
        address: Address of the ledger of a desk; `given` says what to ask.
        response: Ledger of the guard's responses.
        lines: Ledger of its workspace.
    """
    conclude_judging(begin_judging(address, response, lines), address, response, lines)


@kernel(inline=False, entry=True)
def begin_judging(address: int, response: Longs, lines: Longs) -> int:
    """The same as far as programs are to be solved, see `begin_filtered_cycle`."""
    d = open_desk(address)
    v = open_workspace(lines).watch
    hand_over(d, v)
    choose(d)
    given = d.given
    if given[ASKED_FORM] == TWISTS:
        count = given[ASKED_COUNT] // 6 * TWIST_ROW
        return int(
            begin_filtered_cycle(d.q, BY_TWISTS, d.rows[:count], response, lines)
        )
    if given[ASKED_FORM] == STOP:
        stop = d.asked[:1]
        return int(begin_filtered_cycle(d.q, TO_STAND_STILL, stop, response, lines))
    form = TO_POSITIONS if given[ASKED_FORM] == POSITIONS else BY_VELOCITIES
    asked = d.asked[: d.q.shape[0]]
    return int(begin_filtered_cycle(d.q, form, asked, response, lines))


@kernel(inline=False, entry=True)
def conclude_judging(
    unsolved: int, address: int, response: Longs, lines: Longs
) -> None:
    """The rest of a cycle, and its answer; see `end_filtered_cycle`."""
    d = open_desk(address)
    used = end_filtered_cycle(d.q, unsolved, response, lines)
    a, w = open_response(response), open_workspace(lines)
    for k in range(used):
        d.numbers[k] = w.out[k]
    for k in range(d.told.shape[0]):
        d.told[k] = a.commanded[k]
    d.given[USED] = used
    if d.given[ASK] != NOTHING:
        for j in range(d.held.shape[0]):
            d.held[j] = d.told[d.held.shape[0] + j]
    write_answer(address)


@kernel
def hand_over(d: Desk, v: Watch) -> None:
    """Hand to the guard what was measured, and when."""
    given = d.given
    v.given.now = given[START] * 1e-9
    for r in range(d.stamps.shape[0]):
        v.stamps[r] = d.stamps[r]
    v.given.has_velocity = given[MEASURED]
    if given[MEASURED] != 0:
        for j in range(d.velocity.shape[0]):
            v.velocity[j] = d.velocity[j]


@kernel
def choose(d: Desk) -> None:
    """Choose what to ask for, and write it down as it was asked."""
    given = d.given
    n = d.q.shape[0]
    form = given[WISH_FORM]
    if given[ASK] == AS_WISHED and form == TWISTS:
        lay_out_twists(d)
        return
    given[ASKED_COUNT] = n
    if given[ASK] == AS_WISHED:
        given[ASKED_FORM] = form
        for j in range(n):
            d.asked[j] = d.wish[j]
        return
    if given[ASK] != NOTHING:
        given[ASKED_FORM], given[ASKED_COUNT] = STOP, 1
        d.asked[0] = given[ASK]
        return
    holds = form == POSITIONS
    for j in range(n):
        holds &= isfinite(d.held[j])
    given[ASKED_FORM] = POSITIONS if holds else VELOCITIES
    for j in range(n):
        d.asked[j] = d.held[j] if holds else 0.0


@kernel
def lay_out_twists(d: Desk) -> None:
    """Write twists as the guard takes them, and as they are kept."""
    count = d.given[WISH_COUNT]
    d.given[ASKED_FORM], d.given[ASKED_COUNT] = TWISTS, 6 * count
    for k in range(count):
        tool = int(d.twists[k, 0])
        for i in range(TOOL_TWIST):
            d.rows[k * TWIST_ROW + i] = d.tools[tool, i]
        for i in range(6):
            twist = d.twists[k, TWIST_AT + i]
            d.rows[k * TWIST_ROW + TOOL_TWIST + i] = twist
            d.asked[6 * k + i] = twist
