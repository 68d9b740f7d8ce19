"""Everything a cycle of the service reads and writes, made once.

A STATE is received as bytes and a COMMAND is sent as bytes. Between them are numbers
in arrays that kernels read, so that a message becomes an answer in two calls of
compiled code: `take_state` and `judge`.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import Header, NearRow, RobotRow
from armguard.kernel import kernel
from armguard.record import Records, record
from armguard.table import LongVector, Matrix, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


@record
class Arrival:
    """A message that was received, and the newest desired motion.

    Attributes:
        length: Its length [bytes].
        now: When it was received, monotonic [ns].
        sender: Its sender.
        sequence: Its number.
        token: Token that a WISH has to show; 0 if its sender is not the commander.
        watchdog: Silence after which a robot may get another controller [ns].
        has_desired: 1 if a STATE has a desired motion.
        desired_outcome: What came of that, see `OUTCOMES`.
        desired_form: Form of the newest desired motion, as messages number it.
        desired_count: How many numbers, or twists, that has.
        measured: 1 if the newest state of every robot had velocities.
    """

    length: int
    now: int
    sender: int
    sequence: int
    token: int
    watchdog: int
    has_desired: int
    desired_outcome: int
    desired_form: int
    desired_count: int
    measured: int


@record
class Cycle:
    """A cycle, and what came of it.

    Attributes:
        ask: What to ask the guard, see `AS_DESIRED`.
        number: Its number.
        began_by: Sender of the state that began it; 0 for none.
        began_with: Number of that state.
        began_at: When that was received, monotonic [ns].
        start: When the cycle began, monotonic [ns].
        ended: When it had been judged, monotonic [ns].
        cause: Why the desired motion does not count, see `Cause`.
        marks: Flags of the COMMAND.
        commander: Sender of the desired motion; 0 for none.
        asked_form: Form of the request to the guard.
        asked_count: How many numbers that has.
        used: Places of `out` that are used.
        level: The highest level.
        reason: The verdict's reason.
    """

    ask: int
    number: int
    began_by: int
    began_with: int
    began_at: int
    start: int
    ended: int
    cause: int
    marks: int
    commander: int
    asked_form: int
    asked_count: int
    used: int
    level: int
    reason: int


@record
class ToolTwist:
    """Desired twist of a tool.

    Attributes:
        tool: Index of the tool.
        twist: The twist [m/s], [rad/s].
    """

    tool: int
    twist: Annotated[Floats, (6,)]


# What to ask a guard, `Cycle.ask`; any other number is the `Reason` of a stop.
AS_DESIRED = 0  # the desired motion of the commander
NOTHING = 1  # that nothing moves; where positions were desired, that they are held

# What came of a message: its index here, see `DROPS`.
OUTCOMES = (
    *("", "payload", "robots", "joints"),
    *("second_controller", "not_commander", "wish_not_finite"),
)
TAKEN, PAYLOAD, ROBOTS, JOINTS = range(4)
SECOND_CONTROLLER, NOT_COMMANDER, DESIRED_NOT_FINITE = range(4, 7)


@table
class Desk(NamedTuple):
    """Arrays of one service and one scene, of n joints, r robots, p primitives."""

    arrival: Arrival  # the message that was received
    cycle: Cycle  # the cycle that is judged
    message: Vector  # the message that was received, as words of eight bytes
    answer: Vector  # the message to be sent, likewise
    q: Vector  # joint positions, shape (n,) [rad or m]
    velocity: Vector  # joint velocities, shape (n,) [rad/s or m/s]
    stamps: Vector  # when robots were measured, shape (r,) [s]
    measured: LongVector  # 1 where the newest state had velocities, shape (r,)
    sender: LongVector  # controller of each robot, 0 for none yet, shape (r,)
    sequence: LongVector  # number of the state of each robot, shape (r,)
    heard: LongVector  # when it was received, monotonic, shape (r,) [ns]
    first_joint: LongVector  # place in q of the first joint of each robot, shape (r,)
    joint_count: LongVector  # how many joints it has, shape (r,)
    desired: Vector  # desired velocities or positions, shape (n,)
    twists: Annotated[Records[ToolTwist], 1]  # desired twists, shape (MOST_TWISTS,)
    tools: Matrix  # robot, body, origin in the body of each tool, (k, TOOL_TWIST)
    rows: Vector  # twists as the guard takes them, shape (MOST_TWISTS TWIST_ROW,)
    # Positions commanded last, which are held when a commander in positions falls
    # silent, shape (n,).
    held: Vector
    asked: Vector  # the last request to the guard, shape (max(n, 6 MOST_TWISTS),)
    out: Vector  # the verdict's numbers, see `armguard.guard.layout`
    header: Header  # their header, in the same memory
    robots: Annotated[Records[RobotRow], 1]  # their rows of the robots, likewise
    escape: Vector  # their escape directions, likewise
    near: Annotated[Records[NearRow], 1]  # their rows of the near pairs, likewise
    command: Vector  # the numbers of the `Command`, shape (4 n + 4 r,)
    body_of: LongVector  # index in a COMMAND of the body of each primitive, shape (p,)
    level_of: LongVector  # level of each reason, shape (k,)


open_desk = opener(Desk)


@kernel
def signed(word: int) -> int:
    """A field of a record as int64; with an unsigned one sums become float64."""
    return int(np.int64(word))
