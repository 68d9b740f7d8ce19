"""From measurements and desired motion to the commands of robots."""

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
from armguard.service.desk.answering import write_answer
from armguard.service.desk.desk import AS_DESIRED, NOTHING, Desk, open_desk
from armguard.service.wire.layout import Form

Longs = NDArray[np.int64]

VELOCITIES, POSITIONS, TWISTS = (int(form) for form in Form)
STOP = int(Asked.STOP)


@kernel(inline=False, entry=True)
def judge(desk: Longs, response: Longs, lines: Longs) -> None:
    """A cycle of the guard, and its answer; where programs are solved by kernels.

    Args:
        desk: Ledger of a desk; its `cycle` says what to ask.
        response: Ledger of the guard's responses.
        lines: Ledger of its workspace.
    """
    conclude_judging(begin_judging(desk, response, lines), desk, response, lines)


@kernel(inline=False, entry=True)
def begin_judging(desk: Longs, response: Longs, lines: Longs) -> int:
    """The same as far as programs are to be solved, see `begin_filtered_cycle`."""
    d = open_desk(desk)
    v = open_workspace(lines).watch
    hand_over(d, v)
    choose(d)
    cycle = d.cycle
    if cycle.asked_form == TWISTS:
        count = cycle.asked_count // 6 * TWIST_ROW
        return int(
            begin_filtered_cycle(d.q, BY_TWISTS, d.rows[:count], response, lines)
        )
    if cycle.asked_form == STOP:
        stop = d.asked[:1]
        return int(begin_filtered_cycle(d.q, TO_STAND_STILL, stop, response, lines))
    form = TO_POSITIONS if cycle.asked_form == POSITIONS else BY_VELOCITIES
    asked = d.asked[: d.q.shape[0]]
    return int(begin_filtered_cycle(d.q, form, asked, response, lines))


@kernel(inline=False, entry=True)
def conclude_judging(unsolved: int, desk: Longs, response: Longs, lines: Longs) -> None:
    """The rest of a cycle, and its answer; see `end_filtered_cycle`."""
    d = open_desk(desk)
    used = end_filtered_cycle(d.q, unsolved, response, lines)
    a, w = open_response(response), open_workspace(lines)
    for k in range(used):
        d.out[k] = w.out[k]
    for k in range(d.command.shape[0]):
        d.command[k] = a.commanded[k]
    d.cycle.used = used
    if d.cycle.ask != NOTHING:
        for j in range(d.held.shape[0]):
            d.held[j] = d.command[d.held.shape[0] + j]
    write_answer(desk)


@kernel
def hand_over(d: Desk, v: Watch) -> None:
    """Hand the measurement and its time to the guard."""
    v.given.now = d.cycle.start * 1e-9
    for r in range(d.stamps.shape[0]):
        v.stamps[r] = d.stamps[r]
    v.given.has_velocity = d.arrival.measured
    if d.arrival.measured != 0:
        for j in range(d.velocity.shape[0]):
            v.velocity[j] = d.velocity[j]


@kernel
def choose(d: Desk) -> None:
    """Choose the request to the guard, and keep it as it was made."""
    cycle = d.cycle
    n = d.q.shape[0]
    form = d.arrival.desired_form
    if cycle.ask == AS_DESIRED and form == TWISTS:
        lay_out_twists(d)
        return
    cycle.asked_count = n
    if cycle.ask == AS_DESIRED:
        cycle.asked_form = form
        for j in range(n):
            d.asked[j] = d.desired[j]
        return
    if cycle.ask != NOTHING:
        cycle.asked_form, cycle.asked_count = STOP, 1
        d.asked[0] = cycle.ask
        return
    holds = form == POSITIONS
    for j in range(n):
        holds &= isfinite(d.held[j])
    cycle.asked_form = POSITIONS if holds else VELOCITIES
    for j in range(n):
        d.asked[j] = d.held[j] if holds else 0.0


@kernel
def lay_out_twists(d: Desk) -> None:
    """Write twists as the guard takes them, and as they are kept."""
    count = d.arrival.desired_count
    d.cycle.asked_form, d.cycle.asked_count = TWISTS, 6 * count
    for k in range(count):
        desired = d.twists[k]
        for i in range(TOOL_TWIST):
            d.rows[k * TWIST_ROW + i] = d.tools[desired.tool, i]
        for i in range(6):
            d.rows[k * TWIST_ROW + TOOL_TWIST + i] = desired.twist[i]
            d.asked[6 * k + i] = desired.twist[i]
