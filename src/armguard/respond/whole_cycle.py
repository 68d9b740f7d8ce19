"""Filtered cycle as compiled entries: from measurement and request to the command.

For clients that call the guard a thousand times a second: each call from Python into
compiled code costs more than many a kernel.
"""

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.filtered_cycle import open_cycle
from armguard.guard.levels import Reason
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.respond.cycle import finish, respond
from armguard.respond.state import (
    POSITIONS,
    STANDSTILL,
    TOOL_POINT,
    TOOL_TWIST,
    TWIST_ROW,
    TWISTS,
    VELOCITIES,
    Response,
    open_response,
)

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Returned in place of robots if the input could not be judged.
NOT_JUDGED = -1

# First and last reason of an ordered stop, see `ORDERED` of the levels.
FIRST_ORDERED, LAST_ORDERED = int(Reason.STOP_ORDERED), int(Reason.SHUTDOWN)


@kernel(inline=False, entry=True)
def run_filtered_cycle(
    q: Floats, form: int, desired: Floats, response: Longs, lines: Longs
) -> int:
    """Run a whole filtered cycle, if kernels can call the solver of programs.

    Args:
        q: Measured joint positions, shape (n,) [rad or m].
        form: Form of the request: `VELOCITIES`, `POSITIONS`, `TWISTS` or `STANDSTILL`.
        desired: Velocities or positions of all joints, shape (n,), or rows of twists,
            shape (k TWIST_ROW,), or the `Reason` of a stop, shape (1,). With any other
            length the robots stop.
        response: Ledger of the responses.
        lines: Ledger of the workspace.

    Returns:
        Number of places of the workspace's `out` that were used.
    """
    unsolved = begin_filtered_cycle(q, form, desired, response, lines)
    return end_filtered_cycle(q, unsolved, response, lines)


@kernel(inline=False, entry=True)
def begin_filtered_cycle(
    q: Floats, form: int, desired: Floats, response: Longs, lines: Longs
) -> int:
    """Run a filtered cycle up to the programs; arguments as in `run_filtered_cycle`.

    Returns:
        See `respond`; NOT_JUDGED if the input could not be judged.
    """
    a, w = open_response(response), open_workspace(lines)
    if open_cycle(q, w) == 0:
        return NOT_JUDGED
    take_desired(form, desired, a)
    return respond(a, w)


@kernel(inline=False, entry=True)
def end_filtered_cycle(q: Floats, unsolved: int, response: Longs, lines: Longs) -> int:
    """Run the rest of a filtered cycle, after the programs.

    Args:
        q: Measured joint positions, as in `begin_filtered_cycle`.
        unsolved: Result of `begin_filtered_cycle`, without the robots whose programs
            were solved meanwhile.
        response: Ledger of the responses.
        lines: Ledger of the workspace.

    Returns:
        Number of places of the workspace's `out` that were used.
    """
    a, w = open_response(response), open_workspace(lines)
    judged = 0 if unsolved == NOT_JUDGED else 1
    open_programs = 0 if judged == 0 else unsolved
    used = finish(judged, open_programs, a, w)
    if judged == 0:
        command_measured(q, a)
    return used


@kernel
def command_measured(q: Floats, a: Response) -> None:
    """Command the measured positions before the first cycle that could be judged.

    NaN is commanded where a position is unknown: any other one might be far away.
    """
    n = a.held.shape[0]
    for j in range(n):
        if isfinite(a.held[j]):
            continue
        known = q.shape[0] == n and isfinite(q[j])
        a.commanded[n + j] = q[j] if known else np.nan


@kernel
def take_desired(form: int, desired: Floats, a: Response) -> None:
    """Write the request to the arrays that the cycle reads."""
    a.request.form = form
    if form == STANDSTILL:
        # Any other value counts as the first reason of an ordered stop.
        known = desired.shape[0] == 1 and FIRST_ORDERED <= desired[0] <= LAST_ORDERED
        a.request.stop_reason = int(desired[0]) if known else FIRST_ORDERED
        return
    count = desired.shape[0] // TWIST_ROW
    whole = count * TWIST_ROW == desired.shape[0] and count <= a.twists.shape[0]
    if form == TWISTS and whole:
        a.request.twist_count = count
        for k in range(count):
            row = desired[k * TWIST_ROW : (k + 1) * TWIST_ROW]
            twist = a.twists[k]
            twist.robot, twist.body = int(row[0]), int(row[1])
            for i in range(3):
                twist.point[i] = row[TOOL_POINT + i]
            for i in range(6):
                twist.twist[i] = row[TOOL_TWIST + i]
        return
    if form == TWISTS:
        a.request.form = VELOCITIES
    into = a.goal if form == POSITIONS else a.requested
    whole = form != TWISTS and desired.shape[0] == into.shape[0]
    for j in range(into.shape[0]):
        into[j] = desired[j] if whole else np.nan
