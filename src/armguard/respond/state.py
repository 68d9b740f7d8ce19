"""What responding needs and remembers: arrays made once, written every cycle."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.respond.daqp_interface import daqp_memory
from armguard.respond.escape_state import Escape
from armguard.respond.lead_state import Lead
from armguard.respond.solver import MOST_ITERATIONS, PRIMAL_TOLERANCE
from armguard.scene.settings import FarStart, ResponseName, Sharing
from armguard.scene.tables import SceneTables
from armguard.table import TABLE, LongMatrix, LongVector, Matrix, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Rows a robot's program has room for; those that no admissible velocity can break are
# left out, which is most of them.
ROWS = 96

# Places in the settings of a robot.
KIND = 0  # its response, see KINDS
SHARING = 1  # how pairs of two robots are shared, see SHARINGS
PRIORITY = 2  # the robot of the higher one is yielded to
RECOVER_SPEED = 3  # shares of top speeds [-]
RESUME_SPEED = 4
FAR = 5  # [rad or m]
FAR_START = 6  # 1 if a first position far away is refused
EVADE_TIME = 7  # 0 if it does not evade [s]
EVADE_SPEED = 8  # share of top speeds [-]
FIELD_SPEED = 9  # the same
ATTRACTION = 10  # [1/s]
REPULSION = 11  # [m/s]
INFLUENCE = 12  # [m]
PATIENCE = 13  # [s]
SETTINGS = 14

# Responses by number.
STOP = 0
SLOW = 1
DEFLECT = 2
FIELD = 3
KINDS: dict[ResponseName, int] = {
    "stop": STOP,
    "slow": SLOW,
    "deflect": DEFLECT,
    "field": FIELD,
}

# How what a pair of two robots has left is shared.
BY_CONTRIBUTION = 0
EQUALLY = 1
BY_PRIORITY = 2
SHARINGS: dict[Sharing, int] = {
    "contribution": BY_CONTRIBUTION,
    "equal": EQUALLY,
    "priority": BY_PRIORITY,
}
FAR_STARTS: dict[FarStart, int] = {"ramp": 0, "refuse": 1}

# Places in what is remembered and found of a robot.
STATE = 0  # how it stands to its operator, see `engagement`
BLOCKED = 1  # why it does not simply follow, see `Blocked`
GAVE_POSITIONS = 2  # 1 if its operator told it positions in the last cycle
REFUSED = 3  # 1 if it waits since a first position was far away
RETREATS = 4  # 1 if it is to leave what is too near
ROW_COUNT = 5
BREAKS = 6  # 1 if its target breaks a row
CROWDED = 7  # 1 if there were more rows than room
LEADS_AWAY = 8  # 1 if what is asked for opens near pairs of it, -1 if it closes any
ASKS = 9  # 1 if anything is asked of it
TANGLED = 10  # 1 if a joint that opens one pair that is too near closes another one
ORDERED = 11  # reason it is to stand still for until it is engaged, 0 for none
OPENS = 12  # 1 if its target, and what is asked for, surely opens every near pair
CHANGED = 13  # why it is told something else than it was asked for, see `Changed`
NOTES = 14

# Which way a joint may move of a robot that leaves what is too near, in `ways_out`:
# 1 or -1 where only that way opens all of it, 0 where it moves none.
EITHER_WAY = 2  # one way opens a pair, and the other way another one

# Pairs of which is remembered what they have left, and places in the row of one.
REMEMBERED = 2048
PAIR_KEY = 0  # its two primitives
MET = 1  # number of the cycle in which it was met last, NEVER if none
NEVER = -1000

# What operators tell, in `asking`.
FORM = 0
VELOCITIES = 0
POSITIONS = 1
TWISTS = 2
STANDSTILL = 3
TWIST_COUNT = 1  # how many twists there are
STOP_REASON = 2  # why robots are to stand still
ASKING = 3

# Twists that can be told at once, and what is told of each.
MOST_TWISTS = 8
TOOL_ROBOT = 0
TOOL_BODY = 1
TOOL_POINT = 2  # its origin in its body, 3 numbers [m]
TOOL_TWIST = 5  # 6 numbers [m/s], [rad/s]
TWIST_ROW = 11

# What a cycle lets every pair lose, in `pace`.
STEP = 0  # time since the last commands [s]
NEARER = 1  # share of what a pair has left [-]
LESS = 2  # the same joint by joint [-]
PACE = 3


@table
class Response(NamedTuple):
    """Arrays of one guard's responses.

    Attributes:
        settings: Settings of each robot, shape (r, SETTINGS).
        notes: What is remembered and found of each, shape (r, NOTES).
        asking: See FORM, shape (ASKING,).
        twists: Twists of tools they ask for, shape (MOST_TWISTS, TWIST_ROW).
        tool_columns: Scratch for how tools follow joints, shape (n, 6 MOST_TWISTS).
        tool_square: Scratch for linear equations, see `joint_velocities`.
        tool_speeds: Scratch for the twists of one robot, shape (6 MOST_TWISTS,).
        requested: Velocities the operators ask for, shape (n,).
        goal: Positions they ask for, shape (n,).
        far: How far the joints are from these, shape (n,).
        held: Where the joints were told to be by now, NaN before anything is known of
            that, shape (n,).
        target: What may be told at once of what is asked, shape (n,).
        low: Least velocities, shape (n,).
        high: Greatest velocities, shape (n,).
        brake: Velocities that keep every row, shape (n,).
        raw: Scratch for a row, shape (n,).
        rows: Unit rows of each robot's program, shape (r · ROWS, n).
        limits: What they must not exceed, shape (r · ROWS,).
        eased: The same where the declared stop is to keep all of them, (r · ROWS,).
        away: Joint motion that leads away from what comes, shape (n,).
        ways_out: Which way each joint leads out of what is too near, shape (n,).
        speed: Share of its top speeds each robot may use, shape (r,) [-].
        pace: See STEP, shape (PACE,).
        closing_time: Time for which a velocity of each joint counts that closes a
            pair, until it has stopped, shape (n,) [s].
        opening_time: The same of one that opens it, shape (n,) [s].
        program: Memory of the program that is solved, see `programs`, shape (k,).
        solver: The solver's, see `daqp_memory`, shape (k,).
        commanded: What is handed out, see `Command`, shape (4 n + 4 r,).
        lead: What leads robots in their operators' place.
        escape: Ways out of the way of approaching obstacles.
        spares: What remembered pairs have left, see `spares`, shape (REMEMBERED,) [m].
        spare_of: Which pairs, and when they were met, shape (REMEMBERED, 2).
        missed: By how much each joint misses what it is told, shape (n,) [rad/s].
        held_since: Since when each robot waits for a person, NaN if it does not, (r,)
            [s].
        passing: Limits of the rows for a target that opens every near pair, shape
            (r · ROWS,).
    """

    settings: Matrix
    notes: LongMatrix
    asking: LongVector
    twists: Matrix
    tool_columns: Matrix
    tool_square: Matrix
    tool_speeds: Vector
    requested: Vector
    goal: Vector
    far: Vector
    held: Vector
    target: Vector
    low: Vector
    high: Vector
    brake: Vector
    raw: Vector
    rows: Matrix
    limits: Vector
    eased: Vector
    away: Vector
    ways_out: LongVector
    speed: Vector
    pace: Vector
    closing_time: Vector
    opening_time: Vector
    program: Vector
    solver: LongVector
    commanded: Vector
    lead: Annotated[Lead, TABLE]
    spares: Vector
    spare_of: LongMatrix
    missed: Vector
    escape: Annotated[Escape, TABLE]
    held_since: Vector
    passing: Vector


open_response = opener(Response)


def response_of(tables: SceneTables, lead: Lead, escape: Escape) -> Response:
    """Arrays for the responses of a scene.

    Args:
        tables: The scene.
        lead: What leads robots in their operators' place.
        escape: Ways out of the way of approaching obstacles.
    """
    n, robots = len(tables.q_names), len(tables.robots)
    settings = np.zeros((robots, SETTINGS))
    for row, part in zip(settings, tables.robots, strict=True):
        chosen = part.response
        row[KIND] = KINDS[chosen.kind]
        row[SHARING] = SHARINGS[chosen.sharing]
        row[PRIORITY] = chosen.priority
        row[RECOVER_SPEED] = chosen.recover_speed
        row[RESUME_SPEED] = chosen.resume_speed
        row[FAR] = chosen.far
        row[FAR_START] = FAR_STARTS[chosen.far_start]
        row[EVADE_TIME] = chosen.evade_time if chosen.evade else 0.0
        row[EVADE_SPEED] = chosen.evade_speed
        row[FIELD_SPEED] = chosen.field_speed
        row[ATTRACTION] = chosen.attraction
        row[REPULSION] = chosen.repulsion
        row[INFLUENCE] = chosen.influence
        row[PATIENCE] = chosen.patience
    return Response(
        settings=settings,
        notes=np.zeros((robots, NOTES), dtype=np.int64),
        asking=np.zeros(ASKING, dtype=np.int64),
        twists=np.zeros((MOST_TWISTS, TWIST_ROW)),
        tool_columns=np.zeros((n, 6 * MOST_TWISTS)),
        tool_square=np.zeros((6 * MOST_TWISTS, 6 * MOST_TWISTS + 1)),
        tool_speeds=np.zeros(6 * MOST_TWISTS),
        requested=np.zeros(n),
        goal=np.zeros(n),
        far=np.zeros(n),
        held=np.full(n, np.nan),
        target=np.zeros(n),
        low=np.zeros(n),
        high=np.zeros(n),
        brake=np.zeros(n),
        raw=np.zeros(n),
        rows=np.zeros((robots * ROWS, n)),
        limits=np.zeros(robots * ROWS),
        eased=np.zeros(robots * ROWS),
        away=np.zeros(n),
        ways_out=np.zeros(n, dtype=np.int64),
        speed=np.zeros(robots),
        pace=np.zeros(PACE),
        closing_time=np.zeros(n),
        opening_time=np.zeros(n),
        program=np.zeros(n * n + ROWS * n + 3 * (ROWS + n) + 2 * n),
        solver=daqp_memory(n + ROWS, PRIMAL_TOLERANCE, MOST_ITERATIONS),
        commanded=np.zeros(4 * n + 4 * robots),
        lead=lead,
        spares=np.zeros(REMEMBERED),
        spare_of=np.full((REMEMBERED, 2), NEVER, dtype=np.int64),
        missed=np.zeros(n),
        escape=escape,
        held_since=np.full(robots, np.nan),
        passing=np.zeros(robots * ROWS),
    )
