"""Layout of the array that holds the answer of a cycle, for kernels and verdicts.

The answer of a cycle is one array of float64, so that a verdict is one copy: a header,
then a row for each robot and the escape direction in joint space, a unit vector for
each robot, n numbers; then a row for each near pair. Robots have rows if one of them
has a mode other than "fixed". Recordings hold these bytes, so whole numbers are float64
too; they are exact up to 2⁵³.
"""

from dataclasses import fields
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3
from armguard.guard.budget import Budget
from armguard.kernel import kernel
from armguard.record import dtype_of, indices, record

Floats = NDArray[np.float64]

# Version of this layout, which recordings carry. Any change of a field below raises it:
# a recording of another layout is refused and not misread.
LAYOUT = 2

TERM_NAMES = tuple(field.name for field in fields(Budget))


@record
class Header:
    """Header of an answer.

    Attributes:
        reason: Reason as a number.
        joint: Index in q of the joint of a fault, -1 if none.
        value: Position of that joint [rad or m].
        near_count: Count of near pairs that follow.
        nearest: Which near pair has the least headroom, -1 if none.
        pairs_tested: Exact distances computed in this cycle.
        pairs_kept: Near pairs whose row was copied because neither side moved.
        pairs_filtered: Pairs sharing a leaf whose bounding boxes are beyond the margin.
        bodies_moved: Bodies whose pose differs from the last cycle's.
        links_checked: Moved bodies with primitives: each checks the index once.
        changed_leaf: Moved bodies that entered or left a leaf.
        leaves_entered: Leaves entered by primitives.
        leaves_left: Leaves left by primitives.
        splits: Leaves split.
        merges: Nodes merged.
        pairs_refined: Pairs of links whose exact shapes were measured.
        pairs_apart: Pairs that a stored plane proves to be beyond the margin.
        robot: Index of the robot of a fault, -1 if none.
        least_time_left: Least time until a stop must be ordered, up to the look-ahead
            [s].
        spans_tested: Spans of time that were tested to prove pairs.
        terms: Required separation of the nearest pair, the fields of `Budget` [m].
    """

    reason: float
    joint: float
    value: float
    near_count: float
    nearest: float
    pairs_tested: float
    pairs_kept: float
    pairs_filtered: float
    bodies_moved: float
    links_checked: float
    changed_leaf: float
    leaves_entered: float
    leaves_left: float
    splits: float
    merges: float
    pairs_refined: float
    pairs_apart: float
    robot: float
    least_time_left: float
    spans_tested: float
    terms: Annotated[Floats, (len(TERM_NAMES),)]


@record
class RobotRow:
    """Row of a robot.

    Attributes:
        level: Its level.
        phase: Its phase, see `RESTING`.
        scale: Speed scale in [0, 1].
        age: Age of its measurement [s].
        cause: Reason of its last order to stop.
        urgency: Urgency of its cues, in [0, 1].
        time: Least time to contact of its near pairs [s].
        force: Force on its tool, away from near bodies [N].
        torque: Torque of that force about the tool's origin [N m].
        tool: Motion of its tool in the escape direction [m/rad].
        delay: Least delay that explains how its drives follow commands [s].
    """

    level: float
    phase: float
    scale: float
    age: float
    cause: float
    urgency: float
    time: float
    force: Annotated[Floats, (3,)]
    torque: Annotated[Floats, (3,)]
    tool: Annotated[Floats, (3,)]
    delay: float


@record
class NearRow:
    """Row of a near pair.

    Attributes:
        first: Primitive index of A.
        second: Primitive index of B.
        headroom: Distance minus required separation [m].
        buffer: Distance to keep at all times [m].
        outer: Signed distance of the two primitives [m].
        exact: Signed distance of the exact shapes [m]; infinite where not measured.
        time_left: Time the present motion may continue before a stop is ordered [s].
        time_to_contact: Lower bound of the time to contact, for any operator input [s].
        proof: Result of the proof of its stop, see `pair_state`.
        envelope: Reported distance minus that of the judged shapes, >= 0 [m].
        distance: Signed distance that is reported [m]; the witness row begins here.
        point_a: Witness point on A, world [m].
        point_b: Witness point on B, world [m].
        normal: Unit vector from A to B, world [-].
    """

    first: float
    second: float
    headroom: float
    buffer: float
    outer: float
    exact: float
    time_left: float
    time_to_contact: float
    proof: float
    envelope: float
    distance: float
    point_a: Annotated[Floats, (3,)]
    point_b: Annotated[Floats, (3,)]
    normal: Annotated[Floats, (3,)]


# Rows as arrays of float64: their widths, and the first index of each field.
HEADER, ROBOT_WIDTH, NEAR_WIDTH = (
    dtype_of(row).itemsize // 8 for row in (Header, RobotRow, NearRow)
)
IN_HEADER, IN_ROBOT, IN_NEAR = map(indices, (Header, RobotRow, NearRow))


@kernel
def normal_of(near: NearRow) -> Vec3:
    """Unit vector from A to B of a near pair."""
    return (near.normal[0], near.normal[1], near.normal[2])


@kernel
def point_of(near: NearRow, side: int) -> Vec3:
    """Witness point of a near pair on A, side 0, or B, side 1 [m]."""
    point = near.point_a if side == 0 else near.point_b
    return (point[0], point[1], point[2])


@kernel
def put_witness(witness: Floats, near: NearRow) -> None:
    """Write a witness row into the row of a near pair."""
    near.distance = witness[0]
    for k in range(3):
        near.point_a[k], near.point_b[k] = witness[1 + k], witness[4 + k]
        near.normal[k] = witness[7 + k]
