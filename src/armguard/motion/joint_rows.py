"""Derivatives of positions along a direction by the joints of a chain.

Points are bounded eight at a time, one in each lane: the corners of a box, or the ends
of a capsule and six places that are not read.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, cross, dot, sub
from armguard.kernel import kernel
from armguard.lanes import (
    WIDTH,
    bits,
    either,
    load,
    most,
    size,
    some,
    splat,
    store,
)
from armguard.record import Records, record
from armguard.robot.kinematics import PRISMATIC
from armguard.table import Matrix

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# A bit for each of eight points.
EIGHT = (1 << WIDTH) - 1

# Reach at both ends of a line, or one value twice [m].
Ends = tuple[float, float]

# A number for each of eight points.
Eight = Annotated[Floats, (WIDTH,)]

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
        gradient: Gradient at each of eight points, shape (8,).
        gradient_change: Change of it from the middle of the line to its end.
        end_gradient: Gradient at the joints' place on their line.
        end_width: Width at that place; 0 once the end of the range with the greatest
            value is known.
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
    gradient: Eight
    gradient_change: Eight
    end_gradient: Eight
    end_width: Eight


class SideMotion(NamedTuple):
    """Joints that move one side of a pair, their ranges, and a direction.

    Attributes:
        n: Unit direction.
        line: Whether the joints are on a line.
        most: Displacement bound of the side's points, by levers [m].
        first: First joint of the chain that counts.
        end: Length of the chain; at most `first` for a static side.
        rows: Derivatives and ranges, shape (depth,).
        hessian: Second derivatives of `n·p` at eight points, shape (depth, 8 · depth).
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


@kernel(inline=False)
def points_reach(grows: bool, p: Any, s: SideMotion, reach: Matrix) -> None:
    """Write the greatest `n·p` of eight points to second order, at both ends of a line.

    Args:
        grows: Whether only the growth is wanted, without the points' own `n·p`.
        p: Coordinates x, y, z of the points in the world, as lanes [m].
        s: The joints that move them.
        reach: The values at both ends, overwritten, shape (2, 8) [m].
    """
    still = splat(0.0)
    if not grows:
        still = dot(s.n, p)
    differentiate(p, s)
    if s.line:
        line_ends(still, s, reach)
        return
    way = bend = splat(0.0)
    for k in range(s.first, s.end):
        own, second = s.rows[k], s.hessian[k]
        gradient, turned = load(own.gradient, 0), splat(0.0)
        for j in range(s.first, s.end):
            turned = turned + load(second, WIDTH * j) * s.rows[j].middle
        way = way + gradient * own.middle
        bend = bend + turned * (0.5 * own.middle)
        store(own.end_gradient, 0, gradient + turned)
        store(own.end_width, 0, splat(own.width))
    found = still + way + bend + widest(s)
    store(reach[0], 0, found)
    store(reach[1], 0, found)


@kernel
def line_ends(still: Any, s: SideMotion, reach: Matrix) -> None:
    """Write the greatest `n·p` at each end of the joints' line, valid in between too.

    Args:
        still: `n·p` of eight points at rest, as lanes [m].
        s: The joints; their derivatives are written already.
        reach: The values at both ends, overwritten, shape (2, 8) [m].
    """
    way = bend = grown = splat(0.0)
    for k in range(s.first, s.end):
        own, second = s.rows[k], s.hessian[k]
        curved = mixed = splat(0.0)
        for j in range(s.first, s.end):
            h = load(second, WIDTH * j)
            curved = curved + h * s.rows[j].half_line
            mixed = mixed + size(h) * abs(s.rows[j].widening)
        way = way + load(own.gradient, 0) * own.half_line
        bend = bend + curved * (0.5 * own.half_line)
        grown = grown + mixed * (abs(own.half_line) + 0.5 * abs(own.widening))
        store(own.gradient_change, 0, curved)
    # Between the ends of a line the value exceeds both by at most its curvature.
    found = still + bend + most(-bend, splat(0.0)) + grown
    store(reach[0], 0, found - way + line_end(-1.0, s))
    store(reach[1], 0, found + way + line_end(1.0, s))


@kernel
def line_end(sign: float, s: SideMotion) -> Any:
    """Greatest addition by the ranges of the joints at one end of their line [m]."""
    for k in range(s.first, s.end):
        own = s.rows[k]
        change = load(own.gradient_change, 0) * sign
        store(own.end_gradient, 0, load(own.gradient, 0) + change)
        store(own.end_width, 0, splat(own.width + sign * own.widening))
    return widest(s)


@kernel
def differentiate(p: Any, s: SideMotion) -> None:
    """Write the first and second derivatives of n·p by the joints, p as lanes."""
    for k in range(s.first, s.end):
        own = s.rows[k]
        slope = dot((own.slope[0], own.slope[1], own.slope[2]), p)
        store(own.gradient, 0, slope + own.level)
        move = (splat(own.axis[0]), splat(own.axis[1]), splat(own.axis[2]))
        if own.revolute:
            origin = (own.origin[0], own.origin[1], own.origin[2])
            move = cross(move, sub(p, origin))
        for j in range(s.first, k + 1):
            other = s.rows[j].slope
            h = dot((other[0], other[1], other[2]), move)
            store(s.hessian[k], WIDTH * j, h)
            store(s.hessian[j], WIDTH * k, h)


@kernel
def widest(s: SideMotion) -> Any:
    """Upper bound of `Σ g Δ + ½ Σ Σ h Δ Δ` for Δ within plus and minus the widths.

    If g exceeds every change that h can make to it, the greatest value is at that end
    of the joint's range for any values of the others, whose g is then updated. For the
    remaining joints each term takes its greatest size.
    """
    total, nothing = splat(0.0), splat(0.0)
    for _ in range(2):
        for k in range(s.first, s.end):
            own, second = s.rows[k], s.hessian[k]
            width = load(own.end_width, 0)
            open_still = size(width) > nothing
            if not some(open_still):
                continue
            g = load(own.end_gradient, 0)
            decided = open_still & (size(g) >= doubt(second, s))
            if not some(decided):
                continue
            move = either(decided, either(g >= nothing, width, -width), nothing)
            store(own.end_width, 0, either(decided, nothing, width))
            total = total + (g * move + move * (load(second, WIDTH * k) * 0.5) * move)
            for j in range(s.first, s.end):
                gradient = s.rows[j].end_gradient
                change = load(second, WIDTH * j) * move
                store(gradient, 0, load(gradient, 0) + change)
    for k in range(s.first, s.end):
        own = s.rows[k]
        width = load(own.end_width, 0)
        # Not `width > 0`: a NaN has to reach the bound.
        if bits(width == nothing) != EIGHT:
            change = doubt(s.hessian[k], s) * 0.5
            total = total + width * (size(load(own.end_gradient, 0)) + change)
    return total


@kernel
def doubt(second: Floats, s: SideMotion) -> Any:
    """Greatest change of a joint's gradient by the joints that are undecided."""
    total = splat(0.0)
    for j in range(s.first, s.end):
        width = load(s.rows[j].end_width, 0)
        total = total + size(load(second, WIDTH * j)) * width
    return total
