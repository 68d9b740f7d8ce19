"""Encodes the COMMAND that answers a cycle."""

from math import inf
from typing import Any

from armguard.address import array_at, pointer
from armguard.guard.levels import Level
from armguard.kernel import kernel
from armguard.respond.command import ACTIONS, DRIVEN, Action
from armguard.service.desk.desk import Desk, Longs, open_desk
from armguard.service.wire.layout import (
    COMMAND,
    HEADER,
    NO_BODY,
    ROBOT,
    ROBOTS_AT,
    Cause,
)

PAYLOAD_AT, ROBOT_SIZE = HEADER.size, ROBOT.size
COMMAND_ROW, ROBOT_ROW = COMMAND.dtype, ROBOT.dtype

STOP_LEVEL = int(Level.STOP)
BRAKE_LEVEL = int(Level.BRAKE)
HARDWARE_LEVEL = int(Level.HARDWARE_STOP)
FOLLOW = int(Action.FOLLOW)
HOLD = int(Action.HOLD)
STOP_ACTION = int(Action.STOP)
BRAKE_ACTION = int(ACTIONS[Level.BRAKE])
HARDWARE_ACTION = int(ACTIONS[Level.HARDWARE_STOP])
MOVING = tuple(int(phase) for phase in DRIVEN)

# Causes for which nothing that was judged counts.
FIRST_LOST, LAST_LOST = int(Cause.DEADLINE_MISSED), int(Cause.WAITING)


@kernel(inline=False, entry=True)
def write_answer(desk: Longs) -> None:
    """Write the payload of the COMMAND that answers the last cycle.

    Args:
        desk: Ledger of a desk; its `cycle` has what to write beside the guard's
            numbers.
    """
    d = open_desk(desk)
    cycle = d.cycle
    n, robots = d.q.shape[0], d.first_joint.shape[0]
    command = array_at(pointer(d.answer.ctypes.data + PAYLOAD_AT), (1,), COMMAND_ROW)[0]
    rows = array_at(pointer(d.answer.ctypes.data + ROBOTS_AT), (robots,), ROBOT_ROW)
    lost = FIRST_LOST <= cycle.cause <= LAST_LOST
    reason = int(d.header.reason)
    level, action = STOP_LEVEL, FOLLOW
    if 0 <= reason < d.level_of.shape[0]:
        level = d.level_of[reason]
    if lost:
        level = max(level, STOP_LEVEL)
    for r in range(robots):
        own, obeys = write_robot(r, lost, d, rows[r])
        level, action = max(level, own), max(action, obeys)
    command["cycle"] = cycle.number
    command["began_by"], command["began_with"] = cycle.began_by, cycle.began_with
    command["received"], command["ended"] = cycle.began_at, cycle.ended
    command["time"] = cycle.start * 1e-9
    write_nearest(d, command)
    command["reason"], command["cause"] = reason, cycle.cause
    command["level"], command["action"] = level, action
    command["flags"], command["form"] = cycle.marks, cycle.asked_form
    command["joints"], command["robots"] = n, robots
    command["commander"] = cycle.commander
    at = (ROBOTS_AT + robots * ROBOT_SIZE) // 8
    for j in range(n):
        d.answer[at + j] = 0.0 if lost else d.command[j]
        d.answer[at + n + j] = d.command[n + j]
    cycle.level, cycle.reason = level, reason


@kernel
def write_robot(r: int, lost: bool, d: Desk, row: Any) -> tuple[int, int]:
    """Write the row of a robot, see `RobotRow`.

    Returns:
        Its level and its action.
    """
    given, commanded = d.robots[r], d.command
    n, robots = d.q.shape[0], d.first_joint.shape[0]
    own = int(given.level)
    phase = commanded[4 * n + robots + r]
    since = commanded[4 * n + 2 * robots + r]
    obeys = STOP_ACTION
    if since == since:
        obeys = HOLD
    elif phase in MOVING:
        obeys = FOLLOW
    elif own == BRAKE_LEVEL:
        obeys = BRAKE_ACTION
    elif own == HARDWARE_LEVEL:
        obeys = HARDWARE_ACTION
    if lost:
        own, obeys = max(own, STOP_LEVEL), max(obeys, STOP_ACTION)
    row["level"], row["action"] = own, obeys
    row["blocked"] = int(commanded[4 * n + r])
    row["stopped_by"] = int(given.cause)
    row["speed_scale"] = given.scale
    row["urgency"] = given.urgency
    row["age"] = given.age
    row["sender"], row["sequence"] = d.sender[r], d.sequence[r]
    row["held_since"] = since
    return own, obeys


@kernel
def write_nearest(d: Desk, command: Any) -> None:
    """Write the headroom and the nearest pair."""
    nearest = int(d.header.nearest)
    command["time_left"] = d.header.least_time_left
    if nearest < 0:
        command["headroom"] = command["distance"] = command["pair_headroom"] = inf
        command["body_a"] = command["body_b"] = NO_BODY
        for k in range(3):
            command["point_a"][k] = command["point_b"][k] = 0.0
        return
    near = d.near[nearest]
    command["body_a"] = d.body_of[int(near.first)]
    command["body_b"] = d.body_of[int(near.second)]
    command["headroom"] = command["pair_headroom"] = near.headroom
    command["distance"] = near.distance
    for k in range(3):
        command["point_a"][k] = near.point_a[k]
        command["point_b"][k] = near.point_b[k]
