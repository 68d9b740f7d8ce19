"""Relief: permitted deficit of a pair while a robot recovers from it."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import NearRow
from armguard.guard.needs import object_speed, robot_of
from armguard.guard.observe import now_of
from armguard.guard.pair_row import pair_row
from armguard.guard.watch import RECOVERING, RUNNING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import (
    Motion,
)

Floats = NDArray[np.float64]

# Greatest deficit that the bounds of a recovering arm's path may add [m].
SINK = 1e-3


@kernel
def relief_of(
    i: int,
    j: int,
    near: NearRow,
    spare: float,
    floor: float,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> float:
    """Reduction of a pair's need while a robot recovers from it [m].

    A pair that is too near even at rest, or so nearly that its robots cannot be
    released, need not be farther than it is, as long as the robot's command surely
    opens it. The deficit that the bounds of the path may add is bounded by that at the
    start of the recovery, and by the travel of an object since. The other side of the
    pair must not be driven nearer.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        near: The pair's row.
        spare: Distance minus the need without joint motion [m].
        floor: Part of that need that is no error: the buffer [m].
        w: Workspace.
        v: Watch; the deficits of the robots are written.
        m: Motion.
    """
    if m.span.segment != 0:
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
        if v.phase[r] == RUNNING and is_driven_nearer(r, i, j, near, w):
            return 0.0
        if v.phase[r] == RECOVERING:
            v.relieved[r] = 1
            if not surely_opens(r, i, j, near, w):
                return 0.0
            # `relief` includes the travel of an object until `relief_until`.
            later = max(now_of(v) + m.span.settled - v.relief_until[r], 0.0)
            most = max(most, v.relief[r] + SINK + object_speed(j, v) * later)
    relief = min(SINK - spare, most)
    if relief > floor and measured + floor >= error_along(i, j, near, w, v, m):
        # A pair that surely does not touch has to stay apart.
        relief = floor
    return float(relief)


@kernel
def error_along(
    i: int, j: int, near: NearRow, w: Workspace, v: Watch, m: Motion
) -> float:
    """Error of a pair's distance due to joint position errors, to first order [m].

    At most `blur`, which sums the displacements of both sides in any direction.
    """
    pair_row(i, j, near, v.row, w, m)
    total = 0.0
    for q in range(v.row.shape[0]):
        total += abs(v.row[q]) * m.joint_figures[q].position_error
    return total


@kernel(separate=True)
def surely_opens(r: int, i: int, j: int, near: NearRow, w: Workspace) -> bool:
    """Whether a robot's command opens a pair despite all tracking errors.

    The other robot's tracking errors count as well if it is driven.

    Args:
        r: The robot.
        i: Lower primitive.
        j: Higher primitive.
        near: The pair's row.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    if v.given.commanded == 0:
        return False
    pair_row(i, j, near, v.row, w, m)
    closing = 0.0
    for q in range(v.row.shape[0]):
        own = int(m.robot_of_joint[q])
        if own == r:
            closing += v.row[q] * v.wanted[q]
        if own == r or v.phase[own] == RUNNING:
            closing += abs(v.row[q]) * m.joint_figures[q].tracking_error
    return closing < 0.0


@kernel(separate=True)
def is_driven_nearer(r: int, i: int, j: int, near: NearRow, w: Workspace) -> bool:
    """Whether a pending or desired command of a robot closes a pair.

    Args:
        r: The robot.
        i: Lower primitive.
        j: Higher primitive.
        near: The pair's row.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    if v.given.commanded == 0:
        return True
    pair_row(i, j, near, v.row, w, m)
    first = m.robot_figures[r].first_joint
    for q in range(first, first + m.robot_figures[r].joint_count):
        low = min(v.under_way[q, 0], v.wanted[q])
        high = max(v.under_way[q, 1], v.wanted[q])
        if max(v.row[q] * low, v.row[q] * high) > 0.0:
            return True
    return False
