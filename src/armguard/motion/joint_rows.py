"""Derivatives of a point's position along a direction by the joints of its chain."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, cross, dot, sub
from armguard.kernel import kernel
from armguard.record import Records, record
from armguard.robot.kinematics import PRISMATIC
from armguard.table import Matrix

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Reach at both ends of a line, or one value twice [m].
Ends = tuple[float, float]

# Greatest round-off of a unit normal's coordinate: a micrometre per 10⁹ m [-].
TURNED = 1e-15


@record
class JointRow:
    """Gradient of `n·p` by a joint of a chain, and the range of the joint's Δ.

    The gradient at p is `slope·p + level`, and Δ is `middle ± width`. In an interval
    all joints are at the same place u in [-1, 1] of their lines. Both ends of these are
    tested: from the middle to an end Δ changes by `half_line`, the width by `widening`.

    Attributes:
        slope: n x axis; 0 for a prismatic joint, shape (3,) [-].
        level: Gradient at the origin [m/rad or -].
        axis: Direction of its axis in the world, shape (3,) [-].
        origin: A point of its axis in the world, shape (3,) [m].
        revolute: 1 for a revolute joint, 0 for a prismatic one.
        middle: Middle of Δ [rad or m].
        width: Greatest deviation from that [rad or m].
        half_line: Half of the joint's line, signed [rad or m].
        widening: Change of the width from the middle of the line to its end.
        gradient: Gradient at the vertex that is tested.
        gradient_change: Change of it from the middle of the line to its end.
        end_gradient: Gradient at the joints' place on their line.
        end_width: Width at that place; 0 once the end of the range with the greatest
            value is known.
        undecided: 1 until that end is known.
    """

    slope: Annotated[Floats, (3,)]
    level: float
    axis: Annotated[Floats, (3,)]
    origin: Annotated[Floats, (3,)]
    revolute: int
    middle: float
    width: float
    half_line: float
    widening: float
    gradient: float
    gradient_change: float
    end_gradient: float
    end_width: float
    undecided: int


class SideMotion(NamedTuple):
    """Joints that move one side of a pair, their ranges, and a direction.

    Attributes:
        n: Unit direction.
        line: Whether the joints are on a line.
        most: Displacement bound of the side's points, by levers [m].
        first: First joint of the chain that counts.
        end: Length of the chain; at most `first` for a static side.
        rows: Derivatives and ranges, shape (depth,).
        hessian: Second derivatives of `n·p`, shape (depth, depth).
    """

    n: Vec3
    line: bool
    most: float
    first: int
    end: int
    rows: Records[JointRow]
    hessian: Matrix


@kernel
def joint_rows(
    n: Vec3,
    chain: Ints,
    first: int,
    count: int,
    axes: Floats,
    origin: int,
    joint_kind: Ints,
    rows: Records[JointRow],
) -> None:
    """Write the gradient of `n·p` by each joint of a chain, without the ranges of Δ.

    Args:
        n: Unit direction.
        chain: Bodies of the chain, shape (depth,).
        first: First joint of the chain that counts.
        count: Length of the chain.
        axes: Axes in the world, shape (k, 6).
        origin: Row of body 0 in `axes`.
        joint_kind: Joint kinds, shape (b,).
        rows: Overwritten except for the Δ, shape (depth,).
    """
    for k in range(first, count):
        b = chain[k]
        row, axis = rows[k], axes[origin + b]
        direction = (axis[0], axis[1], axis[2])
        slope, row.level, row.revolute = (0.0, 0.0, 0.0), dot(n, direction), 0
        if joint_kind[b] != PRISMATIC:
            slope = cross(n, direction)
            row.level = -dot(slope, (axis[3], axis[4], axis[5]))
            row.revolute = 1
        for x in range(3):
            row.axis[x], row.origin[x] = axis[x], axis[x + 3]
        row.slope[0], row.slope[1], row.slope[2] = slope


@kernel
def joint_ranges(
    chain: Ints,
    first: int,
    count: int,
    middle: Floats,
    width: Floats,
    rows: Records[JointRow],
) -> None:
    """Write an independent range of Δ for each joint of a chain.

    Args:
        chain: Bodies of the chain, shape (depth,).
        first: First joint of the chain that counts.
        count: Length of the chain.
        middle: Middle of the Δ of each body's joint, shape (b,).
        width: Greatest deviation from that middle, shape (b,).
        rows: Rows of `joint_rows`.
    """
    for k in range(first, count):
        row, b = rows[k], chain[k]
        row.middle, row.width = middle[b], width[b]


@kernel
def point_reach(still: float, p: Vec3, s: SideMotion) -> Ends:
    """Greatest `n·p` of a vertex to second order, at both ends of a line [m].

    Args:
        still: `n·p` of the vertex at rest; 0 for the growth alone [m].
        p: Vertex of the core, in the world [m].
        s: The joints that move it.
    """
    differentiate(p, s)
    if s.line:
        return line_ends(still, s)
    way = bend = 0.0
    for k in range(s.first, s.end):
        own, second = s.rows[k], s.hessian[k]
        turned = 0.0
        for j in range(s.first, s.end):
            turned += second[j] * s.rows[j].middle
        way += own.gradient * own.middle
        bend += 0.5 * own.middle * turned
        own.end_gradient, own.end_width = own.gradient + turned, own.width
    reach = still + way + bend + widest(s)
    return (reach, reach)


@kernel
def line_ends(still: float, s: SideMotion) -> Ends:
    """Greatest `n·p` at each end of the joints' line, valid also in between [m]."""
    way = bend = grown = 0.0
    for k in range(s.first, s.end):
        own, second = s.rows[k], s.hessian[k]
        curved = mixed = 0.0
        for j in range(s.first, s.end):
            curved += second[j] * s.rows[j].half_line
            mixed += abs(second[j]) * abs(s.rows[j].widening)
        way += own.gradient * own.half_line
        bend += 0.5 * own.half_line * curved
        grown += (abs(own.half_line) + 0.5 * abs(own.widening)) * mixed
        own.gradient_change = curved
    # Between the ends of a line the value exceeds both by at most its curvature.
    reach = still + bend + max(-bend, 0.0) + grown
    return (reach - way + line_end(-1.0, s), reach + way + line_end(1.0, s))


@kernel
def line_end(sign: float, s: SideMotion) -> float:
    """Greatest addition by the ranges of the joints at one end of their line [m]."""
    for k in range(s.first, s.end):
        own = s.rows[k]
        own.end_gradient = own.gradient + sign * own.gradient_change
        own.end_width = own.width + sign * own.widening
    return widest(s)


@kernel
def differentiate(p: Vec3, s: SideMotion) -> None:
    """Write the first and second derivatives of n·p by the joints."""
    for k in range(s.first, s.end):
        own = s.rows[k]
        own.gradient = dot((own.slope[0], own.slope[1], own.slope[2]), p) + own.level
        move = (own.axis[0], own.axis[1], own.axis[2])
        if own.revolute:
            origin = (own.origin[0], own.origin[1], own.origin[2])
            move = cross(move, sub(p, origin))
        for j in range(s.first, k + 1):
            slope = s.rows[j].slope
            h = dot((slope[0], slope[1], slope[2]), move)
            s.hessian[k, j] = s.hessian[j, k] = h


@kernel
def widest(s: SideMotion) -> float:
    """Upper bound of `Σ g Δ + ½ Σ Σ h Δ Δ` for Δ within plus and minus the widths.

    If g exceeds every change that h can make to it, the greatest value is at that end
    of the joint's range for any values of the others, whose g is then updated. For the
    remaining joints each term takes its greatest size.
    """
    total = 0.0
    for k in range(s.first, s.end):
        s.rows[k].undecided = 1
    for _ in range(2):
        for k in range(s.first, s.end):
            own, second = s.rows[k], s.hessian[k]
            if not own.undecided:
                continue
            g = own.end_gradient
            if not abs(g) >= doubt(second, s):
                continue
            move = own.end_width if g >= 0.0 else -own.end_width
            own.undecided, own.end_width = 0, 0.0
            total += g * move + 0.5 * second[k] * move * move
            for j in range(s.first, s.end):
                s.rows[j].end_gradient += second[j] * move
    for k in range(s.first, s.end):
        own = s.rows[k]
        if own.undecided:
            change = doubt(s.hessian[k], s)
            total += own.end_width * (abs(own.end_gradient) + 0.5 * change)
    return total


@kernel
def doubt(second: Floats, s: SideMotion) -> float:
    """Greatest change of a joint's gradient by the joints that are undecided."""
    total = 0.0
    for j in range(s.first, s.end):
        total += abs(second[j]) * s.rows[j].end_width
    return total
