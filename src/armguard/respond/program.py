"""Quadratic program for the safe velocity nearest to the target, and its rows.

For each near pair the guard has measured the headroom h that is left if the pending
commands go on. Closing the pair faster by Δv costs

    Δv · (T + t)

of it. T is the time until an order takes effect, t the time in which the joint stops.
Closing the pair at v also costs v per second, tracking errors included. A command may
use up only a share of h in a cycle, so a pair is approached ever more slowly and never
reached (a control barrier function; a velocity damper whose gain follows the stopping
figures). h is the least of the last cycles, so that errors of measurement do not
matter, minus the loss until a command of this cycle takes effect. A second row keeps h
itself from becoming negative: a joint that closes the pair gets no credit for one that
opens it, since that one may stop sooner. So a robot that slides along a surface keeps
the separation that its speed requires.

The rows are linear in u. A pair with too little headroom, which tracking errors can
cause, is opened again. If the rows of all pairs cannot be satisfied at once, their
bounds are relaxed so that the declared stop satisfies all of them.

The rows do not decide safety. Only the proof decides whether the result is sent.
"""

from math import exp

import numpy as np
from numpy.typing import NDArray

from armguard.guard.commands import time_passed
from armguard.guard.contracts import contract_of
from armguard.guard.layout import NearRow
from armguard.guard.needs import robot_of
from armguard.guard.pair_row import pair_row
from armguard.guard.relief import SINK
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.pair_state import ALLOWED, UNPROVEN
from armguard.motion.state import Motion
from armguard.respond.command import Changed
from armguard.respond.constraints import (
    APPROACH_TIME,
    GRAIN,
    HOLDING_TIME,
    add_approach,
    add_contract,
    add_holding,
    add_opening,
    closing_of,
    lost_till_then,
    part_of,
    surely_opens_by,
)
from armguard.respond.evasion import gets_out_of_its_way
from armguard.respond.joint_bounds import time_before_stop
from armguard.respond.leaving import (
    any_robot_leaves,
    note_ways_out,
    only_out,
    spare_at_rest,
)
from armguard.respond.spares import steady_spare
from armguard.respond.state import ROWS, Response
from armguard.respond.straight import (
    reaches_anything,
    slow_to_contract,
    slow_to_rows,
    straight_contract,
)

Floats = NDArray[np.float64]

BY_ROWS = int(Changed.ROWS)


# Headroom that an approach row leaves to the proof, and headroom that a holding row
# never uses up in one cycle [m].
SPARE = 6e-4
LEAST_SPARE = 2e-4


@kernel(separate=True)
def add_pairs(a: Response, w: Workspace) -> None:
    """Add every near pair to the programs of its robots; note if requests open pairs.

    Args:
        a: The responses; `target`, `low`, `high` and `brake` are written already.
        w: The workspace, after a cycle was opened.
    """
    v, m = w.watch, w.motion
    for r in range(a.notes.shape[0]):
        a.notes[r].row_count = a.notes[r].violates = a.notes[r].overflows = 0
        a.notes[r].request_opens = a.notes[r].coupled = 0
        a.notes[r].target_opens = int(a.notes[r].recovers == 0)
    dt = time_passed(v)
    a.loss.time = dt
    a.loss.approach = 1.0 - exp(-dt / APPROACH_TIME)
    a.loss.holding = 1.0 - exp(-dt / HOLDING_TIME)
    write_costs(a, v, m)
    if any_robot_leaves(a):
        note_ways_out(a, w)
    approaches = reaches_anything(w)
    for k in range(int(w.header.near_count)):
        add_pair(w.near[k], approaches, a, w, v, m)
    for r in range(a.notes.shape[0]):
        # A target that opens all near pairs is left unchanged as far as it is provable.
        limits = a.passing if a.notes[r].target_opens != 0 else a.limits
        a.notes[r].violates = int(breaks_rows(r, limits, a, m))


@kernel
def write_costs(a: Response, v: Watch, m: Motion) -> None:
    """Write the time for which each joint's velocity counts until it has stopped.

    A joint that opens a pair now can close it only after it has stopped.
    """
    for j in range(a.closing_time.shape[0]):
        figures, last = m.joint_figures[j], abs(v.commanded[j])
        gain = figures.acceleration * a.loss.time
        time = time_before_stop(j, int(m.robot_of_joint[j]), m)
        braking = 0.5 * gain / figures.deceleration
        a.closing_time[j] = time + last / figures.deceleration + braking
        a.opening_time[j] = max(1.0 - last / gain, 0.0) * (time + braking)


@kernel
def breaks_rows(r: int, limits: Floats, a: Response, m: Motion) -> bool:
    """Whether a robot's target violates a row of its program with these bounds."""
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    for k in range(a.notes[r].row_count):
        at = r * ROWS + k
        reached = 0.0
        for j in range(first, end):
            reached += a.rows[at, j] * a.target[j]
        if not reached <= limits[at] + GRAIN:
            return True
    return False


@kernel
def add_pair(
    near: NearRow, approaches: bool, a: Response, w: Workspace, v: Watch, m: Motion
) -> None:
    """Add the constraint rows of a near pair to the programs of its robots.

    Args:
        near: The pair's row.
        approaches: Whether a contract is in force, see `reaches_anything`.
        a: Responses; the programs are written.
        w: Workspace.
        v: Watch.
        m: Motion.
    """
    raw, target = a.raw, a.target
    i, j = int(near.first), int(near.second)
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    pair_row(i, j, near, raw, w, m)
    left = near.headroom
    if near.proof != UNPROVEN:
        # The deficit of an unproven pair does not predict its headroom.
        left = steady_spare(i, j, left, a, v)
    resting = spare_at_rest(i, j, near, w, v, m)
    closing_i = closing_of(robot_i, raw, target, m)
    closing_j = closing_of(robot_j, raw, target, m) if robot_j >= 0 else 0.0
    intended = near.proof == ALLOWED
    for side in range(2):
        r = robot_i if side == 0 else robot_j
        if r < 0 or (side == 1 and r == robot_i):
            continue
        if v.evades[r] != 0 and gets_out_of_its_way(r, j, v):
            continue
        note_request(r, intended, a, m)
        if resting < SINK and a.notes[r].recovers != 0 and not intended:
            only_out(r, a, m)
            a.notes[r].changed |= BY_ROWS
            if a.notes[r].coupled != 0 and a.notes[r].row_count < ROWS:
                add_opening(r, a, m)
            continue
        part = 1.0
        if robot_j >= 0 and robot_i != robot_j:
            other = robot_j if side == 0 else robot_i
            own, its = (closing_i, closing_j) if side == 0 else (closing_j, closing_i)
            part = part_of(r, other, own, its, a)
        if a.notes[r].row_count > ROWS - 3:
            a.notes[r].overflows = 1
            continue
        straight = straight_contract(r, i, j, a, w, v, m) if approaches else -1
        if straight >= 0:
            a.notes[r].target_opens = 0
            a.notes[r].changed |= BY_ROWS
            slow_to_contract(r, straight, part, near.distance, a, w, m)
        begin = a.notes[r].row_count
        add_limits(r, near, part, left, a, w)
        if straight >= 0:
            slow_to_rows(r, straight, begin, a, w, m)


@kernel
def note_request(r: int, intended: bool, a: Response, m: Motion) -> None:
    """Note whether a robot's request leads away from a pair, and surely opens it.

    Args:
        r: The robot.
        intended: Whether the pair has a contract in force.
        a: Responses; `raw` has the pair's gradient, the notes are written.
        m: Motion.
    """
    requested = 0.0 if intended else closing_of(r, a.raw, a.requested, m)
    if requested > GRAIN:
        a.notes[r].request_opens = -1
    elif requested < -GRAIN and a.notes[r].request_opens == 0:
        a.notes[r].request_opens = 1
    if not surely_opens_by(r, a.raw, a, m):
        a.notes[r].target_opens = 0


@kernel
def add_limits(
    r: int, near: NearRow, part: float, left: float, a: Response, w: Workspace
) -> None:
    """Add the rows by which a robot keeps its part of a pair's headroom.

    Args:
        r: The robot.
        near: The pair's row.
        part: Its part of the headroom [-].
        left: The headroom [m].
        a: Responses; the robot's program is written.
        w: Workspace.
    """
    v, m = w.watch, w.motion
    intended = near.proof == ALLOWED
    # A touching pair opens whenever an arm drifts into it. Other pairs do not move
    # a robot that has no request or keeps its path.
    keeps_path = a.settings[r].scales != 0
    opens = intended or (a.notes[r].requests_motion != 0 and not keeps_path)
    lost = lost_till_then(r, a, v, m)
    add_approach(r, part * (left - SPARE) - lost, opens, a, v, m)
    add_holding(r, part * (left - LEAST_SPARE) - lost, opens, a, v, m)
    if intended:
        i, j = int(near.first), int(near.second)
        distance = near.distance
        contract = contract_of(i, j, w.grips)
        add_contract(r, part, contract, distance, not keeps_path, a, w, m)


@kernel
def scale_back(r: int, a: Response, m: Motion) -> float:
    """Scale a robot's target towards the declared stop until it satisfies all rows.

    Returns:
        Share of the target that is left; the rest is the declared stop [-].
    """
    target, brake = a.target, a.brake
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    part = 1.0
    for k in range(a.notes[r].row_count):
        at = r * ROWS + k
        from_brake = to_target = 0.0
        for j in range(first, end):
            from_brake += a.rows[at, j] * brake[j]
            to_target += a.rows[at, j] * (target[j] - brake[j])
        if to_target > 0.0:
            part = min(part, max(a.eased[at] - from_brake, 0.0) / to_target)
    for j in range(first, end):
        target[j] = brake[j] + part * (target[j] - brake[j])
    return part
