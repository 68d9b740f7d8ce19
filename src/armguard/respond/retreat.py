"""Retreat: motion back along the trail, or straight to a safe configuration.

A robot that retreats keeps to its path: constraint rows only slow it down, at most to a
halt, where it waits. The retreat ends when the robot has arrived, when its operator
requests zero velocity and then motion, with `engage`, or with another stop.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.commands import time_passed
from armguard.guard.watch import Watch
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.field import led_speed
from armguard.respond.lead_state import Lead, Retreat
from armguard.respond.state import Response
from armguard.respond.trail import (
    TRAIL_STEP,
    drop_place,
    place_back,
    time_between,
    time_to,
)

Floats = NDArray[np.float64]

# Distances at which a place of the trail is passed and the last one is reached, beyond
# position errors, as time at top speed [s].
PASSED = 0.25 * TRAIL_STEP
ARRIVED = 0.002

# Share of its top speed below which a joint may stop at once [-].
NO_SPEED = 1e-4

# Ratio of the speed of a retreat and the way that is left, near its end [1/s].
ARRIVAL = 5.0

# Share of its requested speed below which a retreating robot counts as blocked [-], and
# time until that is reported [s].
HELD_UP = 0.05
HELD_UP_TIME = 0.1


@kernel
def lead_back(r: int, a: Response, s: Lead, v: Watch, m: Motion) -> bool:
    """Request the next motion of a robot's retreat.

    Returns:
        Whether it still retreats; if not, it has arrived.
    """
    notes, blind = s.notes[r], blind_time(r, m)
    while notes.retreat == Retreat.ALONG_TRAIL:
        if notes.count <= notes.unused:
            notes.retreat = Retreat.STRAIGHT if notes.to_safe != 0 else Retreat.BRAKING
            break
        last = notes.count - 1 == notes.unused and notes.to_safe == 0
        row = place_back(r, 0, s)
        time = time_between(r, row, s, m)
        if time > blind + (ARRIVED if last else PASSED):
            request_place(r, s.trail[row], time, last, a, s, v, m)
            return True
        drop_place(r, s)
    if notes.retreat == Retreat.STRAIGHT:
        time = time_to(r, s.safe, m)
        if time > blind + ARRIVED:
            request_place(r, s.safe, time, True, a, s, v, m)
            return True
        notes.retreat = Retreat.BRAKING
    if moves(r, v, m):
        stand(r, a, m)
        return True
    notes.retreat = Retreat.NONE
    return False


@kernel
def moves(r: int, v: Watch, m: Motion) -> bool:
    """Whether the last commanded velocity of a robot is more than negligible."""
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        if abs(v.commanded[j]) > NO_SPEED * m.joint_figures[j].velocity:
            return True
    return False


@kernel
def stand(r: int, a: Response, m: Motion) -> None:
    """Request zero velocity of a robot."""
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        a.requested[j] = 0.0


@kernel
def blind_time(r: int, m: Motion) -> float:
    """Greatest position error of a robot's joints, as time at top speed [s]."""
    first = m.robot_figures[r].first_joint
    longest = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        figures = m.joint_figures[j]
        longest = max(longest, figures.position_error / figures.velocity)
    return float(longest)


@kernel
def request_place(
    r: int,
    place: Floats,
    time: float,
    last: bool,
    a: Response,
    s: Lead,
    v: Watch,
    m: Motion,
) -> None:
    """Request straight motion in joint space to a place.

    Args:
        r: The robot.
        place: Joint positions of the place, shape (n,) [rad or m].
        time: Distance of the place, as time at top speed [s].
        last: Whether the robot stops there.
        a: Responses; `requested` is written.
        s: Lead.
        v: Watch.
        m: Motion.
    """
    s.memory[r].time_left = time if last else np.inf
    speed = led_speed(r, a.settings[r].resume_speed, ARRIVAL, s, v, m)
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        a.requested[j] = (place[j] - m.q[j]) * speed / time


@kernel
def is_held_up(r: int, a: Response, s: Lead, v: Watch, m: Motion) -> bool:
    """Whether the retreat of a robot has been blocked for a while."""
    first = m.robot_figures[r].first_joint
    commanded = requested = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        top = m.joint_figures[j].velocity
        commanded = max(commanded, abs(v.commanded[j]) / top)
        requested = max(requested, abs(a.requested[j]) / top)
    waits = commanded < HELD_UP * requested
    s.memory[r].at_rest = s.memory[r].at_rest + time_passed(v) if waits else 0.0
    if waits:
        # It speeds up again as smoothly as at its start.
        s.memory[r].speed = min(s.memory[r].speed, commanded + HELD_UP * requested)
    return bool(s.memory[r].at_rest > HELD_UP_TIME)
