"""Rows of a robot's program: what a near pair lets it do."""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.guard.contracts import contract_of
from armguard.guard.grips import BY_INTENT, ENDING, STATE
from armguard.guard.grips import KIND as CONTRACT_KIND
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import NEXT, REACTION, Motion
from armguard.respond.leaving import (
    NO_ROW,
    SURELY,
)
from armguard.respond.state import (
    BY_PRIORITY,
    EQUALLY,
    LESS,
    NEARER,
    PRIORITY,
    ROW_COUNT,
    ROWS,
    SHARING,
    STEP,
    Response,
)
from armguard.respond.straight import (
    granted_speed,
)

Floats = NDArray[np.float64]

# Time in which a pair that is approached loses all but 1/e of what it has left [s].
APPROACH_TIME = 0.06

# The same of all it has left besides, joint by joint: enough to meet it softly [s].
HOLDING_TIME = 0.008

# Share of what can be had in a cycle that a pair which is to be opened asks for [-].
OPENING = 0.5

# What a velocity may break a row by and still count as keeping it [m/s].
GRAIN = 1e-9


@kernel
def closing_of(r: int, raw: Floats, target: Floats, m: Motion) -> float:
    """How fast a robot's own part of what is wanted closes a pair [m/s]."""
    first = m.robot_figures[r].first_joint
    total = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        total += raw[j] * target[j]
    return total


@kernel
def surely_opens_by(r: int, raw: Floats, a: Response, m: Motion) -> bool:
    """Whether a robot's target opens a pair, and what is asked of it surely does.

    Surely is wherever in its error of tracking each joint is.

    Args:
        r: The robot.
        raw: How fast each joint closes the pair, shape (n,).
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
def part_of(r: int, other: int, own: float, its: float, settings: Floats) -> float:
    """Share of what a pair of two robots has left that goes to one of them.

    Nobody is given credit for what the other one does to open the pair: it may stop.
    """
    if settings[r, SHARING] == EQUALLY:
        return 0.5
    own, its = max(own, 0.0), max(its, 0.0)
    if settings[r, SHARING] == BY_PRIORITY:
        if settings[r, PRIORITY] > settings[other, PRIORITY]:
            return 1.0
        if settings[r, PRIORITY] < settings[other, PRIORITY]:
            return 0.0 if its > 0.0 else 1.0
    return own / (own + its) if own + its > 0.0 else 0.5


@kernel
def add_opening(r: int, a: Response, m: Motion) -> None:
    """Add the row that has a robot surely open a pair.

    Args:
        r: The robot.
        a: Responses; `raw` holds how fast each joint closes the pair.
        m: Motion.
    """
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r, ROW_COUNT]
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
    """Add the row that lets a robot approach a pair, or has it open one.

    Args:
        r: The robot.
        left: Its share of what the pair may lose in all [m].
        opens: Whether it moves to open a pair that has too little left.
        a: Responses; `raw` holds how fast each joint closes the pair.
        v: Watch.
        m: Motion.
    """
    dt = a.pace[STEP]
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r, ROW_COUNT]
    limit = a.pace[NEARER] * left
    for j in range(first, end):
        cost = a.raw[j] * a.closing_time[j]
        limit += cost * v.commanded[j]
        limit -= dt * a.raw[j] * a.missed[j]
        a.rows[at, j] = a.raw[j] * dt + cost
    # How fast it may be approached matters to nobody who opens it.
    keep_row(r, first, end, at, limit, inf, opens, a)


@kernel
def add_holding(
    r: int, left: float, opens: bool, a: Response, v: Watch, m: Motion
) -> None:
    """Add the row that keeps a pair provable, whichever joint stops first.

    A joint that closes the pair is given no credit for one that opens it: that one may
    stop sooner. Who opens the pair may use up at once what it has left, for it has more
    in the next cycle; who closes it only a share of that.

    Args:
        r: The robot.
        left: Its share of what the pair may lose in all [m].
        opens: Whether it moves to open a pair that has too little left.
        a: Responses; `raw` holds how fast each joint closes the pair.
        v: Watch.
        m: Motion.
    """
    dt = a.pace[STEP]
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r, ROW_COUNT]
    limit = 0.0
    for j in range(first, end):
        raw, last = a.raw[j], v.commanded[j]
        time = a.opening_time[j] if raw * last < 0.0 else a.closing_time[j]
        limit += raw * time * last
        limit -= dt * max(raw * a.missed[j], 0.0)
        a.rows[at, j] = raw * (dt + time)
    share = a.pace[LESS] * left
    passing = limit + max(left, 0.0)
    keep_row(r, first, end, at, limit + share, passing, opens, a)


@kernel
def lost_till_then(r: int, a: Response, v: Watch, m: Motion) -> float:
    """What a pair may lose by a robot's motion until what is told now can matter [m].

    What is told moves it, and its drives may miss that all at once.

    Args:
        r: The robot.
        a: Responses; `raw` holds how fast each joint closes the pair.
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
    """Time until what a robot is told now surely takes effect [s]."""
    return float(m.clock[NEXT * m.robot_figures.shape[0] + r, REACTION])


@kernel
def add_contract(
    r: int,
    part: float,
    i: int,
    j: int,
    distance: float,
    opens: bool,
    a: Response,
    w: Workspace,
    m: Motion,
) -> None:
    """Add the row that lets a robot close a pair as slowly as its contract asks.

    Args:
        r: The robot.
        part: Its share of the speed.
        i: First primitive.
        j: Second primitive.
        distance: Their distance [m].
        opens: Whether it slows down harder than its stop is declared, if it has to.
        a: Responses; `raw` holds how fast each joint closes the pair.
        w: Workspace.
        m: Motion.
    """
    h = w.grips
    k = contract_of(i, j, h)
    if k < 0:
        return
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    at = r * ROWS + a.notes[r, ROW_COUNT]
    for q in range(first, end):
        a.rows[at, q] = a.raw[q]
    c = h.contracts[k]
    limit = part * granted_speed(r, distance, c, m)
    if c[STATE] == ENDING and c[CONTRACT_KIND] == BY_INTENT:
        # What is not meant any more is come no nearer to.
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
    """Scale a row to length 1, and keep it if a velocity in reach can break it.

    Args:
        r: The robot.
        first: Its first joint.
        end: The one behind its last.
        at: The row.
        limit: What it must not exceed.
        passing: The same for a target that opens every near pair.
        opens: Whether the robot moves to keep it.
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
        a.notes[r, ROW_COUNT] += 1
