"""State of the guidance by the guard: goals of fields, retreats, trails."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables
from armguard.table import LongMatrix, Matrix, Vector, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Greatest number of configurations in the trail of a robot.
TRAIL = 512

# Places in `Lead.notes`.
LED = 0  # source of its motion in this cycle, see OPERATOR
GOAL = 1  # kind of the goal of its field, see NO_GOAL
SUSPENDED = 2  # 1 if a stop suspended its field until it is engaged
IN_MINIMUM = 3  # 1 if its field is in a local minimum
WAY = 4  # phase of its retreat, see STAYS
BEGUN = 5  # 1 if its retreat has begun: a stop ends it
LET_GO = 6  # 1 if its operator requested zero velocity since the retreat began
KEEP = 7  # oldest configurations of its trail that the retreat does not use
THEN_SAFE = 8  # 1 if the retreat goes on from there to a safe configuration
HEAD = 9  # row of the trail that is written next
COUNT = 10  # configurations in its trail
TOOL_BODY = 11  # body of the tool that its field moves to a pose
LEAD_NOTES = 12

# Source of the motion of a robot.
OPERATOR = 0
BY_FIELD = 1
BY_RETREAT = 2

# Goals of a field.
NO_GOAL = 0
JOINTS_GOAL = 1
TOOL_GOAL = 2

# Phases of a retreat.
STAYS = 0  # no retreat
ALONG = 1  # back along the trail
STRAIGHT = 2  # straight to a safe configuration
ENDS = 3  # brakes to rest at its end

# Places in `Lead.memory`.
PULL = 0  # share of its top speeds that it has reached [-]
LEFT = 1  # time to the goal at top speed [s]
BEST = 2  # least value of LEFT so far [s]
IDLE = 3  # time since BEST last fell [s]
STANDS = 4  # time for which it is guided and at rest [s]
LEAD_MEMORY = 5

# Numbers of a goal of a tool: its pose [R | p] in the world, then the origin of the
# tool in its body.
TOOL_AIM = 15


@table
class Lead(NamedTuple):
    """Arrays of one guard for the guidance of its robots.

    Attributes:
        notes: State of the guidance of each robot, see LED, shape (r, LEAD_NOTES).
        memory: Speeds and times of each robot, see PULL, shape (r, LEAD_MEMORY).
        trail: Past configurations of each robot, a ring, shape (TRAIL, n) [rad or m].
        aim: Goals of fields in joint space, shape (n,) [rad or m].
        safe: Safe configurations of retreats, shape (n,) [rad or m].
        tool_aim: Goals of fields as poses of tools, see TOOL_AIM, (r, TOOL_AIM).
        pull: Scratch for attractive velocities, shape (n,) [rad/s or m/s].
        push: Scratch for repulsive velocities, and for weights before, shape (n,).
        first_lag: Requested velocities after one lag, see `smooth_lead`, shape (n,)
            [rad/s or m/s].
        second_lag: Requested velocities after both lags, shape (n,) [rad/s or m/s].
        weight: Scratch for the sum of pushes on each robot, shape (r,).
        columns: Scratch for the Jacobian of a tool, shape (n, 6).
        square: Scratch for linear equations, shape (6, 7).
        twist: Scratch for the twist of a tool, shape (6,) [m/s], [rad/s].
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
    weight: Vector
    columns: Matrix
    square: Matrix
    twist: Vector


def lead_of(tables: SceneTables) -> Lead:
    """Arrays for the robots of a scene, all led by their operators."""
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
        weight=np.zeros(robots),
        columns=np.zeros((n, 6)),
        square=np.zeros((6, 7)),
        twist=np.zeros(6),
    )
