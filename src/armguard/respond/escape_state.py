"""What getting out of the way needs and remembers: arrays made once."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.robot.kinematics import PRISMATIC
from armguard.scene.tables import SceneTables
from armguard.table import LongMatrix, LongVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Places in what is remembered of a robot.
EVADING = 0  # 1 while it gets out of the way of something
HAS_WAY = 1  # 1 if a way was chosen; else it is to stay
NEXT_TRY = 2  # the way that is judged next
KNOWN = 3  # 1 + the best way it knows while it waits; 0 if it knows none
TRIED = 4  # how many it judged while it waits since it knew a good one
ESCAPE_NOTES = 5

# The same in numbers.
LEFT = 0  # time for which the chosen way goes on [s]
DONE = 1  # time since nothing comes any more [s]
WORTH = 2  # what the best way it knows while it waits is worth [m]
ESCAPE_MEMORY = 3

# Places in `Escape.counts`, what a robot's ways are judged with in this cycle.
OWN_COUNT = 0  # its primitives
APPROACHING_COUNT = 1  # primitives that come at it
OTHER_COUNT = 2  # all else that is near its reach
SPENT = 3  # primitives that were placed
COUNTS = 4

# Places in `Escape.plan`, the way that is judged.
DELAY = 0  # until what is told now takes effect [s]
RISE = 1  # time in which it changes to the velocities of the way [s]
GO = 2  # time after the delay at which it begins to come to rest [s]
FALL = 3  # time in which it does [s]
HALT = 4  # when something else stops it; infinite if nothing does [s]
HORIZON = 5  # when all that comes has passed [s]
RATE = 6  # how fast any of its points may approach what comes [m/s]
WHEN = 7  # when something came nearer than is called near; infinite if never [s]
GAP = 8  # the least gap that was found [m]
ROBOT_PRIMITIVE = 9  # primitive it was found for
OBSTACLE_PRIMITIVE = 10  # primitive that came
NOW_GAP = 11  # the gap where the robot is; not a number if nobody looked yet [m]
PLAN = 12

# Primitives that come at a robot at once that are looked at.
MOST_APPROACHING = 16

# Directions in which an arm may be led that favour none of its joints.
SPREADS = 32

# A joint that slides by less than this is a finger's: it leads nothing out of the way
# [m].
SHORT_STROKE = 0.1


@table
class Escape(NamedTuple):
    """Arrays of one guard for getting out of the way.

    Attributes:
        notes: See EVADING, shape (r, ESCAPE_NOTES).
        memory: See LEFT, shape (r, ESCAPE_MEMORY).
        way: Velocities each robot was led at, shape (n,) [rad/s or m/s].
        counts: See OWN_COUNT, shape (COUNTS,).
        plan: See DELAY, shape (PLAN,).
        trial: Velocities of the way that is judged, shape (n,) [rad/s or m/s].
        own: Primitives of the robot, shape (m,).
        approaching: Primitives that come at it, shape (MOST_COMERS,).
        others: All else that is near its reach, shape (p,).
        q: Scratch for positions on a way, shape (n,) [rad or m].
        T: Scratch for poses there, shape (b, 12).
        rows: Scratch for primitives there, shape (m, 16).
        boxes: Scratch for their boxes, shape (m, 6) [m].
        reach: Box around the robot as it stands, shape (6,) [m].
        shift: Pose by which what comes is moved on, shape (12,).
        obstacle: What comes, moved on, shape (16,).
        witness: Scratch for a pair, shape (10,).
        closest: The pair of the least gap, shape (10,).
        columns: How each joint moves the point that would be hit, shape (n, 3).
        across: Two unit vectors across what comes, and one along it, shape (3, 3).
        useful: 1 for a joint that can lead out of the way, shape (n,).
        spreads: Shares of top speeds, shape (SPREADS, n) [-].
    """

    notes: LongMatrix
    memory: Matrix
    way: Vector
    counts: LongVector
    plan: Vector
    trial: Vector
    own: LongVector
    approaching: LongVector
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
    """Arrays for the robots of a scene; nothing comes at them."""
    n, robots = len(tables.q_names), len(tables.robots)
    m, bodies = tables.moving_count, len(tables.parent)
    return Escape(
        notes=np.zeros((robots, ESCAPE_NOTES), dtype=np.int64),
        memory=np.zeros((robots, ESCAPE_MEMORY)),
        way=np.zeros(n),
        counts=np.zeros(COUNTS, dtype=np.int64),
        plan=np.zeros(PLAN),
        trial=np.zeros(n),
        own=np.zeros(m, dtype=np.int64),
        approaching=np.zeros(MOST_APPROACHING, dtype=np.int64),
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
    """1 for each joint that can lead an arm out of the way, 0 for fingers, (n,)."""
    useful = np.ones(len(tables.q_names), dtype=np.int64)
    for body, kind in enumerate(tables.joint_kind):
        j = tables.q_index[body]
        if kind == PRISMATIC and tables.upper[j] - tables.lower[j] < SHORT_STROKE:
            useful[j] = 0
    return useful


def spread_shares(n: int) -> Floats:
    """Shares of top speeds that fill the cube [-1, 1]^n evenly, (SPREADS, n) [-].

    An additive recurrence by powers of the root of x^(n + 1) = x + 1: as it needs no
    random numbers it is the same everywhere.
    """
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (n + 1.0))
    steps = root ** -np.arange(1.0, n + 1.0)
    counts = np.arange(1.0, SPREADS + 1.0)[:, None]
    return 2.0 * ((0.5 + counts * steps) % 1.0) - 1.0
