"""State of the stop prediction: all arrays that it reads and writes."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.motion.figures import JointFigures, RobotFigures
from armguard.motion.joint_rows import JointRow
from armguard.motion.joint_stop import JointStop
from armguard.record import Records, record
from armguard.table import IntMatrix, IntVector, LongVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]

# The stop path is bisected in time. A node is an interval of the bisection: 1 is the
# whole path, 2n and 2n + 1 are the halves of n.
NODE_LEVELS = 7
NODES = 1 << NODE_LEVELS

# Two stops are planned for each robot: one ordered in the next cycle, one ordered now.
NEXT = 0
NOW = 1
PLANS = 2

# Rows after the plans: displacements under any commands, at GRID times.
FREE = PLANS
GRID = 16

# Greatest number of boxes of joint positions that wait while one is divided, and place
# of the box that is a whole interval.
BOX_LEVELS = 24
WHOLE = BOX_LEVELS


@record
class StopClock:
    """Delays of a robot's stop by a plan.

    Attributes:
        age: Time since the measurement [s].
        reaction: From the measurement until the stop takes effect at the latest [s].
        passed: Time since the stop surely took effect [s].
        braking: 1 if the robot stops by its brake.
        still: 1 if the robot's own motion is left out: its buffer is fixed.
        swings: 1 if a stop in progress may still end in a swing.
    """

    age: float
    reaction: float
    passed: float
    braking: int
    still: int
    swings: int


@record
class PathSpan:
    """Ends of the stop path.

    Attributes:
        horizon: Time from now until all robots rest [s].
        settled: Time from now until all swings have ended as well [s].
        segment: 1 if the path is a straight line in joint space, not a stop.
    """

    horizon: float
    settled: float
    segment: int


@record
class JointSwing:
    """Swing of a joint's stop in progress, and positions that the stop may reach.

    Attributes:
        swing: Swing about its rest position [rad or m].
        lowest: Least position, as measured without error [rad or m].
        highest: Greatest position, as measured without error [rad or m].
    """

    swing: float
    lowest: float
    highest: float


@record
class Effort:
    """Work of a cycle on proofs.

    Attributes:
        tests: Intervals tested for pairs in this cycle.
        budget: Greatest number of intervals in a cycle.
        stamp: Stamp of the nodes of this cycle.
        beyond_primitives: 1 if a pair's result rests on exact shapes, a relief or a
            contract.
        at_middle: 1 if `Motion.middle_balls` are those of this cycle.
    """

    tests: int
    budget: int
    stamp: int
    beyond_primitives: int
    at_middle: int


@record
class Ball:
    """Ball round a primitive.

    Attributes:
        centre: Centre, shape (3,) [m].
        radius: Radius [m].
    """

    centre: Annotated[Floats, (3,)]
    radius: float


@record
class LinePart:
    """Part of an interval's line, which is [-1, 1].

    Attributes:
        middle: Its middle [-].
        half: Half of its length [-].
    """

    middle: float
    half: float


@record
class JointColumn:
    """A joint's column of the Jacobian of a pair, and its position in a box.

    Attributes:
        derivative: Derivative of the witness points' difference, shape (3,) [m/rad].
        half_line: See `Motion.node_way` [rad or m].
        width: See `Motion.node_wide` [rad or m].
        growth: See `Motion.node_grow` [rad or m].
        place: Part of its deviation, in [-1, 1] [-].
        least: Least such part in the box [-].
        most: Greatest such part in the box [-].
    """

    derivative: Annotated[Floats, (3,)]
    half_line: float
    width: float
    growth: float
    place: float
    least: float
    most: float


@table
class Motion(NamedTuple):
    """Chains, figures, measured state and the intervals of the stop path.

    Bodies and joints are those of `SceneTables`; a body moves by the joint above it.

    Attributes:
        parent: See `SceneTables`, from here to `axis`.
        joint_kind: Kinds of the joints.
        q_index: Places of the joints in q.
        gain: Multipliers and offsets of the joints.
        T_parent_joint: Frames of the joints in their parents.
        axis: Axes of the joints.
        joints: See `Chains`, from here to `levers`.
        length: Lengths of the chains.
        shared: Shared joints.
        levers: Levers of the moving primitives.
        exact_levers: Levers of the exact shapes, shape (e, depth) [m].
        joint_figures: Declared stopping figures of each joint, shape (n,).
        robot_figures: Declared stopping figures of each robot, shape (r,).
        curves: Measured stops, shape (n, 2 · CURVE_POINTS).
        robot_of_joint: Robot of each joint, shape (n,).
        q: Measured joint positions, shape (n,) [rad or m].
        v_low: Lower bound of each joint's velocity now, shape (n,) [rad/s or m/s].
        v_high: Upper bound of each joint's velocity now, shape (n,) [rad/s or m/s].
        driven: Greatest velocity in the positive and in the negative direction that
            each joint may be commanded until a stop takes effect, each of either sign,
            shape (PLANS · n, 2) [rad/s or m/s].
        clock: Delays of each plan and robot, shape (PLANS · r,).
        span: Ends of the stop path.
        effort: Work of this cycle.
        up: Stop of each joint in its positive direction, shape (PLANS · n,).
        down: Stop of each joint in its negative direction, shape (PLANS · n,).
        middle: Middle of the displacements of each body's joint on the path of a plan,
            or until a time of the grid, see `free_way`, shape (PLANS + GRID, b).
        width: Greatest deviation from that middle, shape (PLANS + GRID, b).
        spread: Greatest size of the displacement, shape (PLANS + GRID, b).
        grid_stamp: Cycle in which a time of the grid was bounded, shape (GRID,).
        axes: Direction and origin of each joint's axis in the world, shape (b, 6).
        reach: Displacement bound of each primitive, shape (PLANS, m) [m].
        speed: Bound on the measured speed of each body's joint, shape (b,).
        rate: Bound on the measured speed of each primitive's points, (m,) [m/s].
        blur: Displacement bound of each primitive for position errors, shape (m,) [m].
        push: Bound on the acceleration of each primitive's points, shape (m,) [m/s²].
        balls: Ball round each primitive as measured, shape (m,).
        twists: Twist of each body, rotation then motion of the world's origin, for the
            middles of the joints' ranges; see `twist_bound`, shape (2 · b, 6).
        loose: What may add to a primitive's motion by these twists, shape (2, m)
            [m or m/s].
        middle_T: Poses at the middles of the joints' ranges of the plan NEXT, (b, 12).
        middle_axes: Axes there, see `axes`, shape (b, 6).
        middle_balls: Centres of the balls there, shape (m, 3) [m].
        node_stamp: Cycle in which a node was computed, shape (PLANS · NODES,).
        node_q: Joint positions in the middle of a node, shape (PLANS · NODES, n).
        node_T: Poses in the middle of a node, shape (PLANS · NODES · b, 12).
        node_axes: Axes in the middle of a node, shape (PLANS · NODES · b, 6).
        node_way: Half of each joint's motion on a straight line, (PLANS · NODES, b).
        node_wide: Greatest deviation from that line, shape (PLANS · NODES, b).
        node_grow: Growth of it from middle to end of the line, (PLANS · NODES, b).
        q_half: Half of a straight line in joint space about `q`, shape (n,).
        q_node: Scratch for joint positions, shape (n,).
        q_way: Scratch for halves of lines, shape (n,).
        q_wide: Scratch for deviations, shape (n,).
        q_grow: Scratch for growths of deviations, shape (n,).
        box_line: Part of an interval's line in a box, shape (BOX_LEVELS + 1,).
        box_place: Middle of the part of each joint's deviation in a box, in [-1, 1],
            shape (BOX_LEVELS + 1, b).
        box_part: Half of the length of that part, shape (BOX_LEVELS + 1, b).
        box_axes: Scratch for axes in the middle of a box, shape (b, 6).
        sizes: Scratch for the greatest displacement of each body's joint, shape (b,).
        corner_T: Scratch for poses in a box, shape (b, 12).
        columns: Scratch for Jacobians of a pair, shape (2 · depth,).
        lever_rows: Scratch for gradients, see `joint_rows`, one row for each joint of a
            chain, shape (depth,).
        hessian: Scratch for second derivatives by these joints at eight points, shape
            (depth, 8 · depth).
        swings: Swing of a stop in progress, of each joint, shape (n,).
    """

    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    T_parent_joint: Matrix
    axis: Matrix
    joints: IntMatrix
    length: IntVector
    shared: IntMatrix
    levers: Matrix
    exact_levers: Matrix
    joint_figures: Annotated[Records[JointFigures], 1]
    robot_figures: Annotated[Records[RobotFigures], 1]
    curves: Matrix
    robot_of_joint: IntVector
    q: Vector
    v_low: Vector
    v_high: Vector
    driven: Matrix
    clock: Annotated[Records[StopClock], 1]
    span: PathSpan
    effort: Effort
    up: Annotated[Records[JointStop], 1]
    down: Annotated[Records[JointStop], 1]
    middle: Matrix
    width: Matrix
    spread: Matrix
    grid_stamp: LongVector
    axes: Matrix
    reach: Matrix
    speed: Vector
    rate: Vector
    blur: Vector
    push: Vector
    balls: Annotated[Records[Ball], 1]
    twists: Matrix
    loose: Matrix
    middle_T: Matrix
    middle_axes: Matrix
    middle_balls: Matrix
    node_stamp: LongVector
    node_q: Matrix
    node_T: Matrix
    node_axes: Matrix
    node_way: Matrix
    node_wide: Matrix
    node_grow: Matrix
    q_half: Vector
    q_node: Vector
    q_way: Vector
    q_wide: Vector
    q_grow: Vector
    box_line: Annotated[Records[LinePart], 1]
    box_place: Matrix
    box_part: Matrix
    box_axes: Matrix
    sizes: Vector
    corner_T: Matrix
    columns: Annotated[Records[JointColumn], 1]
    lever_rows: Annotated[Records[JointRow], 1]
    hessian: Matrix
    swings: Annotated[Records[JointSwing], 1]
