"""Everything a cycle of the service reads and writes, made once.

A STATE is received as bytes and a COMMAND is sent as bytes. Between them are numbers
in arrays that kernels read, so that a message becomes an answer in two calls of
compiled code: `take_state` and `judge`.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer
from armguard.kernel import kernel
from armguard.table import LongVector, Matrix, Vector, opener

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Places in `given`. What a message is, before it is taken:
SIZE = 0  # [bytes]
NOW = 1  # monotonic [ns]
SENDER = 2
SEQUENCE = 3
TOKEN = 4  # what a WISH must show; 0 if its sender does not command
WATCHDOG = 5  # after that much silence a robot may get another controller [ns]
# What came of it:
HAS_WISH = 6  # 1 if there is a WISH in a STATE
WISH_OUTCOME = 7  # what came of that
WISH_FORM = 8  # form of the newest WISH, as messages number it
WISH_COUNT = 9  # how many numbers, or twists, it has
MEASURED = 10  # 1 if the newest state of every robot had velocities
# What a cycle is given:
ASK = 11  # what to ask the guard
CYCLE = 12  # its number
BEGAN_BY = 13  # sender, number and arrival of the state that began it [ns]; 0 for none
BEGAN_WITH = 14
BEGAN_AT = 15
START = 16  # monotonic [ns]
ENDED = 17  # when it had been judged [ns]
CAUSE = 18
FLAGS = 19
COMMANDER = 20
# What came of that:
ASKED_FORM = 21  # form of what was asked
ASKED_COUNT = 22  # how many numbers that has
USED = 23  # places of `numbers` that are used
LEVEL = 24  # the highest level, its reason
REASON = 25
GIVEN = 26

# What to ask a guard; any other number is the `Reason` of a stop.
AS_WISHED = 0  # the desired motion of the commander
NOTHING = 1  # that nothing moves; where positions were desired, that they are held

# What came of a message: its place here, see `DROPS`.
OUTCOMES = (
    *("", "payload", "robots", "joints"),
    *("second_controller", "not_commander", "wish_not_finite"),
)
TAKEN, PAYLOAD, ROBOTS, JOINTS = range(4)
SECOND_CONTROLLER, NOT_COMMANDER, WISH_NOT_FINITE = range(4, 7)

# A row of `twists`: index of the tool, then its twist.
TWIST_AT = 1


class Desk(NamedTuple):
    """Arrays of one service and one scene, of n joints, r robots, p primitives."""

    given: LongVector  # see SIZE, shape (GIVEN,)
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
    wish: Vector  # desired velocities or positions, shape (n,)
    twists: Matrix  # desired twists, see TWIST_AT, shape (MOST_TWISTS, TWIST)
    tools: Matrix  # robot, body, origin in the body of each tool, (k, TOOL_TWIST)
    rows: Vector  # twists as the guard takes them, shape (MOST_TWISTS TWIST_ROW,)
    # Positions commanded last, which are held when a commander in positions falls
    # silent, shape (n,).
    held: Vector
    asked: Vector  # what the guard was asked for last, shape (max(n, 6 MOST_TWISTS),)
    numbers: Vector  # the verdict's numbers, see `armguard.guard.layout`
    told: Vector  # the command to the robots, as `Command` cuts it, shape (4 n + 4 r,)
    body_of: LongVector  # index in a COMMAND of the body of each primitive, shape (p,)
    level_of: LongVector  # level of each reason, shape (k,)
    first_row: LongVector  # where near pairs start in `numbers`, shape (1,)


open_desk = opener(Desk)


@kernel
def records(words: Floats, at: int, count: int, dtype: Any) -> Any:
    """Records of a message that begin at `at` [bytes], in the same memory."""
    return numba.carray(pointer(words.ctypes.data + at), (count,), dtype)


@kernel
def signed(word: int) -> int:
    """A field of a record as int64; with an unsigned one sums become float64."""
    return int(np.int64(word))
