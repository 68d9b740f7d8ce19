"""State of the evasion of approaching obstacles: arrays allocated once."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.record import Records, record, records
from armguard.robot.kinematics import PRISMATIC
from armguard.scene.tables import SceneTables
from armguard.table import LongVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Greatest number of approaching obstacles that are considered for a robot.
MOST_APPROACHING = 16

# Directions in joint space that fill it evenly.
SPREADS = 32

# A prismatic joint with a shorter stroke is a finger's: it does not evade [m].
SHORT_STROKE = 0.1


@record
class EscapeNotes:
    """State of the evasion of a robot.

    Attributes:
        evading: 1 while it evades an approaching obstacle.
        has_motion: 1 if an escape motion was chosen; else it stays.
        next_candidate: Number of the escape motion that is judged next.
        best_candidate: 1 + number of the best known escape motion while it waits; 0
            for none.
        judged: Escape motions judged while it waits, since it last knew a good one.
    """

    evading: int
    has_motion: int
    next_candidate: int
    best_candidate: int
    judged: int


@record
class EscapeMemory:
    """Times and gap of the evasion of a robot.

    Attributes:
        time_left: Time for which the chosen motion goes on [s].
        clear_time: Time since the last obstacle approached [s].
        best_gap: Least gap on the best known motion while it waits [m].
    """

    time_left: float
    clear_time: float
    best_gap: float


@record
class EscapePlan:
    """Escape motion that is judged, and what it is judged by.

    Attributes:
        own_count: Primitives of the robot.
        approaching_count: Approaching obstacles.
        other_count: Other primitives near its workspace.
        moving_count: Boxes of moving cells near it, see `list_moving`.
        placed: Primitives that were placed.
        delay: Time until a command of this cycle takes effect [s].
        rise: Time in which the joints reach the velocities of the motion [s].
        brake_at: Time after the delay at which the joints begin to brake [s].
        fall: Time in which they brake to rest [s].
        halt_at: Time at which another body stops it; infinite if none does [s].
        horizon: Time at which all approaching obstacles have passed [s].
        closing_speed: Bound on the closing speed of its points and the obstacles [m/s].
        near_at: First time at which the gap is below `NEAR`; infinite if never [s].
        gap: Least gap that was found [m].
        present_gap: Gap at the present positions; NaN before it was measured [m].
        robot_primitive: Primitive of the robot at the least gap.
        obstacle: Number of the obstacle at the least gap, in `approaching`.
    """

    own_count: int
    approaching_count: int
    other_count: int
    moving_count: int
    placed: int
    delay: float
    rise: float
    brake_at: float
    fall: float
    halt_at: float
    horizon: float
    closing_speed: float
    near_at: float
    gap: float
    present_gap: float
    robot_primitive: int
    obstacle: int


@record
class Approaching:
    """An obstacle that approaches a robot, as it was seen last.

    Attributes:
        primitive: Its primitive; -1 - c for cluster c of sensed cells.
        group: Group of its pairs.
        kind: ShapeKind.
        row: Row of its shape, world, shape (16,).
        box: Box around its shape, shape (6,) [m].
        velocity: Its velocity, shape (3,) [m/s].
        radius: Radius of a ball around the middle of its box that holds it too, 0 for
            none [m].
        error: How far off the velocity may be [m/s].
        seen_at: When it was seen, see `Watch.seen_at` [s].
    """

    primitive: int
    group: int
    kind: int
    row: Annotated[Floats, (ROW_WIDTH,)]
    box: Annotated[Floats, (6,)]
    velocity: Annotated[Floats, (3,)]
    radius: float
    error: float
    seen_at: float


@table
class Escape(NamedTuple):
    """Arrays of one guard for the evasion of approaching obstacles.

    Attributes:
        notes: State of the evasion of each robot, shape (r,).
        memory: Times and gaps of each robot, shape (r,).
        way: Joint velocities of the chosen escape motions, shape (n,) [rad/s or m/s].
        plan: The judged motion.
        trial: Joint velocities of the judged motion, shape (n,) [rad/s or m/s].
        own: Primitives of the robot, shape (m,).
        approaching: Approaching obstacles, shape (MOST_APPROACHING,).
        others: Other primitives near the robot's workspace, shape (p,).
        q: Scratch for joint positions on a motion, shape (n,) [rad or m].
        T: Scratch for poses of the bodies at q, shape (b, 12).
        rows: Scratch for primitives of the robot at q, shape (m, 16).
        boxes: Scratch for the boxes of these primitives, shape (m, 6) [m].
        reach: Box around the robot at its present positions, shape (6,) [m].
        shift: Pose that extrapolates an obstacle in time, shape (12,).
        obstacle: Primitive of an obstacle, extrapolated, shape (16,).
        witness: Scratch for the witness of a pair, shape (10,).
        closest: Witness of the pair with the least gap, shape (10,).
        columns: Jacobian of the witness point of that pair, shape (n, 3).
        across: Two unit vectors normal to the velocity of the obstacle, and one along
            it, shape (3, 3).
        useful: 1 for a joint that can evade, 0 for one of a finger, shape (n,).
        spreads: Directions in shares of top speeds, shape (SPREADS, n) [-].
    """

    notes: Annotated[Records[EscapeNotes], 1]
    memory: Annotated[Records[EscapeMemory], 1]
    way: Vector
    plan: EscapePlan
    trial: Vector
    own: LongVector
    approaching: Annotated[Records[Approaching], 1]
    others: LongVector
    q: Vector
    T: Matrix
    rows: Matrix
    boxes: Matrix
    reach: Vector
    shift: Vector
    obstacle: Vector
    witness: Vector
    closest: Vector
    columns: Matrix
    across: Matrix
    useful: LongVector
    spreads: Matrix


def escape_of(tables: SceneTables) -> Escape:
    """Arrays for the robots of a scene, with no approaching obstacle."""
    n, robots = len(tables.q_names), len(tables.robots)
    m, bodies = tables.moving_count, len(tables.parent)
    return Escape(
        notes=records(robots, EscapeNotes),
        memory=records(robots, EscapeMemory),
        way=np.zeros(n),
        plan=records((), EscapePlan),
        trial=np.zeros(n),
        own=np.zeros(m, dtype=np.int64),
        approaching=records(MOST_APPROACHING, Approaching),
        others=np.zeros(len(tables.kinds), dtype=np.int64),
        q=np.zeros(n),
        T=np.zeros((bodies, 12)),
        rows=np.zeros((m, ROW_WIDTH)),
        boxes=np.zeros((m, 6)),
        reach=np.zeros(6),
        shift=np.eye(4)[:3].reshape(12).copy(),
        obstacle=np.zeros(ROW_WIDTH),
        witness=np.zeros(WITNESS_WIDTH),
        closest=np.zeros(WITNESS_WIDTH),
        columns=np.zeros((n, 3)),
        across=np.zeros((3, 3)),
        useful=useful_joints(tables),
        spreads=spread_shares(n),
    )


def useful_joints(tables: SceneTables) -> Longs:
    """1 for each joint that can evade, 0 for one of a finger, shape (n,)."""
    useful = np.ones(len(tables.q_names), dtype=np.int64)
    for body, kind in enumerate(tables.joint_kind):
        j = tables.q_index[body]
        if kind == PRISMATIC and tables.upper[j] - tables.lower[j] < SHORT_STROKE:
            useful[j] = 0
    return useful


def spread_shares(n: int) -> Floats:
    """Shares of top speeds that fill the cube [-1, 1]^n evenly, (SPREADS, n) [-].

    An additive recurrence by powers of the root of x^(n + 1) = x + 1: it needs no
    random numbers, so the result is the same on every machine.
    """
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (n + 1.0))
    steps = root ** -np.arange(1.0, n + 1.0)
    counts = np.arange(1.0, SPREADS + 1.0)[:, None]
    return 2.0 * ((0.5 + counts * steps) % 1.0) - 1.0
