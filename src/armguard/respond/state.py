"""State of the responses: arrays allocated once and written every cycle."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.record import Records, record, records
from armguard.respond.daqp_interface import daqp_memory
from armguard.respond.escape_state import Escape
from armguard.respond.lead_state import Lead
from armguard.respond.solver import MOST_ITERATIONS, PRIMAL_TOLERANCE
from armguard.scene.settings import CHOICES
from armguard.scene.tables import SceneTables
from armguard.table import TABLE, LongVector, Matrix, Vector, opener, table

Floats = NDArray[np.float64]

# Greatest number of constraint rows of a robot's quadratic program. Rows that no
# admissible velocity can violate are left out; these are most of them.
ROWS = 96

# How two robots share the headroom of their pair, by number.
BY_CONTRIBUTION, EQUALLY, BY_PRIORITY = (
    CHOICES["sharing"].index(name) for name in ("contribution", "equal", "priority")
)


@record
class Behaviour:
    """Response of a robot and its settings, see `RESPONSES` and `ResponseSettings`.

    Attributes:
        kind: The response, by its place in `RESPONSES`.
        stops: See `ResponseKind`, from here to `solves`.
        scales: See there.
        solves: See there.
        sharing: See `ResponseSettings`, from here on; choices by number.
        priority: See there.
        recover_speed: See there.
        resume_speed: See there.
        far: See there.
        far_start: See there.
        evade_time: See there; 0 if the robot does not evade.
        evade_speed: See there.
        field_speed: See there.
        attraction: See there.
        repulsion: See there.
        influence: See there.
        patience: See there.
    """

    kind: int
    stops: int
    scales: int
    solves: int
    sharing: int
    priority: float
    recover_speed: float
    resume_speed: float
    far: float
    far_start: int
    evade_time: float
    evade_speed: float
    field_speed: float
    attraction: float
    repulsion: float
    influence: float
    patience: float


@record
class RobotNotes:
    """State of the response of a robot.

    Attributes:
        engagement: Engagement by its operator, see `Engagement`.
        blocked: Why it does not follow its operator, see `Blocked`.
        gave_positions: 1 if its operator requested positions in the last cycle.
        refused: 1 if it waits because the first requested position was far away.
        recovers: 1 if it recovers from pairs that are too near, or evades.
        row_count: Constraint rows of its program.
        violates: 1 if its target violates a row.
        overflows: Constraint overflow: 1 if there were more rows than room.
        request_opens: 1 if the request opens near pairs and closes none, -1 if it
            closes any.
        requests_motion: 1 if motion is requested of it.
        coupled: Coupled joints: 1 if a joint opens one too near pair, closes another.
        ordered_stop: Reason of an ordered stop that lasts until it is engaged, 0 for
            none.
        target_opens: 1 if its target and its request surely open every near pair.
        changed: Why its command differs from the request, see `Changed`.
    """

    engagement: int
    blocked: int
    gave_positions: int
    refused: int
    recovers: int
    row_count: int
    violates: int
    overflows: int
    request_opens: int
    requests_motion: int
    coupled: int
    ordered_stop: int
    target_opens: int
    changed: int


# Escape direction of a joint in a recovery, in `ways_out`: 1 or -1 if only that sign
# opens all pairs that are too near, 0 if the joint moves none of them.
EITHER_WAY = 2  # each sign opens one pair and closes another

# Pairs whose headroom is remembered, and `key` and `last_near` where there is none.
REMEMBERED = 2048
NEVER = -1000


@record
class RememberedPair:
    """Pair whose headroom is remembered.

    Attributes:
        key: Its two primitives.
        last_near: Number of the last cycle in which it was near.
    """

    key: int
    last_near: int


# Form of a request. These are no enumeration, since Python passes them to compiled
# entries, which would be compiled a second time for its members.
VELOCITIES = 0
POSITIONS = 1
TWISTS = 2
STANDSTILL = 3


@record
class Request:
    """What operators request in a cycle.

    Attributes:
        form: Form of the request, see VELOCITIES.
        twist_count: Number of requested twists.
        stop_reason: Reason of the ordered stop.
    """

    form: int
    twist_count: int
    stop_reason: int


# Greatest number of twists in a cycle. A request is a vector of numbers, whatever its
# form; each twist is a row of them: robot and body of the tool, then from these places
# on the `point` and the `twist` of `ToolTwist`.
MOST_TWISTS = 8
TOOL_POINT = 2
TOOL_TWIST = 5
TWIST_ROW = 11


@record
class ToolTwist:
    """Requested twist of a tool.

    Attributes:
        robot: Robot of the tool.
        body: Body of the tool.
        point: Origin of the tool in its body [m].
        twist: Linear and angular velocity [m/s], [rad/s].
    """

    robot: int
    body: int
    point: Annotated[Floats, (3,)]
    twist: Annotated[Floats, (6,)]


@record
class HeadroomLoss:
    """Greatest loss of headroom of a pair in a cycle.

    Attributes:
        time: Time since the last commands [s].
        approach: Share of the headroom, in an approach row [-].
        holding: Share of the headroom, in a holding row [-].
    """

    time: float
    approach: float
    holding: float


@table
class Response(NamedTuple):
    """Arrays of one guard's responses.

    Attributes:
        settings: Behaviour of each robot, shape (r,).
        notes: State of each robot, shape (r,).
        request: The request of this cycle.
        twists: Requested twists of tools, shape (MOST_TWISTS,).
        tool_columns: Scratch for tool Jacobians, shape (n, 6 MOST_TWISTS).
        tool_square: Scratch for linear equations, see `joint_velocities`.
        tool_speeds: Scratch for the twists of one robot, shape (6 MOST_TWISTS,).
        requested: Requested joint velocities, shape (n,) [rad/s or m/s].
        goal: Requested joint positions, shape (n,) [rad or m].
        far: Distance of set-points from requested positions, shape (n,) [rad or m].
        held: Position set-points of the joints, NaN before the first cycle, shape (n,)
            [rad or m].
        target: Velocities that are to be proven, within the limits of this cycle, shape
            (n,) [rad/s or m/s].
        low: Lower bounds of the velocities, shape (n,) [rad/s or m/s].
        high: Upper bounds of the velocities, shape (n,) [rad/s or m/s].
        brake: Velocities after a cycle of the declared stop, shape (n,) [rad/s or m/s].
        raw: Scratch for a distance gradient, shape (n,).
        rows: Constraint rows of unit length of each robot, shape (r · ROWS, n).
        limits: Upper bounds of the rows, shape (r · ROWS,).
        eased: Relaxed bounds of the rows: the declared stop satisfies all of them,
            shape (r · ROWS,).
        away: Joint motion that leads away from approaching obstacles, shape (n,).
        ways_out: Escape direction of each joint in a recovery, see EITHER_WAY, (n,).
        speed: Share of its top speeds that each robot may use, shape (r,) [-].
        loss: Greatest loss of headroom in this cycle.
        closing_time: Time until rest for which a velocity of each joint counts that
            closes a pair, shape (n,) [s].
        opening_time: Time until rest for which a velocity of each joint counts that
            opens a pair, shape (n,) [s].
        program: Memory of the quadratic program, see `programs`, shape (k,).
        solver: Memory of the solver, see `daqp_memory`, shape (k,).
        commanded: Numbers of the command, see `Command`, shape (4 n + 4 r,).
        lead: Guidance of robots by the guard.
        escape: Evasion of approaching obstacles.
        spares: Headroom of remembered pairs, see `spares`, shape (REMEMBERED,) [m].
        spare_of: Each remembered pair, shape (REMEMBERED,).
        missed: Lasting tracking error of each joint, shape (n,) [rad/s or m/s].
        held_since: Time from which each robot waits for a person, NaN if it does not,
            shape (r,) [s].
        passing: Upper bounds of the rows for a target that opens every near pair, shape
            (r · ROWS,).
    """

    settings: Annotated[Records[Behaviour], 1]
    notes: Annotated[Records[RobotNotes], 1]
    request: Request
    twists: Annotated[Records[ToolTwist], 1]
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
    loss: HeadroomLoss
    closing_time: Vector
    opening_time: Vector
    program: Vector
    solver: LongVector
    commanded: Vector
    lead: Annotated[Lead, TABLE]
    spares: Vector
    spare_of: Annotated[Records[RememberedPair], 1]
    missed: Vector
    escape: Annotated[Escape, TABLE]
    held_since: Vector
    passing: Vector


open_response = opener(Response)


def response_of(
    tables: SceneTables, settings: Any, lead: Lead, escape: Escape
) -> Response:
    """Arrays for the responses of a scene.

    Args:
        tables: The scene.
        settings: `Behaviour` of each robot, shape (r,).
        lead: Guidance of robots by the guard.
        escape: Evasion of approaching obstacles.
    """
    n, robots = len(tables.q_names), len(tables.robots)
    spare_of = records(REMEMBERED, RememberedPair)
    spare_of.fill(NEVER)
    return Response(
        settings=settings,
        notes=records(robots, RobotNotes),
        request=records((), Request),
        twists=records(MOST_TWISTS, ToolTwist),
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
        loss=records((), HeadroomLoss),
        closing_time=np.zeros(n),
        opening_time=np.zeros(n),
        program=np.zeros(n * n + ROWS * n + 3 * (ROWS + n) + 2 * n),
        solver=daqp_memory(n + ROWS, PRIMAL_TOLERANCE, MOST_ITERATIONS),
        commanded=np.zeros(4 * n + 4 * robots),
        lead=lead,
        spares=np.zeros(REMEMBERED),
        spare_of=spare_of,
        missed=np.zeros(n),
        escape=escape,
        held_since=np.full(robots, np.nan),
        passing=np.zeros(robots * ROWS),
    )
