"""Constraint rows of a robot's quadratic program: bounds that a near pair sets."""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.guard.grips import ContractKind, ContractState
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import NEXT, Motion
from armguard.respond.leaving import NO_ROW, SURELY
from armguard.respond.state import BY_PRIORITY, EQUALLY, ROWS, Response
from armguard.respond.straight import granted_speed

Floats = NDArray[np.float64]

# Time constant at which an approach row lets the headroom of a pair decrease [s].
APPROACH_TIME = 0.06

# Time constant at which a holding row lets the headroom decrease: it must be long
# enough for a smooth approach [s].
HOLDING_TIME = 0.008

# Share of the possible opening of a cycle that an opening pair requires at most [-].
OPENING = 0.5

# Greatest violation of a row at which a velocity still counts as satisfying it [m/s].
GRAIN = 1e-9


@kernel
def closing_of(r: int, raw: Floats, target: Floats, m: Motion) -> float:
    """Speed at which a robot's own joints close a pair at some velocities [m/s]."""
    first = m.robot_figures[r].first_joint
    total = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        total += raw[j] * target[j]
    return total


@kernel
def surely_opens_by(r: int, raw: Floats, a: Response, m: Motion) -> bool:
    """Whether a robot's target opens a pair, and its request surely opens it.

    Surely: at any tracking error within the declared bound.

    Args:
        r: The robot.
        raw: Distance gradient: rate at which each joint closes the pair, shape (n,).
        a: Responses.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    missed = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        missed += abs(raw[j]) * m.joint_figures[j].tracking_error
    surely = closing_of(r, raw, a.requested, m) + missed <= 0.0
    return bool(surely and closing_of(r, raw, a.target, m) <= 0.0)


@kernel
def part_of(r: int, other: int, own: float, its: float, a: Response) -> float:
    """Share of one robot in the headroom of its pair with another robot, in [0, 1].

    No robot gets credit for the other one that opens the pair: that one may stop.
    """
    settings, others = a.settings[r], a.settings[other]
    if settings.sharing == EQUALLY:
        return 0.5
    own, its = max(own, 0.0), max(its, 0.0)
    if settings.sharing == BY_PRIORITY:
        if settings.priority > others.priority:
            return 1.0
        if settings.priority < others.priority:
            return 0.0 if its > 0.0 else 1.0
    return own / (own + its) if own + its > 0.0 else 0.5


@kernel
def add_opening(r: int, a: Response, m: Motion) -> None:
    """Add the row that requires a robot to surely open a pair.

    Args:
        r: The robot.
        a: Responses; `raw` holds the distance gradient of the pair.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r].row_count
    missed = 0.0
    for j in range(first, end):
        a.rows[at, j] = a.raw[j]
        missed += abs(a.raw[j]) * m.joint_figures[j].tracking_error
    limit = -SURELY * missed
    keep_row(r, first, end, at, limit, limit, True, a)


@kernel
def add_approach(
    r: int, left: float, opens: bool, a: Response, v: Watch, m: Motion
) -> None:
    """Add the approach row: it bounds the loss of headroom, or requires opening.

    Args:
        r: The robot.
        left: Its share of the headroom of the pair [m].
        opens: Whether the robot moves to open a pair with too little headroom.
        a: Responses; `raw` holds the distance gradient of the pair.
        v: Watch.
        m: Motion.
    """
    dt = a.loss.time
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r].row_count
    limit = a.loss.approach * left
    for j in range(first, end):
        cost = a.raw[j] * a.closing_time[j]
        limit += cost * v.commanded[j]
        limit -= dt * a.raw[j] * a.missed[j]
        a.rows[at, j] = a.raw[j] * dt + cost
    # A robot that opens the pair needs no bound on the approach.
    keep_row(r, first, end, at, limit, inf, opens, a)


@kernel
def add_holding(
    r: int, left: float, opens: bool, a: Response, v: Watch, m: Motion
) -> None:
    """Add the holding row: it keeps a pair provable, whichever joint stops first.

    A joint that closes the pair gets no credit for one that opens it: that one may stop
    sooner. A robot that opens the pair may use all of its headroom at once, for it has
    more in the next cycle. A robot that closes it may use only a share.

    Args:
        r: The robot.
        left: Its share of the headroom of the pair [m].
        opens: Whether the robot moves to open a pair with too little headroom.
        a: Responses; `raw` holds the distance gradient of the pair.
        v: Watch.
        m: Motion.
    """
    dt = a.loss.time
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r].row_count
    limit = 0.0
    for j in range(first, end):
        raw, last = a.raw[j], v.commanded[j]
        time = a.opening_time[j] if raw * last < 0.0 else a.closing_time[j]
        limit += raw * time * last
        limit -= dt * max(raw * a.missed[j], 0.0)
        a.rows[at, j] = raw * (dt + time)
    share = a.loss.holding * left
    passing = limit + max(left, 0.0)
    keep_row(r, first, end, at, limit + share, passing, opens, a)


@kernel
def lost_till_then(r: int, a: Response, v: Watch, m: Motion) -> float:
    """Headroom a robot may use up before a command of this cycle takes effect [m].

    The last command moves it, and all its joints may have their tracking errors.

    Args:
        r: The robot.
        a: Responses; `raw` holds the distance gradient of the pair.
        v: Watch.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    closing = missed = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        closing += a.raw[j] * v.commanded[j]
        missed += abs(a.raw[j]) * m.joint_figures[j].tracking_error
    return float(time_to_effect(r, m) * (max(closing, 0.0) + missed))


@kernel
def time_to_effect(r: int, m: Motion) -> float:
    """Time until a command to a robot in this cycle surely takes effect [s]."""
    return float(m.clock[NEXT * m.robot_figures.shape[0] + r].reaction)


@kernel
def add_contract(
    r: int,
    part: float,
    k: int,
    distance: float,
    opens: bool,
    a: Response,
    w: Workspace,
    m: Motion,
) -> None:
    """Add the row that bounds the closing speed of a pair under a contract.

    Args:
        r: The robot.
        part: Its share of the speed [-].
        k: Row of the pair's contract, -1 for none.
        distance: Signed distance of the pair [m].
        opens: Whether the robot may brake harder than its declared stop.
        a: Responses; `raw` holds the distance gradient of the pair.
        w: Workspace.
        m: Motion.
    """
    if k < 0:
        return
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r].row_count
    for q in range(first, end):
        a.rows[at, q] = a.raw[q]
    c = w.grips.contracts[k]
    limit = part * granted_speed(r, distance, c, m)
    if c.state == ContractState.ENDING and c.kind == ContractKind.INTENT:
        # The object is no grasp target any more: approach it no further.
        limit = 0.0
    keep_row(r, first, end, at, limit, limit, opens, a)


@kernel
def keep_row(
    r: int,
    first: int,
    end: int,
    at: int,
    limit: float,
    passing: float,
    opens: bool,
    a: Response,
) -> None:
    """Scale a row to length 1, and keep it if an admissible velocity can violate it.

    Args:
        r: The robot.
        first: First joint of the robot.
        end: One behind its last joint.
        at: Place of the row.
        limit: Upper bound of the row.
        passing: Upper bound for a target that opens every near pair.
        opens: Whether the robot moves to satisfy the row.
        a: Responses.
    """
    rows = a.rows
    length = most = least = lowest = 0.0
    for j in range(first, end):
        length += rows[at, j] * rows[at, j]
    length = sqrt(length)
    if not length > NO_ROW:
        return
    for j in range(first, end):
        rows[at, j] /= length
        least += rows[at, j] * a.brake[j]
        up, down = rows[at, j] * a.high[j], rows[at, j] * a.low[j]
        most += max(up, down)
        lowest += min(up, down)
    a.eased[at] = max(limit / length, least)
    a.limits[at] = a.eased[at]
    if opens:
        a.limits[at] = max(limit / length, least - OPENING * (least - lowest))
    a.passing[at] = max(passing / length, a.limits[at])
    if not most <= a.limits[at]:
        a.notes[r].row_count += 1
