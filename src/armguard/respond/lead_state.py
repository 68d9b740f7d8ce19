"""What leads robots in their operators' place: goals of fields, ways back, memory."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables
from armguard.table import LongMatrix, Matrix, Vector, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Places of a robot kept of the way that led in.
TRAIL = 512

# Places in `Lead.notes`.
LED = 0  # who leads it in this cycle, see NOBODY
GOAL = 1  # what its field draws it to, see NO_GOAL
SUSPENDED = 2  # 1 if it was stopped since, and its field waits to be engaged
IN_MINIMUM = 3  # 1 if its field was found to lead nowhere
WAY = 4  # how it retreats, see STAYS
BEGUN = 5  # 1 if its retreat has begun: a stop ends it
LET_GO = 6  # 1 if its operator asked for nothing since it began
KEEP = 7  # places of the way that led in it does not go back beyond
THEN_SAFE = 8  # 1 if it goes on from there to a safe configuration
HEAD = 9  # where the next place is written
COUNT = 10  # places that are kept
TOOL_BODY = 11  # body of the tool its field draws
LEAD_NOTES = 12

# Who leads a robot.
OPERATOR = 0
BY_FIELD = 1
BY_RETREAT = 2

# Goals of a field.
NO_GOAL = 0
JOINTS_GOAL = 1
TOOL_GOAL = 2

# Ways of a retreat.
STAYS = 0
ALONG = 1
STRAIGHT = 2
ENDS = 3

# Places in `Lead.memory`.
PULL = 0  # share of its top speeds it has risen to [-]
LEFT = 1  # time to the goal at top speed [s]
BEST = 2  # the least that was [s]
IDLE = 3  # for how long there was none less [s]
STANDS = 4  # for how long it has not moved, though led [s]
LEAD_MEMORY = 5

# Numbers of a goal of a tool: [R | p] in the world, and its origin in its body.
TOOL_AIM = 15


@table
class Lead(NamedTuple):
    """Arrays of what leads the robots of one guard.

    Attributes:
        notes: See LED, shape (r, LEAD_NOTES).
        memory: See PULL, shape (r, LEAD_MEMORY).
        trail: Where each robot was, in turn, shape (TRAIL, n) [rad or m].
        aim: Joint positions fields draw to, shape (n,).
        safe: Joint positions robots retreat to, shape (n,).
        tool_aim: Poses fields draw tools to, see TOOL_AIM, shape (r, TOOL_AIM).
        pull: Scratch for what attracts, shape (n,).
        push: Scratch for what repels, and for weights before, shape (n,).
        first_lag: What is asked for after one lag, see `smooth_lead`, shape (n,).
        second_lag: The same after both, shape (n,).
        weight: Scratch: greatest push of each robot, and their sum, shape (r, 2).
        columns: Scratch for how a tool follows each joint, shape (n, 6).
        square: Scratch for linear equations, shape (6, 7).
        twist: Scratch for the velocity of a tool, shape (6,) [m/s], [rad/s].
    """

    notes: LongMatrix
    memory: Matrix
    trail: Matrix
    aim: Vector
    safe: Vector
    tool_aim: Matrix
    pull: Vector
    push: Vector
    first_lag: Vector
    second_lag: Vector
    weight: Matrix
    columns: Matrix
    square: Matrix
    twist: Vector


def lead_of(tables: SceneTables) -> Lead:
    """Arrays for the robots of a scene; nobody leads them."""
    n, robots = len(tables.q_names), len(tables.robots)
    return Lead(
        notes=np.zeros((robots, LEAD_NOTES), dtype=np.int64),
        memory=np.zeros((robots, LEAD_MEMORY)),
        trail=np.zeros((TRAIL, n)),
        aim=np.zeros(n),
        safe=np.zeros(n),
        tool_aim=np.zeros((robots, TOOL_AIM)),
        pull=np.zeros(n),
        push=np.zeros(n),
        first_lag=np.zeros(n),
        second_lag=np.zeros(n),
        weight=np.zeros((robots, 2)),
        columns=np.zeros((n, 6)),
        square=np.zeros((6, 7)),
        twist=np.zeros(6),
    )
