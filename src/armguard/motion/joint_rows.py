"""Derivatives of a point's position along a direction by the joints of its chain."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, cross, dot, sub
from armguard.kernel import kernel
from armguard.robot.kinematics import PRISMATIC

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Reach at both ends of a line, or one value twice [m].
Ends = tuple[float, float]

# Greatest round-off of a unit normal's coordinate: a micrometre per 10⁹ m [-].
TURNED = 1e-15

# Places in a joint's row of derivatives, see LEVER_ROW: g(p) is slope·p + level, and
# its Δ is `FROM ± TO`. In an interval all joints are at the same place u of their
# lines, and both ends of these are tested: from the middle to an end Δ changes by TURN,
# and TO by WIDEN; GROWTH is the size of WIDEN.
SLOPE = 0  # n x axis, 3 numbers; 0 for a prismatic joint
LEVEL = 3
FROM = 4
TO = 5
AXIS = 6  # 3 numbers
ORIGIN = 9  # 3 numbers
TURNS = 12  # 1 for a revolute joint, 0 for a prismatic one
GRADIENT = 13  # g of the vertex that is tested
ALONG = 14  # g of this vertex at the joints' place on their line
OPEN = 15  # 1 until the end of its range with the greatest value is known
TURN = 16
WIDEN = 17
GROWTH = 18
CURVED = 19  # change of ALONG from the middle of the line to its end
RANGE = 20  # TO at the joints' place on their line
HESSIAN = 21  # h with each joint of the chain


@kernel
def joint_rows(
    n: Vec3,
    chain: Ints,
    first: int,
    count: int,
    axes: Floats,
    origin: int,
    joint_kind: Ints,
    rows: Floats,
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
        rows: Overwritten except for the Δ, shape (depth, LEVER_ROW + depth).
    """
    for k in range(first, count):
        b = chain[k]
        row, axis = rows[k], axes[origin + b]
        direction = (axis[0], axis[1], axis[2])
        for x in range(3):
            row[AXIS + x] = axis[x]
            row[ORIGIN + x] = axis[x + 3]
        if joint_kind[b] == PRISMATIC:
            row[0] = row[1] = row[2] = row[TURNS] = 0.0
            row[LEVEL] = dot(n, direction)
        else:
            slope = cross(n, direction)
            row[0], row[1], row[2] = slope
            row[LEVEL] = -dot(slope, (axis[3], axis[4], axis[5]))
            row[TURNS] = 1.0


@kernel
def joint_ranges(
    chain: Ints, first: int, count: int, middle: Floats, width: Floats, rows: Floats
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
        b = chain[k]
        rows[k, FROM], rows[k, TO] = middle[b], width[b]


@kernel
def point_reach(
    n: Vec3, p: Vec3, line: bool, first: int, count: int, rows: Floats
) -> Ends:
    """Greatest `n·p` of a vertex to second order, at both ends of a line [m].

    Args:
        n: Direction; 0 for the growth alone.
        p: Vertex of the core, in the world [m].
        line: Whether the joints are on a line.
        first: First joint of the chain that counts.
        count: Length of the chain.
        rows: Derivatives and ranges, see `joint_rows`.
    """
    differentiate(p, first, count, rows)
    if line:
        return line_ends(dot(n, p), first, count, rows)
    way = bend = 0.0
    for k in range(first, count):
        own = rows[k]
        turned = 0.0
        for j in range(first, count):
            turned += own[HESSIAN + j] * rows[j, FROM]
        way += own[GRADIENT] * own[FROM]
        bend += 0.5 * own[FROM] * turned
        own[ALONG], own[RANGE] = own[GRADIENT] + turned, own[TO]
    reach = dot(n, p) + way + bend + widest(first, count, rows)
    return (reach, reach)


@kernel
def line_ends(still: float, first: int, count: int, rows: Floats) -> Ends:
    """Greatest `n·p` at each end of the joints' line, valid also in between [m]."""
    way = bend = grown = 0.0
    for k in range(first, count):
        own = rows[k]
        curved = mixed = 0.0
        for j in range(first, count):
            h = own[HESSIAN + j]
            curved += h * rows[j, TURN]
            mixed += abs(h) * rows[j, GROWTH]
        way += own[GRADIENT] * own[TURN]
        bend += 0.5 * own[TURN] * curved
        grown += (abs(own[TURN]) + 0.5 * own[GROWTH]) * mixed
        own[CURVED] = curved
    # Between the ends of a line the value exceeds both by at most its curvature.
    reach = still + bend + max(-bend, 0.0) + grown
    return (
        reach - way + line_end(-1.0, first, count, rows),
        reach + way + line_end(1.0, first, count, rows),
    )


@kernel
def line_end(sign: float, first: int, count: int, rows: Floats) -> float:
    """Greatest addition by the ranges of the joints at one end of their line [m]."""
    for k in range(first, count):
        own = rows[k]
        own[ALONG] = own[GRADIENT] + sign * own[CURVED]
        own[RANGE] = own[TO] + sign * own[WIDEN]
    return widest(first, count, rows)


@kernel
def differentiate(p: Vec3, first: int, count: int, rows: Floats) -> None:
    """Write the first and second derivatives of n·p by the joints."""
    for k in range(first, count):
        own = rows[k]
        slope = (own[SLOPE], own[SLOPE + 1], own[SLOPE + 2])
        own[GRADIENT] = dot(slope, p) + own[LEVEL]
        move = (own[AXIS], own[AXIS + 1], own[AXIS + 2])
        if own[TURNS] != 0.0:
            origin = (own[ORIGIN], own[ORIGIN + 1], own[ORIGIN + 2])
            move = cross(move, sub(p, origin))
        for j in range(first, k + 1):
            other = rows[j]
            h = dot((other[SLOPE], other[SLOPE + 1], other[SLOPE + 2]), move)
            own[HESSIAN + j] = h
            other[HESSIAN + k] = h


@kernel
def widest(first: int, count: int, rows: Floats) -> float:
    """Upper bound of `Σ g Δ + ½ Σ Σ h Δ Δ` for Δ within plus and minus the widths.

    If g exceeds every change that h can make to it, the greatest value is at that end
    of the joint's range for any values of the others, whose g is then updated. For the
    remaining joints each term takes its greatest size.
    """
    total = 0.0
    for k in range(first, count):
        rows[k, OPEN] = 1.0
    for _ in range(2):
        for k in range(first, count):
            own = rows[k]
            if own[OPEN] == 0.0:
                continue
            doubt = 0.0
            for j in range(first, count):
                doubt += abs(own[HESSIAN + j]) * rows[j, RANGE] * rows[j, OPEN]
            g = own[ALONG]
            if not abs(g) >= doubt:
                continue
            move = own[RANGE] if g >= 0.0 else -own[RANGE]
            own[OPEN] = 0.0
            total += g * move + 0.5 * own[HESSIAN + k] * move * move
            for j in range(first, count):
                rows[j, ALONG] += own[HESSIAN + j] * move
    for k in range(first, count):
        own = rows[k]
        if own[OPEN] == 0.0:
            continue
        doubt = 0.0
        for j in range(first, count):
            doubt += abs(own[HESSIAN + j]) * rows[j, RANGE] * rows[j, OPEN]
        total += own[RANGE] * (abs(own[ALONG]) + 0.5 * doubt)
    return total
