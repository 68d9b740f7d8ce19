"""Everything the prediction of a stop reads and writes."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.motion.figures import JointFigures, RobotFigures
from armguard.motion.joint_stop import JointStop
from armguard.record import Records
from armguard.table import IntMatrix, IntVector, LongVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]

# The stop path is divided into halves, halves of halves and so on; a node is one of
# these spans of time, 1 the whole, 2n and 2n + 1 the halves of n.
NODE_LEVELS = 7
NODES = 1 << NODE_LEVELS

# A stop is planned twice for each robot: as if it went on until the next cycle and were
# told to stop then, and as if it were told now.
NEXT = 0
NOW = 1
PLANS = 2

# Beside the plans: how far joints may get whatever their operators do, at GRID times.
FREE = PLANS
GRID = 16

# Places in `Motion.clock`, a row for each plan and robot.
AGE = 0  # time since the measurement [s]
REACTION = 1  # from the measurement until a stop takes effect at the latest [s]
PASSED = 2  # since a stop surely took effect [s]
BRAKING = 3  # 1 where the brake is the stop
STILL = 4  # 1 where the robot's own motion is left out: its buffer is fixed
SWINGS = 5  # 1 where a stop under way may still end in a swing
CLOCK = 6

# Places in `Motion.span`.
HORIZON = 0  # from now until everything rests [s]
SEGMENT = 1  # 1 where the path is a straight line of joint positions, not a stop
SETTLED = 2  # from now until everything has settled as well [s]
SPAN = 3

# Places in a row of `Motion.swings`.
OF_STOP = 0  # what a stop under way may swing about its rest
LOWEST = 1  # least position it may lead to, as measured without an error
HIGHEST = 2  # greatest
SWINGS_WIDTH = 3

# Places in `Motion.effort`.
TESTS = 0  # spans of time tested for pairs in this cycle
BUDGET = 1  # how many may be
STAMP = 2  # of the nodes that were made for this cycle
LOOKED = 3  # 1 where more than its own primitives were asked about a pair
EFFORT = 4

# Boxes of joint positions that wait while one is divided; and the one that is a whole
# span.
BOX_LEVELS = 24
WHOLE = BOX_LEVELS

# Numbers kept of each joint while a pair's gap is bounded, and one for each joint.
LEVER_ROW = 21


@table
class Motion(NamedTuple):
    """Chains, figures and measured state; from them the spans of the stop path.

    Bodies and joints are those of `SceneTables`; a body moves by the joint above it.

    Attributes:
        parent: See `SceneTables`, from here to `axis`.
        joint_kind: Joint kinds.
        q_index: Places in q.
        gain: Multipliers and offsets.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        joints: See `Chains`, from here to `levers`.
        length: Lengths of the chains.
        shared: Shared joints.
        levers: Levers of the moving primitives.
        exact_levers: Levers of the exact shapes, shape (e, depth) [m].
        joint_figures: Declared figures of each joint, shape (n,).
        robot_figures: Declared figures of each robot, shape (r,).
        curves: Measured stops, shape (n, 2 · CURVE_POINTS).
        robot_of_joint: Robot of each place of q, shape (n,).
        q: Measured positions, shape (n,).
        v_low: Least velocity a joint may have, shape (n,).
        v_high: Greatest, shape (n,).
        driven: Greatest velocity its operator may drive each joint to until a stop
            takes effect: in its positive direction, and in its negative one; each of
            either sign, shape (PLANS · n, 2).
        clock: Delays of each plan and robot, shape (PLANS · r, CLOCK).
        span: See HORIZON, shape (SPAN,).
        effort: See TESTS, shape (EFFORT,).
        up: Stop of each joint in its positive direction, shape (PLANS · n,).
        down: In its negative direction, shape (PLANS · n,).
        middle: Middle displacement of each body's joint on the path of a plan, or
            within a time of the grid, see `free_way`, shape (PLANS + GRID, b).
        width: How far it may be off that, shape (PLANS + GRID, b).
        spread: The sum of their sizes, shape (PLANS + GRID, b).
        grid_stamp: Cycle a time of the grid was bounded in, shape (GRID,).
        axes: Direction and origin of each joint's axis in the world, shape (b, 6).
        reach: Bound on the way of each primitive's points, shape (PLANS, m) [m].
        speed: Bound on each body's joint speed as measured, shape (b,).
        rate: Bound on the speed of a primitive's points as measured, (m,) [m/s].
        blur: How far errors of joint positions may move each, shape (m,) [m].
        push: Bound on what operators can add to that, shape (m,) [m/s²].
        node_stamp: Cycle a node was made in, shape (PLANS · NODES,).
        node_q: Joint positions in the middle of the node, shape (PLANS · NODES, n).
        node_T: Poses in the middle of the node, shape (PLANS · NODES · b, 12).
        node_axes: Axes there, shape (PLANS · NODES · b, 6).
        node_way: Half of each joint's way on a straight line, (PLANS · NODES, b).
        node_wide: How far it may be off that line, shape (PLANS · NODES, b).
        node_grow: How much more at the end of the line, shape (PLANS · NODES, b).
        q_half: Half of a straight line of joint positions about `q`, shape (n,).
        q_node: Scratch for positions, shape (n,).
        q_way: Scratch for half ways, shape (n,).
        q_wide: Scratch for widths, shape (n,).
        q_grow: Scratch for how these grow, shape (n,).
        box_line: Which part of a span's line a box has: middle and half of it in
            [-1, 1], shape (BOX_LEVELS + 1, 2).
        box_place: Middle of the part of each joint's range a box has, in [-1, 1],
            shape (BOX_LEVELS + 1, b).
        box_part: Half of that part, shape (BOX_LEVELS + 1, b).
        box_axes: Scratch for axes, shape (b, 6).
        sizes: Scratch for the greatest move of each body's joint, shape (b,).
        corner_T: Scratch for poses at a corner of a span, shape (b, 12).
        columns: Scratch for how joints move a pair, see `nearest`, (2 · depth, COLUMN).
        lever_rows: Scratch for one side, shape (depth, LEVER_ROW + depth).
        swings: What a stop under way may swing, and where it may lead each joint; see
            OF_STOP, shape (n, SWINGS_WIDTH) [rad].
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
    clock: Matrix
    span: Vector
    effort: LongVector
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
    box_line: Matrix
    box_place: Matrix
    box_part: Matrix
    box_axes: Matrix
    sizes: Vector
    corner_T: Matrix
    columns: Matrix
    lever_rows: Matrix
    swings: Matrix
