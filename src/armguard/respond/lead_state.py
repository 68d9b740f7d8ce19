"""State of the guidance by the guard: goals of fields, retreats, trails."""

from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.record import Records, record, records
from armguard.scene.tables import SceneTables
from armguard.table import Matrix, Vector, table

Floats = NDArray[np.float64]

# Greatest number of configurations in the trail of a robot.
TRAIL = 512


class Source(IntEnum):
    """Source of the motion of a robot."""

    OPERATOR = 0
    FIELD = 1
    RETREAT = 2


class Goal(IntEnum):
    """Kind of the goal of a field."""

    NONE = 0
    JOINTS = 1
    TOOL = 2


class Retreat(IntEnum):
    """Phase of a retreat."""

    NONE = 0
    ALONG_TRAIL = 1
    STRAIGHT = 2  # to a safe configuration
    BRAKING = 3  # to rest at its end


@record
class LeadNotes:
    """State of the guidance of a robot.

    Attributes:
        source: Source of its motion in this cycle, see `Source`.
        goal: Kind of the goal of its field, see `Goal`.
        suspended: 1 if a stop suspended its field until it is engaged.
        in_minimum: 1 if its field is in a local minimum.
        retreat: Phase of its retreat, see `Retreat`.
        begun: 1 if its retreat has begun: a stop ends it.
        released: 1 if its operator requested zero velocity since the retreat began.
        unused: Oldest configurations of its trail that the retreat does not use.
        to_safe: 1 if the retreat goes on from there to a safe configuration.
        head: Row of the trail that is written next.
        count: Configurations in its trail.
        tool_body: Body of the tool that its field moves to a pose.
    """

    source: int
    goal: int
    suspended: int
    in_minimum: int
    retreat: int
    begun: int
    released: int
    unused: int
    to_safe: int
    head: int
    count: int
    tool_body: int


@record
class LeadMemory:
    """Speed and times of a robot under guidance.

    Attributes:
        speed: Share of its top speeds that it has reached [-].
        time_left: Time to the goal at top speed [s].
        least_time_left: Least value of `time_left` so far [s].
        stalled: Time since `least_time_left` last fell [s].
        at_rest: Time for which it is guided and at rest [s].
    """

    speed: float
    time_left: float
    least_time_left: float
    stalled: float
    at_rest: float


@record
class ToolAim:
    """Goal of a field as the pose of a tool.

    Attributes:
        pose: Pose [R | p] of its body in the world.
        origin: Origin of the tool in its body [m].
    """

    pose: Annotated[Floats, (12,)]
    origin: Annotated[Floats, (3,)]


@table
class Lead(NamedTuple):
    """Arrays of one guard for the guidance of its robots.

    Attributes:
        notes: State of the guidance of each robot, shape (r,).
        memory: Speeds and times of each robot, shape (r,).
        trail: Past configurations of each robot, a ring, shape (TRAIL, n) [rad or m].
        aim: Goals of fields in joint space, shape (n,) [rad or m].
        safe: Safe configurations of retreats, shape (n,) [rad or m].
        tool_aim: Goals of fields as poses of tools, shape (r,).
        pull: Scratch for attractive velocities, shape (n,) [rad/s or m/s].
        push: Scratch for repulsive velocities, shape (n,) [rad/s or m/s].
        first_lag: Requested velocities after one lag, see `smooth_lead`, shape (n,)
            [rad/s or m/s].
        second_lag: Requested velocities after both lags, shape (n,) [rad/s or m/s].
        weight: Scratch for the sum of pushes on each robot, shape (r,).
    """

    notes: Annotated[Records[LeadNotes], 1]
    memory: Annotated[Records[LeadMemory], 1]
    trail: Matrix
    aim: Vector
    safe: Vector
    tool_aim: Annotated[Records[ToolAim], 1]
    pull: Vector
    push: Vector
    first_lag: Vector
    second_lag: Vector
    weight: Vector


def lead_of(tables: SceneTables) -> Lead:
    """Arrays for the robots of a scene, all led by their operators."""
    n, robots = len(tables.q_names), len(tables.robots)
    return Lead(
        notes=records(robots, LeadNotes),
        memory=records(robots, LeadMemory),
        trail=np.zeros((TRAIL, n)),
        aim=np.zeros(n),
        safe=np.zeros(n),
        tool_aim=records(robots, ToolAim),
        pull=np.zeros(n),
        push=np.zeros(n),
        first_lag=np.zeros(n),
        second_lag=np.zeros(n),
        weight=np.zeros(robots),
    )
