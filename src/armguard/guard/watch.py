"""State of a guard: inputs, measurements, commands and the stops it has ordered."""

from typing import Annotated, NamedTuple

from armguard.guard.clusters import Cluster
from armguard.motion.state import StopClock
from armguard.record import Records, record
from armguard.table import (
    IntMatrix,
    IntVector,
    LongMatrix,
    LongVector,
    Matrix,
    Vector,
    table,
)

# An arm is slowed if a stop would have to be ordered within this time [s].
SLOW_TIME_DEFAULT = 0.1

# A slowed robot stays slow until its time left is this multiple of that time [-].
HYSTERESIS = 1.25


@record
class Given:
    """Input of a cycle.

    Attributes:
        now: Time of the cycle; NaN if it was not given [s].
        has_velocity: 1 if velocities were given with the positions.
        commanded: 1 if commands go through the guard.
        judged: 1 if the input could be judged.
    """

    now: float
    has_velocity: int
    commanded: int
    judged: int


@record
class LastCycle:
    """Times of the last cycle, and the reason for a stop in this one.

    Attributes:
        now: Time of the last cycle [s].
        forced: Reason why every robot must stop in this cycle, 0 for none.
        unannounced: Greatest delay of the last cycle after its time [s].
        ordered_at: Time of the orders of a refused cycle; infinite: unknown [s].
    """

    now: float
    forced: int
    unannounced: float
    ordered_at: float


@record
class Timing:
    """Declared times of the loop.

    Attributes:
        period: Time from one cycle to the next [s].
        late: Permitted delay of a cycle beyond that [s].
        slow_time: Time left below which an arm is slowed [s].
    """

    period: float
    late: float
    slow_time: float


@record
class Repeated:
    """Repeated position of a joint, by which a stuck sensor is detected.

    Attributes:
        position: The position [rad or m].
        time: Time for which the joint was commanded to move meanwhile [s].
        travel: Least travel commanded meanwhile [rad or m].
    """

    position: float
    time: float
    travel: float


@record
class Agreement:
    """Consistency of a joint's measured velocities with its positions.

    Attributes:
        latest: Measured velocity of the last accepted sample, NaN if it had none.
        earlier: Measured velocity of the sample before, NaN if it had none.
        ahead: Travel beyond what the velocities explain [rad or m].
        behind: Travel short of what the velocities explain [rad or m].
        ahead_next: `ahead`, if the sample of this cycle is accepted.
        behind_next: `behind`, if the sample of this cycle is accepted.
    """

    latest: float
    earlier: float
    ahead: float
    behind: float
    ahead_next: float
    behind_next: float


@record
class JudgedStop:
    """Planned stop of a joint in one direction, for which pairs were judged.

    Attributes:
        travel: Whole travel, swing included [rad or m].
        opposite_speed: Speed, if it moves in the opposite direction only [rad/s or
            m/s].
        settled: Time until it has settled [s].
        rest_travel: Travel at rest, without the swing [rad or m].
    """

    travel: float
    opposite_speed: float
    settled: float
    rest_travel: float


# Phases of a robot: plain numbers, since kernels store them in arrays of int64.
RESTING = 0  # at rest after a stop, or at the start: its operator waits
RUNNING = 1  # its operator moves it
STOPPING = 2  # a controlled stop was ordered
BRAKING = 3  # the brake was ordered, since the stop was slower than declared
LOST = 4  # the brake was slower than declared too
RECOVERING = 5  # it moves out of a pair that is too near

# Starts of a recovery, in `Watch.recover`.
LEAVES = 1
AT_REST = 2
AT_WORK = 3

# End of a recovery: a stop, as its operator releases the robot or leads it back.
GIVES_UP = 4

# Greatest count of primitives for which testing all pairs is faster than a search in
# the index.
FEW = 256

# Greatest count of pairs recorded in a cycle for a second proof by their headroom.
JUDGED_ROOM = 4096

# Tested delays of drives: multiples of this share of the declared delay of commands;
# the fourth is that delay itself [-].
DELAY_STEPS = 8
DELAY_SHARE = 0.25

# Samples stored of each joint, from which velocities are estimated.
HISTORY = 16


@table
class Watch(NamedTuple):
    """Inputs of a cycle, and state that is carried between cycles.

    Sizes: r robots, n joints, p primitives, the first m of which may move. Velocities
    of joints are in [rad/s or m/s], positions in [rad or m].

    Attributes:
        stamps: Stamp of each robot's measurement, shape (r,) [s].
        given: Input of the cycle.
        velocity: Measured joint velocities, if given, shape (n,).
        last: Times of the last cycle, and a reason to stop.
        timing: Declared times of the loop.
        last_stamp: Stamp of each robot's last sample, shape (r,) [s].
        sample_count: Count of samples in each robot's history, shape (r,).
        sample_t: Stamps of these samples, newest first, shape (r, HISTORY) [s].
        sample_q: Positions of these samples, newest first, shape (n, HISTORY).
        phase: Phase of each robot, see RESTING, shape (r,).
        ordered: Time of each robot's last order to stop or brake, shape (r,) [s].
        must: 1 where a robot must stop in this cycle, shape (r,).
        cause: Reason of each robot's last order, shape (r,).
        fastest: Greatest speed of each joint that its ordered stop permits, shape (n,).
        fastest_at: Stamp that `fastest` is valid for, shape (r,) [s].
        rest_low: Least position of each joint during an ordered stop, shape (n,).
        rest_high: Greatest position of each joint during that stop, shape (n,).
        rest_began: Start of each robot's present standstill, shape (r,) [s].
        rested: Consecutive cycles of each stopping robot at rest, shape (r,).
        level: Level of each robot in the last cycle, shape (r,).
        time_left: Least time left of each robot's pairs, shape (r,) [s].
        disproved: 1 where a joint exceeded a declared figure, shape (n,).
        static_error: Static errors of each moving primitive by kind, see
            `STATIC_ERRORS`, shape (kinds, m) [m].
        link_error: Sum of those that apply to every pair, shape (m,) [m].
        robot_error: Sum of those that apply between robots only, shape (m,) [m].
        top_speed: Greatest speed of each primitive without a robot, (p,) or (0,) [m/s].
        seen_at: Time of the last sighting of each primitive, less its position error at
            top speed; inf if absent, shape (p,) or (0,) [s].
        robot_of: Robot of each moving primitive, -1 if none, shape (m,).
        movers: Primitives whose top speed is not 0, shape (k,).
        pair_blocks: Every checked pair of a small scene: a primitive, the first of
            eight others, and a bit for each of these; in ascending order, (c, 3) [-].
        block_need: Static need of each of these pairs, without the travel of an object
            since it was seen, shape (c, 8) [m].
        look: Scratch for the search distance of each primitive, shape (p,) [m].
        ahead: Scratch for the part of it that covers new commands, shape (m,) [m].
        reserve: Scratch for that part and what the look-ahead adds, shape (m,) [m].
        tight: Scratch, 1 where it follows from twists and not from levers, (m,).
        swept: Scratch for the swept box of each moving primitive: where a stop may
            carry it, with half of the margin or more around it; of a small scene also
            that of the others, shape (6, k) [m].
        wanted: Desired velocities of this cycle, and then the sent ones, shape (n,).
        sent: Ring of sent commands, shape (c, n).
        sent_at: Time of each sent command, shape (c,) [s].
        held: 1 where a robot was at rest at a sent command, shape (c, r).
        sent_count: Count of all sent commands, shape (1,) [-].
        commanded: Last commanded velocities, shape (n,).
        commanded_at: Time of the last command, -inf if none, shape (1,) [s].
        under_way: Least and greatest pending command of each joint, shape (n, 2).
        driven_to: Least and greatest pending command of each joint, without commands
            to a robot at rest; inf and -inf if there is none, shape (n, 2).
        band: Least and greatest velocity of each joint by the measurement and the
            pending commands of the last cycle, shape (n, 2).
        deficit: Greatest deficit at rest of any pair of each robot, shape (r,) [m].
        relief: That deficit at the start of each robot's recovery, shape (r,) [m].
        relieved: 1 where a recovering robot still has such a pair, shape (r,).
        tool_body: Body of each robot's tool, shape (r,).
        tool_point: Origin of each tool in that body, shape (r, 3) [m].
        row: Scratch for a number per joint, shape (n,).
        recover: Start or end of a recovery: LEAVES for a robot at rest that has to
            leave a pair that is too near; AT_REST or AT_WORK for one that has to evade
            an approaching object, from rest or in motion; GIVES_UP; else 0, shape (r,).
        evades: 1 where a robot evades an approaching object, shape (r,).
        object_velocity: Velocity of each primitive in its last sighting, shape (p, 3)
            or (0, 3) [m/s].
        clusters: Clusters of sensed cells that move, shape (c,); one without velocity
            is none.
        cluster_evaded: Bit set of the robots that evade each cluster, shape (c,).
        evaded: Bit set of the robots that evade each primitive, shape (p,) or (0,).
        judged_pairs: Pairs judged in this cycle: two primitives, and the pair's row in
            the answer or -1, shape (k, 3).
        judged_left: Headroom of each of these pairs; -inf if it cannot be re-used,
            shape (k,) [m].
        judged_count: Count of these pairs; -1 if there were too many, shape (1,).
        judged_stops: Stop of each joint that they were judged for, in its positive and
            its negative direction, shape (2 · PLANS · n,).
        judged_clock: Clocks of these stops, shape (PLANS · r,).
        judged_settled: Time from now until these stops have settled, shape (1,) [s].
        grown: Additional travel of each primitive since then, shape (m,) [m].
        yields: 1 where a robot may be slowed before it is stopped, shape (r,).
        stuck: Repeated position of each joint and its commands meanwhile, shape (n,).
        looked_at: Stamp of each robot's last test for stuck sensors, shape (r,) [s].
        may_stand: 1 for a joint of a finger, which an object may block, shape (n,).
        followed: Least and greatest velocity of each joint if its drive has at most
            each tested delay, shape (n, 2 · DELAY_STEPS).
        delays: Observed lower bound of the delay of each robot's drives, (r,) [s].
        relief_until: Time until which `relief` includes the travel of a moving object,
            shape (r,) [s].
        agreement: Consistency of each joint's velocities and positions, shape (n,).
        doubt: Reason why the last sighting of each primitive was refused, 0 if it was
            accepted, shape (p,) or (0,).
        sighted_at: Stamp of the last accepted sighting of each primitive; -inf if
            there was none since the last reset, shape (p,) or (0,) [s].
        object_stale: Age beyond which a sighting of each primitive is refused, shape
            (p,) or (0,) [s].
        lagged: Consecutive samples in which each robot's stop was slower than
            declared, shape (r,).
    """

    stamps: Vector
    given: Given
    velocity: Vector
    last: LastCycle
    timing: Timing
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
    static_error: Matrix
    link_error: Vector
    robot_error: Vector
    top_speed: Vector
    seen_at: Vector
    robot_of: IntVector
    movers: IntVector
    pair_blocks: IntMatrix
    block_need: Matrix
    look: Vector
    ahead: Vector
    reserve: Vector
    tight: LongVector
    swept: Matrix
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
    clusters: Annotated[Records[Cluster], 1]
    cluster_evaded: LongVector
    evaded: LongVector
    judged_pairs: LongMatrix
    judged_left: Vector
    judged_count: LongVector
    judged_stops: Annotated[Records[JudgedStop], 1]
    judged_clock: Annotated[Records[StopClock], 1]
    judged_settled: Vector
    grown: Vector
    yields: LongVector
    stuck: Annotated[Records[Repeated], 1]
    looked_at: Vector
    may_stand: LongVector
    followed: Matrix
    delays: Vector
    relief_until: Vector
    agreement: Annotated[Records[Agreement], 1]
    doubt: LongVector
    sighted_at: Vector
    object_stale: Vector
    lagged: LongVector
