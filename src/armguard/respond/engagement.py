"""Engagement: state machine of a robot for start, stop, resume and catching up.

A robot that was stopped does not follow a command that merely goes on. Its operator
first requests zero velocity, or motion away from all near pairs, or engages it; after
an ordered stop, only `engage` releases it. If positions are requested, the robot
follows them when they are near. If they are far it catches up slowly, or it is refused
at the start, with the joints named. A robot that was delayed until they are far also
catches up slowly.
"""

from enum import IntEnum

from armguard.guard.levels import Reason
from armguard.guard.watch import (
    BRAKING,
    LOST,
    RECOVERING,
    RESTING,
    RUNNING,
    STOPPING,
    Watch,
)
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.command import Blocked
from armguard.respond.state import POSITIONS, STANDSTILL, Response

# Below this requested speed a joint counts as not requested to move [rad/s or m/s].
NO_REQUEST = 1e-6


# Share of the far distance below which a position is near again [-].
NEAR_AGAIN = 0.5


class Engagement(IntEnum):
    """Engagement of a robot by its operator."""

    FOLLOWING = 0
    CATCHING_UP = 1
    WAITING = 2


@kernel
def engage(r: int, a: Response, v: Watch, m: Motion) -> bool:
    """Update the engagement of a robot by a cycle, and its share of top speeds.

    Returns:
        Whether it follows the request, at least in part.
    """
    notes, phase = a.notes[r], v.phase[r]
    a.speed[r] = 1.0
    notes.recovers = notes.requests_motion = 0
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        if abs(a.requested[j]) > NO_REQUEST:
            notes.requests_motion = 1
    ordered = wait_if_ordered(r, a, v)
    if wait_if_stopped(r, a, v) or ordered:
        return False
    if a.request.form == POSITIONS:
        stand_to_positions(r, a, m)
    else:
        stand_to_velocities(r, a)
    if v.evades[r] != 0:
        notes.blocked, notes.recovers, notes.requests_motion = Blocked.EVADING, 1, 1
        a.speed[r] = a.settings[r].evade_speed
        return True
    stuck = phase == RESTING and v.must[r] != 0
    if stuck or phase == RECOVERING:
        # A requested recovery is granted, whatever the robot waits for.
        notes.blocked, notes.recovers = Blocked.TOO_NEAR, 1
        a.speed[r] = a.settings[r].recover_speed
        return True
    if notes.engagement == Engagement.CATCHING_UP:
        a.speed[r] = a.settings[r].resume_speed
    return bool(notes.engagement != Engagement.WAITING)


@kernel
def wait_if_stopped(r: int, a: Response, v: Watch) -> bool:
    """Have a robot wait for its operator if it is being stopped.

    Returns:
        Whether it is being stopped.
    """
    notes, phase = a.notes[r], v.phase[r]
    if phase != STOPPING and phase != BRAKING and phase != LOST:
        return False
    notes.engagement, notes.blocked = Engagement.WAITING, Blocked.STOPPED
    notes.gave_positions = notes.refused = 0
    return True


@kernel
def wait_if_ordered(r: int, a: Response, v: Watch) -> bool:
    """Have a robot wait during an ordered stop, and afterwards until it is engaged.

    Returns:
        Whether it waits.
    """
    notes, phase = a.notes[r], v.phase[r]
    why = 0
    if a.request.form == STANDSTILL:
        why = a.request.stop_reason
        if why == Reason.STOP_ORDERED or why == Reason.RESTARTED:
            notes.ordered_stop = why
    if notes.ordered_stop != 0:
        why = notes.ordered_stop
    if why == 0:
        return False
    rests = phase == RUNNING or phase == RESTING
    if rests and (notes.ordered_stop != 0 or v.cause[r] == Reason.OK):
        # The order replaces any other cause of the stop: `engage` must lift it.
        v.cause[r] = why
    notes.engagement, notes.blocked = Engagement.WAITING, Blocked.STOPPED
    notes.gave_positions = notes.refused = 0
    return True


@kernel
def stand_to_velocities(r: int, a: Response) -> None:
    """Update the engagement under velocities: zero or opening velocity releases it."""
    notes = a.notes[r]
    notes.gave_positions = 0
    asks = notes.requests_motion != 0
    if (
        notes.engagement == Engagement.CATCHING_UP
        or not asks
        or notes.request_opens > 0
    ):
        notes.engagement = Engagement.FOLLOWING
    notes.blocked = (
        Blocked.STOPPED if notes.engagement == Engagement.WAITING else Blocked.NOT
    )


@kernel
def stand_to_positions(r: int, a: Response, m: Motion) -> None:
    """Update the engagement under positions: the robot follows those that are near."""
    notes, settings = a.notes[r], a.settings[r]
    first = m.robot_figures[r].first_joint
    farthest = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        farthest = max(farthest, a.far[j])
    if farthest <= NEAR_AGAIN * settings.far:
        notes.engagement = Engagement.FOLLOWING
    elif farthest > settings.far and notes.engagement == Engagement.FOLLOWING:
        # The robot was delayed, the leader arm jumped, or the robot starts elsewhere.
        notes.engagement = Engagement.CATCHING_UP
        if notes.gave_positions == 0 and settings.far_start != 0.0:
            notes.engagement, notes.refused = Engagement.WAITING, 1
    notes.gave_positions = 1
    notes.blocked = Blocked.NOT
    if notes.engagement == Engagement.CATCHING_UP:
        notes.blocked = Blocked.CATCHING_UP
    elif notes.engagement == Engagement.WAITING:
        notes.blocked = Blocked.FAR_START if notes.refused != 0 else Blocked.STOPPED
