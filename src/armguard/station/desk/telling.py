"""The COMMAND that answers a cycle."""

from math import inf

from armguard.guard.layout import (
    CLEARANCE,
    FIRST,
    NEAR_WIDTH,
    NEAREST,
    ROBOT_AGE,
    ROBOT_CAUSE,
    ROBOT_LEVEL,
    ROBOT_SCALE,
    ROBOT_URGENCY,
    ROBOT_WIDTH,
    SECOND,
    SLACK_TIME,
    WITNESS,
)
from armguard.guard.layout import HEADER as ROBOTS_IN_NUMBERS
from armguard.guard.layout import REASON as REASON_IN_NUMBERS
from armguard.guard.levels import Level
from armguard.kernel import kernel
from armguard.respond.command import ACTIONS, DRIVEN, Action
from armguard.station.desk.desk import (
    ASKED_FORM,
    BEGAN_AT,
    BEGAN_BY,
    BEGAN_WITH,
    CAUSE,
    COMMANDER,
    CYCLE,
    ENDED,
    FLAGS,
    LEVEL,
    REASON,
    START,
    Desk,
    open_desk,
)
from armguard.station.desk.words import as_f4, as_i8, as_u2, as_u4
from armguard.station.wire.layout import (
    COMMAND,
    HEADER,
    NOBODY,
    ROBOT,
    ROBOTS_AT,
)
from armguard.station.wire.words import Cause

# Where fields are, in words of eight bytes; those of two and of four are counted from
# where their row begins.
AT = HEADER.size // 8
ENDED_AT = AT + 4
SLACK_AT = AT + 6
BODIES_AT = AT + 8
DISTANCE_AT = AT + 9
POINTS_AT = AT + 11
SUMMARY_AT = (HEADER.size + COMMAND.size) // 8
COMMANDER_AT = SUMMARY_AT + 2
ROBOT_ROWS_AT = ROBOTS_AT // 8
ROBOT_WORDS = ROBOT.size // 8

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
def write_answer(address: int) -> None:
    """Write the payload of the COMMAND that tells the last cycle.

    Args:
        address: Address of the ledger of a desk; `given` says what to write beside the
            guard's numbers.
    """
    d = open_desk(address)
    given, numbers, told, words = d.given, d.numbers, d.told, d.answer
    longs = as_i8(words)
    n, robots = d.q.shape[0], d.first_joint.shape[0]
    lost = FIRST_LOST <= given[CAUSE] <= LAST_LOST
    reason = int(numbers[REASON_IN_NUMBERS])
    level, action = STOP_LEVEL, FOLLOW
    if 0 <= reason < d.level_of.shape[0]:
        level = d.level_of[reason]
    if lost:
        level = max(level, STOP_LEVEL)
    for r in range(robots):
        own, obeys = write_robot(r, lost, d)
        level, action = max(level, own), max(action, obeys)
    longs[AT] = given[CYCLE]
    longs[AT + 1], longs[AT + 2] = given[BEGAN_BY], given[BEGAN_WITH]
    longs[AT + 3], longs[ENDED_AT] = given[BEGAN_AT], given[ENDED]
    words[AT + 5] = given[START] * 1e-9
    write_nearest(d)
    u2 = as_u2(words)
    at = 4 * SUMMARY_AT
    u2[at], u2[at + 1] = reason, given[CAUSE]
    u2[at + 2], u2[at + 3] = level, action
    u2[at + 4] = given[FLAGS]
    u2[at + 5], u2[at + 6] = n, robots
    u2[at + 7] = given[ASKED_FORM]
    longs[COMMANDER_AT] = given[COMMANDER]
    at = ROBOT_ROWS_AT + robots * ROBOT_WORDS
    for j in range(n):
        words[at + j] = 0.0 if lost else told[j]
        words[at + n + j] = told[n + j]
    given[LEVEL], given[REASON] = level, reason


@kernel
def write_robot(r: int, lost: bool, d: Desk) -> tuple[int, int]:
    """Write the row of a robot.

    Returns:
        Its level, and what it is to do.
    """
    numbers, told, words = d.numbers, d.told, d.answer
    n, robots = d.q.shape[0], d.first_joint.shape[0]
    row = ROBOTS_IN_NUMBERS + r * ROBOT_WIDTH
    own = int(numbers[row + ROBOT_LEVEL])
    phase = told[4 * n + robots + r]
    since = told[4 * n + 2 * robots + r]
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
    at = ROBOT_ROWS_AT + r * ROBOT_WORDS
    f4, u2, longs = as_f4(words), as_u2(words), as_i8(words)
    u2[4 * at], u2[4 * at + 1] = own, obeys
    u2[4 * at + 2] = int(told[4 * n + r])
    u2[4 * at + 3] = int(numbers[row + ROBOT_CAUSE])
    f4[2 * at + 2] = numbers[row + ROBOT_SCALE]
    f4[2 * at + 3] = numbers[row + ROBOT_URGENCY]
    words[at + 2] = numbers[row + ROBOT_AGE]
    longs[at + 3], longs[at + 4] = d.sender[r], d.sequence[r]
    words[at + 5] = since
    return own, obeys


@kernel
def write_nearest(d: Desk) -> None:
    """Write what is left, and the nearest pair."""
    numbers, words = d.numbers, d.answer
    u4 = as_u4(words)
    near = int(numbers[NEAREST])
    words[SLACK_AT + 1] = numbers[SLACK_TIME]
    if near < 0:
        words[SLACK_AT] = words[DISTANCE_AT] = words[DISTANCE_AT + 1] = inf
        u4[2 * BODIES_AT] = u4[2 * BODIES_AT + 1] = NOBODY
        for k in range(6):
            words[POINTS_AT + k] = 0.0
        return
    row = d.first_row[0] + near * NEAR_WIDTH
    u4[2 * BODIES_AT] = d.body_of[int(numbers[row + FIRST])]
    u4[2 * BODIES_AT + 1] = d.body_of[int(numbers[row + SECOND])]
    words[SLACK_AT] = words[DISTANCE_AT + 1] = numbers[row + CLEARANCE]
    words[DISTANCE_AT] = numbers[row + WITNESS]
    for k in range(6):
        words[POINTS_AT + k] = numbers[row + WITNESS + 1 + k]
