"""What a guard remembers of its inputs and of the stops it has ordered."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.motion.state import CLOCK, PLANS
from armguard.scene.tables import SceneTables
from armguard.table import (
    IntMatrix,
    IntVector,
    LongMatrix,
    LongVector,
    Matrix,
    Vector,
    table,
)

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# An arm is slowed if a stop would have to be ordered within this time [s].
SLOW_TIME_DEFAULT = 0.1

# A slowed robot is called slow until its time left is this much longer [-].
HYSTERESIS = 1.25

# Places in `Watch.given`: what a cycle was handed.
NOW_TIME = 0  # time of the cycle [s]; NaN if nobody said
HAS_VELOCITY = 1  # 1 if velocities came with the positions
COMMANDED = 2  # 1 if what the arms are told goes through the guard
JUDGED = 3  # 1 if the input could be judged
GIVEN = 4

# Places in `Watch.last`.
LAST_NOW = 0  # time of the last cycle [s]
FORCED = 1  # reason why every robot must stop in this cycle, 0 for none
UNANNOUNCED = 2  # how much later than its time the last cycle may have been [s]
ORDERED_AT = 3  # when orders of a refused cycle count as given [s]; infinite: unknown
LAST = 4

# Places in `Watch.pace`.
PERIOD = 0  # from one cycle to the next [s]
LATE = 1  # how much later it may come [s]
SLOW_TIME = 2  # a stop that must be ordered within this time slows the arm [s]
PACE = 3

# Phases of a robot.
RESTING = 0  # at rest after a stop, or at the start: its operator waits
RUNNING = 1  # its operator moves it
STOPPING = 2  # a controlled stop was ordered
BRAKING = 3  # the brake was ordered, since the stop was not what was declared
LOST = 4  # the brake is not what was declared either
RECOVERING = 5  # it leaves what is too near, on ways that only lead away

# Ways into a recovery, in `Watch.recover`.
LEAVES = 1
AT_REST = 2
AT_WORK = 3

# And out of it: it is stopped, as its operator lets go of it or leads it back.
GIVES_UP = 4

# In a scene of so few primitives it takes less time to go through all pairs than to
# look for those that are near.
FEW = 128

# Commands kept beyond those that may be under way: cycles may come early.
SPARE_COMMANDS = 8

# Pairs noted of a cycle, which may be proven again by what they had left.
JUDGED_ROOM = 4096

# Places in `Watch.hangs`.
STUCK_AT = 0  # what the joint measures [rad or m]
COMMANDED_FOR = 1  # for how long it was told to move since it does so [s]
COMMANDED_WAY = 2  # how far at least [rad or m]
STUCK_ROW = 3

# Delays of drives that are looked for: each is one more of these shares of the declared
# delay of commands, the fourth is that delay itself [-].
DELAY_STEPS = 8
DELAY_SHARE = 0.25

# Places in `Watch.agreement`.
LATEST = 0  # measured velocity of the last believed sample, NaN if it had none
EARLIER = 1  # the same of the sample before
AHEAD_SUM = 2  # how far the positions got beyond what the velocities explain
BEHIND_SUM = 3  # how far they stayed behind it
AHEAD_NEXT = 4  # the same two, if the sample of this cycle is believed
BEHIND_NEXT = 5
AGREEMENT = 6

# What was known of a joint's stop in one direction, see `Watch.judged_ways`.
WAY = 0  # whole way, settling included [rad]
BACKWARDS = 1  # speed if it only gets back [rad/s]
SETTLES = 2  # time until it has settled [s]
RESTS = 3  # way at rest, once it has settled [rad]
JUDGED_WAY = 4

# Samples kept of each joint, from which velocities are estimated.
HISTORY = 16


@table
class Watch(NamedTuple):
    """Inputs of a cycle and memory of the cycles before.

    Attributes:
        stamps: Time each robot was measured, shape (r,) [s].
        given: See NOW_TIME, shape (GIVEN,).
        velocity: Velocities that came with the positions, shape (n,).
        last: See LAST_NOW, shape (LAST,).
        pace: See PERIOD, shape (PACE,).
        last_stamp: Stamp of each robot's last sample, shape (r,) [s].
        sample_count: Samples in each robot's history, shape (r,).
        sample_t: Their stamps, newest first, shape (r, HISTORY) [s].
        sample_q: Their positions, newest first, shape (n, HISTORY).
        phase: Phase of each robot, shape (r,).
        ordered: When its stop or brake was ordered, shape (r,) [s].
        must: 1 where a robot must stop in this cycle, shape (r,).
        cause: Reason of each robot's last order, shape (r,).
        fastest: Greatest speed the ordered stop leaves each joint, shape (n,).
        fastest_at: Time that is for, shape (r,) [s].
        rest_low: Least position each joint of a stopping robot can get to, shape (n,).
        rest_high: Greatest, shape (n,).
        rest_began: When it was last found at rest after moving, shape (r,) [s].
        rested: Cycles in a row in which each stopped robot was at rest, shape (r,).
        level: Level of each robot in the last cycle, shape (r,).
        time_left: Least time left of each robot's pairs, shape (r,) [s].
        disproved: 1 where a joint broke a declared figure, shape (n,).
        model: Model error of each moving primitive's robot, shape (m,) [m].
        base: How far an error of the base moves each, shape (m,) [m].
        top_speed: Greatest speed of primitives no robot moves, (p,) or (0,) [m/s].
        seen_at: When each of them was seen, shape (p,) or (0,) [s].
        robot_of: Robot of each moving primitive, shape (m,).
        movers: Primitives whose top speed is not 0, shape (k,).
        pairs: Every checked pair of a small scene, see `all_pairs`, shape (c, 2) [-].
        pair_need: What each of them must keep whatever its robots do, without the way
            of an object since it was seen, shape (c,) [m].
        look: Scratch for how far each primitive must look, shape (p,) [m].
        wanted: Velocities to be told to the joints in this cycle, shape (n,).
        sent: What they were told before, in turn, shape (c, n).
        sent_at: When, shape (c,) [s].
        held: 1 where each robot was told to stay where it rests, shape (c, r).
        sent_count: How often, shape (1,) [-].
        commanded: What they were told last, shape (n,).
        commanded_at: When; long ago if never, shape (1,) [s].
        under_way: Least and greatest velocity each joint may have been told and not
            reached yet, shape (n, 2).
        driven_to: The same without what was told to robots that rest, which are held
            and do not drift; inf and -inf if nothing else is under way, shape (n, 2).
        band: Between which velocities each joint was or was driven to in the last
            cycle, shape (n, 2).
        deficit: How much nearer than it must be at rest any pair of each robot is,
            shape (r,) [m].
        relief: The same when its recovery began, shape (r,) [m].
        relieved: 1 where a pair of each robot still is, shape (r,).
        tool_body: Body of each robot's tool, shape (r,).
        tool_point: Its origin there, shape (r, 3) [m].
        row: Scratch for a number of each joint, shape (n,).
        recover: LEAVES for a robot at rest that is to leave what is too near; AT_REST
            or AT_WORK for one that is to evade what comes, by where it was; GIVES_UP
            for one that leaves no longer; else 0, shape (r,).
        evades: 1 for a robot that gets out of the way of what comes, shape (r,).
        object_velocity: Velocity each of them was seen with, shape (p, 3) or (0, 3)
            [m/s].
        evaded: Robots that get out of the way of each of them, a bit for each, shape
            (p,) or (0,).
        judged_pairs: Pairs judged in this cycle, and their rows or -1, shape (k, 3).
        judged_left: What each of them had left; -inf where that says little, (k,) [m].
        judged_count: How many; -1 if there were too many, shape (1,).
        judged_ways: Each joint's stop then, in its positive and its negative direction,
            shape (2 · PLANS · n, JUDGED_WAY).
        judged_clock: Clocks of the stops then, shape (PLANS · r, CLOCK).
        judged_settled: When everything had settled then, shape (1,) [s].
        grown: How much farther each primitive may get since, shape (m,) [m].
        yields: 1 for one of which less than it wants may be told before it is stopped,
            shape (r,).
        stuck: Since when each joint measures the same, see `hanging`, shape (n, HANGS).
        looked_at: Stamp of each robot's sample that was looked at for that, shape (r,).
        may_stand: 1 for a joint of a finger, which may stand against what it grips,
            shape (n,).
        followed: Between which velocities each joint is if its drive has no more than
            each of the delays that are looked for, shape (n, 2 · DELAY_STEPS).
        delays: The greatest of them that each robot's drives have shown to have at
            least, shape (r,) [s].
        relief_until: Until when `relief` counts the way of what moves by itself, shape
            (r,) [s].
        agreement: Velocities of each joint beside its positions, see LATEST, shape
            (n, AGREEMENT).
        doubt: Reason why the last sighting of each of them was refused, 0 if it was
            not, shape (p,) or (0,).
        sighted_at: Stamp of its last believed sighting; -inf if there was none since
            the last reset, shape (p,) or (0,) [s].
        object_stale: Age from which on a sighting of it is refused, shape (p,) or (0,)
            [s].
        lagged: Samples in a row in which each robot's stop was slower than declared,
            shape (r,).
    """

    stamps: Vector
    given: Vector
    velocity: Vector
    last: Vector
    pace: Vector
    last_stamp: Vector
    sample_count: LongVector
    sample_t: Matrix
    sample_q: Matrix
    phase: LongVector
    ordered: Vector
    must: LongVector
    cause: LongVector
    fastest: Vector
    fastest_at: Vector
    rest_low: Vector
    rest_high: Vector
    rest_began: Vector
    rested: LongVector
    level: LongVector
    time_left: Vector
    disproved: LongVector
    model: Vector
    base: Vector
    top_speed: Vector
    seen_at: Vector
    robot_of: IntVector
    movers: IntVector
    pairs: IntMatrix
    pair_need: Vector
    look: Vector
    wanted: Vector
    sent: Matrix
    sent_at: Vector
    held: LongMatrix
    sent_count: LongVector
    commanded: Vector
    commanded_at: Vector
    under_way: Matrix
    driven_to: Matrix
    band: Matrix
    deficit: Vector
    relief: Vector
    relieved: LongVector
    tool_body: LongVector
    tool_point: Matrix
    row: Vector
    recover: LongVector
    evades: LongVector
    object_velocity: Matrix
    evaded: LongVector
    judged_pairs: LongMatrix
    judged_left: Vector
    judged_count: LongVector
    judged_ways: Matrix
    judged_clock: Matrix
    judged_settled: Vector
    grown: Vector
    yields: LongVector
    stuck: Matrix
    looked_at: Vector
    may_stand: LongVector
    followed: Matrix
    delays: Vector
    relief_until: Vector
    agreement: Matrix
    doubt: LongVector
    sighted_at: Vector
    object_stale: Vector
    lagged: LongVector


def watch_of(tables: SceneTables) -> Watch:
    """Arrays for the inputs of a scene; all robots are thought to be at rest."""
    robots, n, p = len(tables.robots), len(tables.q_names), len(tables.kinds)
    m = tables.moving_count
    speeds = tables.top_speeds
    pace = np.zeros(PACE)
    pace[[PERIOD, LATE, SLOW_TIME]] = tables.period, tables.late, SLOW_TIME_DEFAULT
    last = np.zeros(LAST)
    last[LAST_NOW] = -np.inf
    figures = [part.stopping for part in tables.robots]
    by_robot = np.array([0.0 if f is None else f.model_error for f in figures])
    rides = tables.robot_of_primitive
    model = np.where(rides >= 0, by_robot[rides], 0.0) if m else np.zeros(0)
    base = base_errors(tables)
    pairs = all_pairs(tables)
    tools = [tables.links[part.tool] for part in tables.robots]
    return Watch(
        stamps=np.zeros(robots),
        given=np.zeros(GIVEN),
        velocity=np.zeros(n),
        last=last,
        pace=pace,
        last_stamp=np.full(robots, -np.inf),
        sample_count=np.zeros(robots, dtype=np.int64),
        sample_t=np.zeros((robots, HISTORY)),
        sample_q=np.zeros((n, HISTORY)),
        phase=np.full(robots, RESTING, dtype=np.int64),
        ordered=np.zeros(robots),
        must=np.zeros(robots, dtype=np.int64),
        cause=np.zeros(robots, dtype=np.int64),
        fastest=np.zeros(n),
        fastest_at=np.zeros(robots),
        rest_low=np.zeros(n),
        rest_high=np.zeros(n),
        rest_began=np.zeros(robots),
        rested=np.zeros(robots, dtype=np.int64),
        level=np.zeros(robots, dtype=np.int64),
        time_left=np.zeros(robots),
        disproved=np.zeros(n, dtype=np.int64),
        model=model,
        base=base,
        top_speed=speeds,
        seen_at=np.full(len(speeds) and p, -np.inf),
        robot_of=tables.robot_of_primitive,
        movers=np.flatnonzero(speeds).astype(np.int32),
        pairs=pairs,
        pair_need=static_needs(pairs, model, base, tables),
        look=np.zeros(p),
        wanted=np.zeros(n),
        sent=np.zeros((commands := commands_under_way(tables), n)),
        sent_at=np.full(commands, -np.inf),
        held=np.zeros((commands, robots), dtype=np.int64),
        sent_count=np.zeros(1, dtype=np.int64),
        commanded=np.zeros(n),
        commanded_at=np.full(1, -np.inf),
        under_way=np.zeros((n, 2)),
        driven_to=np.zeros((n, 2)),
        band=np.zeros((n, 2)),
        deficit=np.zeros(robots),
        relief=np.zeros(robots),
        relieved=np.zeros(robots, dtype=np.int64),
        tool_body=np.array([frame.body for frame in tools], dtype=np.int64),
        tool_point=np.array([frame.T_body_link[:3, 3] for frame in tools]),
        row=np.zeros(n),
        recover=np.zeros(robots, dtype=np.int64),
        evades=np.zeros(robots, dtype=np.int64),
        object_velocity=np.zeros((len(speeds), 3)),
        evaded=np.zeros(len(speeds), dtype=np.int64),
        judged_pairs=np.zeros((JUDGED_ROOM, 3), dtype=np.int64),
        judged_left=np.zeros(JUDGED_ROOM),
        judged_count=np.zeros(1, dtype=np.int64),
        judged_ways=np.zeros((2 * PLANS * n, JUDGED_WAY)),
        judged_clock=np.zeros((PLANS * robots, CLOCK)),
        judged_settled=np.zeros(1),
        grown=np.zeros(m),
        yields=np.ones(robots, dtype=np.int64),
        stuck=np.zeros((n, STUCK_ROW)),
        looked_at=np.full(robots, -np.inf),
        may_stand=joints_of_fingers(tables),
        followed=np.tile([-np.inf, np.inf], (n, DELAY_STEPS)),
        delays=np.zeros(robots),
        relief_until=np.zeros(robots),
        agreement=no_agreement(n),
        doubt=np.zeros(len(speeds) and p, dtype=np.int64),
        sighted_at=np.full(len(speeds) and p, -np.inf),
        object_stale=ages_of_objects(len(speeds) and p, tables),
        lagged=np.zeros(robots, dtype=np.int64),
    )


def no_agreement(joints: int) -> Floats:
    """`Watch.agreement` before the first sample, shape (joints, AGREEMENT)."""
    found = np.zeros((joints, AGREEMENT))
    found[:, [LATEST, EARLIER]] = np.nan
    return found


def ages_of_objects(count: int, tables: SceneTables) -> Floats:
    """Age from which on a sighting of each primitive is refused, shape (count,) [s]."""
    found = np.full(count, np.inf)
    for thing in tables.standing.values():
        found[thing.first : thing.first + thing.count] = thing.stale
    return found


def joints_of_fingers(tables: SceneTables) -> Longs:
    """1 where a joint moves a gripper's finger, shape (n,)."""
    found = np.zeros(len(tables.q_names), dtype=np.int64)
    for part in tables.holds.grippers:
        for finger in part.fingers:
            j = int(tables.q_index[tables.links[finger].body])
            if j >= 0:
                found[j] = 1
    return found


def commands_under_way(tables: SceneTables) -> int:
    """Room for the commands that may not have taken effect when one was measured.

    For drives that lag as much as is looked for.
    """
    figures = [part.stopping for part in tables.robots if part.stopping is not None]
    most = DELAY_SHARE * DELAY_STEPS
    longest = max(
        (most * f.command + f.stale + f.sensing for f in figures), default=0.0
    )
    return int(np.ceil(longest / tables.period)) + SPARE_COMMANDS


def all_pairs(tables: SceneTables) -> NDArray[np.int32]:
    """Every checked pair in ascending order, where a scene has few primitives, (c, 2).

    What a robot moves comes first.

    Such a scene is not asked of the index: it takes less time to go through its pairs.
    """
    p, m = len(tables.kinds), tables.moving_count
    if p > FEW or tables.index.kind == "brute_force":
        return np.zeros((0, 2), dtype=np.int32)
    i, j = np.triu_indices(p, 1)
    wanted = (i < m) & (tables.checked[tables.groups[i], tables.groups[j]] != 0)
    pairs = np.stack([i[wanted], j[wanted]], axis=1).astype(np.int32)
    behind = tables.robot_of_primitive[pairs[:, 0]] < 0
    pairs[behind] = pairs[behind, ::-1]
    return pairs


def static_needs(
    pairs: NDArray[np.int32], model: Floats, base: Floats, tables: SceneTables
) -> Floats:
    """What each pair must keep whatever its robots do, shape (c,) [m].

    Its buffer and the errors of the model; those of a base only between what does not
    stand on it.
    """
    others = len(tables.kinds) - tables.moving_count
    model, base = np.pad(model, (0, others)), np.pad(base, (0, others))
    robot = np.pad(tables.robot_of_primitive, (0, others), constant_values=-1)
    i, j = pairs.T
    apart = np.where(robot[i] != robot[j], base[i] + base[j], 0.0)
    buffers = tables.buffers[tables.groups[i], tables.groups[j]]
    return np.asarray(buffers + model[i] + model[j] + apart)


def base_errors(tables: SceneTables) -> NDArray[np.float64]:
    """How far an error of its robot's base can move each moving primitive, (m,) [m].

    By the angle times the farthest its points get from the base.
    """
    errors = np.zeros(tables.moving_count)
    for i in range(tables.moving_count):
        r = int(tables.robot_of_primitive[i])
        if r >= 0:
            errors[i] = base_error(r, float(tables.base_reach[i]), tables)
    return errors


def base_error(robot: int, reach: float, tables: SceneTables) -> float:
    """How far an error of a robot's base moves what is so far from it at most [m]."""
    figures = tables.robots[robot].stopping
    if figures is None:
        return 0.0
    turn = 2.0 * np.sin(min(figures.base_turn, np.pi) / 2.0)
    return float(figures.base_error + turn * reach)
