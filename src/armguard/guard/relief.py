"""What a pair may lack while a robot leaves it."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.needs import object_speed, robot_of
from armguard.guard.observe import now_of
from armguard.guard.pair_row import pair_row
from armguard.guard.watch import (
    COMMANDED,
    RECOVERING,
    RUNNING,
    Watch,
)
from armguard.guard.workspace import (
    Workspace,
)
from armguard.kernel import kernel
from armguard.motion.state import (
    SEGMENT,
    SETTLED,
    Motion,
)

Floats = NDArray[np.float64]

# What the bounds of the path of an arm that leaves what is too near may add to it [m].
SINK = 1e-3


@kernel
def relief_of(
    i: int,
    j: int,
    place: int,
    spare: float,
    floor: float,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> float:
    """What is taken off a pair's need while a robot leaves what is too near [m].

    A pair that would be too near at rest as well, or is by so little not that its
    robots cannot be let go, need not be farther than it is, as long as what the robot
    is told surely opens it. What the bounds of its path may add to that is bounded too,
    by where the recovery began, and by how far an object can have come by itself since.
    The pair's other side must not be one that is driven nearer.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        place: Where the pair's row starts.
        spare: Distance beyond what the pair needs besides joints [m].
        floor: What of that need is no error, but asked for [m].
        w: The workspace.
        w: Workspace.
        v: Watch; the deficits of resting robots are noted.
        m: Motion.
    """
    if m.span[SEGMENT] != 0.0:
        return 0.0
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    measured = spare
    spare -= m.blur[i]
    if robot_j >= 0:
        spare -= m.blur[j]
    if not spare < SINK:
        return 0.0
    for side in range(2):
        r = robot_i if side == 0 else robot_j
        if r >= 0:
            v.deficit[r] = max(v.deficit[r], -spare)
    most = 0.0
    for side in range(2):
        r = robot_i if side == 0 else robot_j
        if r < 0:
            continue
        if v.phase[r] == RUNNING and is_driven_nearer(r, i, j, place, w):
            return 0.0
        if v.phase[r] == RECOVERING:
            v.relieved[r] = 1
            if not surely_opens(r, i, j, place, w):
                return 0.0
            # What comes by itself was counted until then when the recovery began.
            later = max(now_of(v) + m.span[SETTLED] - v.relief_until[r], 0.0)
            most = max(most, v.relief[r] + SINK + object_speed(j, v) * later)
    relief = min(SINK - spare, most)
    if relief > floor and measured + floor >= error_along(i, j, place, w, v, m):
        # What surely does not touch has to stay so.
        relief = floor
    return float(relief)


@kernel
def error_along(i: int, j: int, place: int, w: Workspace, v: Watch, m: Motion) -> float:
    """What errors of joint positions take off a pair's distance, to first order [m].

    No more than `blur`, which is the sum of the ways of both sides in any direction.
    """
    pair_row(i, j, place, v.row, w, m)
    total = 0.0
    for q in range(v.row.shape[0]):
        total += abs(v.row[q]) * m.joint_figures[q].position_error
    return total


@kernel(separate=True)
def surely_opens(r: int, i: int, j: int, place: int, w: Workspace) -> bool:
    """Whether what a robot is told opens a pair, wherever in its error each joint is.

    The other robot's errors count as well if it is driven.

    Args:
        r: The robot.
        i: Lower primitive.
        j: Higher primitive.
        place: Where the pair's row starts.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    if v.given[COMMANDED] == 0.0:
        return False
    pair_row(i, j, place, v.row, w, m)
    closing = 0.0
    for q in range(v.row.shape[0]):
        own = int(m.robot_of_joint[q])
        if own == r:
            closing += v.row[q] * v.wanted[q]
        if own == r or v.phase[own] == RUNNING:
            closing += abs(v.row[q]) * m.joint_figures[q].tracking_error
    return closing < 0.0


@kernel(separate=True)
def is_driven_nearer(r: int, i: int, j: int, place: int, w: Workspace) -> bool:
    """Whether anything a robot is or was told, and may do yet, closes a pair.

    Args:
        r: The robot.
        i: Lower primitive.
        j: Higher primitive.
        place: Where the pair's row starts.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    if v.given[COMMANDED] == 0.0:
        return True
    pair_row(i, j, place, v.row, w, m)
    first = m.robot_figures[r].first_joint
    for q in range(first, first + m.robot_figures[r].joint_count):
        low = min(v.under_way[q, 0], v.wanted[q])
        high = max(v.under_way[q, 1], v.wanted[q])
        if max(v.row[q] * low, v.row[q] * high) > 0.0:
            return True
    return False
