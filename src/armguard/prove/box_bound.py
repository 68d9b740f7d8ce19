"""Bounds of a pair's distance over boxes of joint positions.

Let the joints between two links be in the middle of a box of positions, with half
widths h. Two lower bounds of the distance over the box are known; the larger counts:

- The distance in the middle minus the sway of both sides. Change the joints one after
  the other, the one nearest to the root first: what a joint turns then is still as
  in the middle of the box, so a point goes along a chord of no more than
  2 R sin(h / 2), where R is its distance from the axis in the middle. The sway of a
  shape is the sum of these chords, each for its farthest point. The signed distance
  changes by no more than both sways, overlapping as well as apart, so this bounds it
  from above as well.
- The gap along the normal in the middle, by the first two derivatives of both sides'
  reach, see `armguard.motion.gap_bound`. It feels only what a joint moves along the
  normal, and errs by the square of the widths where the first errs by the widths.

All coordinates are in the frame of the body that carries both chains.
"""

from math import inf, pi, sin
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_point, place_row
from armguard.geometry.vec3 import Vec3, cross, norm, scaled, sub
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.gap_bound import curvature
from armguard.motion.joint_rows import (
    JointRow,
    SideMotion,
    joint_ranges,
    joint_rows,
)
from armguard.motion.side_reach import side_reach
from armguard.prove.pair_proof import TOUCHING
from armguard.record import Records, record
from armguard.robot.kinematics import PRISMATIC, forward_kinematics
from armguard.table import IntMatrix, IntVector, Matrix, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Points that hold a shape: its convex hull lies in theirs, grown by the radius.
HOLD_POINTS = 8


@record
class BoxBounds:
    """Bounds of two links' distance over a box of joint positions.

    Attributes:
        lower: Lower bound of the distance over the box, the best of all models [m].
        upper: Upper bound of the distance over the box, the worst of all models [m].
        exact_distance: Signed distance of the exact shapes in the box's middle [m].
        distance: Greatest signed distance of all models there [m].
        split: Place in q of the joint that moves the nearest pair the most.
    """

    lower: float
    upper: float
    exact_distance: float
    distance: float
    split: int


@table
class LinkPair(NamedTuple):
    """Two links of one robot, and the memory of their bounds.

    Attributes:
        parent: See `SceneTables`, from here to `axis`; body 0 carries both chains.
        joint_kind: Joint kinds.
        q_index: Places in q.
        gain: Multipliers and offsets.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        chains: Bodies of both chains, from body 0 on, shape (2, depth).
        lengths: Lengths of both chains, shape (2,).
        kinds: Shape kinds, shape (s,).
        sides: 0 or 1, shape (s,).
        local_rows: Rows in the frames of their bodies, shape (s, 16).
        hold: Points that hold each shape, in its body, shape (s · HOLD_POINTS, 3).
        hold_count: How many, shape (s,).
        hold_radius: Radius these are grown by, shape (s,).
        pairs: Pairs of shapes, side 0 first, those of one model together, shape (p, 2).
        models: Where the pairs of each model start, and the end, shape (m + 1,).
        T: Poses of the bodies in the middle of the box, shape (b, 12).
        axes: Their axes: direction and a point, shape (b, 6).
        middle: Zeros, shape (b,).
        width: Half widths of the bodies' joints, shape (b,).
        rows: Rows of the shapes in the middle of the box, shape (s, 16).
        levers: Distance of a shape's farthest point from each axis in the middle of the
            box, 1 for sliding joints, shape (s, depth).
        reaches: The greatest such distance anywhere in the box, shape (s, depth).
        sway: How far a shape's points may be from where they are, shape (s,).
        balls: Middle and radius of a ball round each shape, shape (s, 4).
        placed: 1 for shapes that are placed in this box, shape (s,).
        moves: Scratch for how far each joint moves a pair, shape (n,).
        lever_rows: Scratch for gradients, see `joint_rows`, shape (depth,).
        hessian: Scratch for second derivatives, shape (depth, 8 · depth).
    """

    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    T_parent_joint: Matrix
    axis: Matrix
    chains: IntMatrix
    lengths: IntVector
    kinds: IntVector
    sides: IntVector
    local_rows: Matrix
    hold: Matrix
    hold_count: IntVector
    hold_radius: Vector
    pairs: IntMatrix
    models: IntVector
    T: Matrix
    axes: Matrix
    middle: Vector
    width: Vector
    rows: Matrix
    levers: Matrix
    reaches: Matrix
    sway: Vector
    balls: Matrix
    placed: IntVector
    moves: Vector
    lever_rows: Annotated[Records[JointRow], 1]
    hessian: Matrix


open_link_pair = opener(LinkPair)


@kernel
def place_shape(s: int, t: LinkPair) -> None:
    """Place a shape in the middle of a box, and find how far the box moves its points.

    Its row, levers, reaches, sway and ball are written.
    """
    side, T, axes, levers = t.sides[s], t.T, t.axes, t.levers
    count = t.lengths[side]
    body = t.chains[side, count - 1] if count > 0 else 0
    place_row(t.kinds[s], t.local_rows[s], T[body], t.rows[s])
    for k in range(count):
        levers[s, k] = 0.0
    ball = t.balls[s]
    for k in range(4):
        ball[k] = 0.0
    for i in range(t.hold_count[s]):
        for r in range(3):
            ball[r] += t.hold[s * HOLD_POINTS + i, r] / t.hold_count[s]
    for at in range(s * HOLD_POINTS, s * HOLD_POINTS + t.hold_count[s]):
        x, y, z = t.hold[at, 0], t.hold[at, 1], t.hold[at, 2]
        p = (
            T[body, 0] * x + T[body, 1] * y + T[body, 2] * z + T[body, 3],
            T[body, 4] * x + T[body, 5] * y + T[body, 6] * z + T[body, 7],
            T[body, 8] * x + T[body, 9] * y + T[body, 10] * z + T[body, 11],
        )
        for k in range(count):
            b = t.chains[side, k]
            arm = sub(p, (axes[b, 3], axes[b, 4], axes[b, 5]))
            across = cross((axes[b, 0], axes[b, 1], axes[b, 2]), arm)
            levers[s, k] = max(levers[s, k], norm(across))
        from_middle = sub((x, y, z), (ball[0], ball[1], ball[2]))
        ball[3] = max(ball[3], norm(from_middle) + t.hold_radius[s])
    place_point(T[body], ball, 0, ball)
    total = 0.0
    for back in range(count):
        k = count - 1 - back
        b = t.chains[side, k]
        if t.joint_kind[b] == PRISMATIC:
            levers[s, k] = t.reaches[s, k] = 1.0
            total += t.width[b]
        else:
            levers[s, k] += t.hold_radius[s]
            t.reaches[s, k] = levers[s, k] + total
            total += 2.0 * levers[s, k] * sin(0.5 * min(t.width[b], pi))
    t.sway[s] = total


@kernel(inline=False)
def directed_gap(i: int, j: int, n: Vec3, bend: float, t: LinkPair) -> float:
    """Least gap along a direction over a box, bounded to the second order [m].

    Args:
        i: Shape of side 0.
        j: Shape of side 1.
        n: Unit direction from the first to the second.
        bend: What the second order leaves out of both sides [m].
        t: The links.
    """
    gap = 0.0
    for side in range(2):
        s, along = (i, n) if side == 0 else (j, scaled(-1.0, n))
        chain, count, rows = t.chains[side], t.lengths[side], t.lever_rows
        joint_rows(along, chain, 0, count, t.axes, 0, t.joint_kind, rows)
        joint_ranges(chain, 0, count, t.middle, t.width, rows)
        motion = SideMotion(along, False, t.sway[s], 0, count, rows, t.hessian)
        reach, _ = side_reach(t.kinds[s], t.rows[s], motion)
        gap -= reach
    return float(gap - bend)


@kernel
def widest_joint(i: int, j: int, t: LinkPair) -> int:
    """Place in q of the joint that moves a pair the most over the box."""
    moves = t.moves
    for k in range(moves.shape[0]):
        moves[k] = 0.0
    for side in range(2):
        s = i if side == 0 else j
        for k in range(t.lengths[side]):
            body = t.chains[side, k]
            moves[t.q_index[body]] += t.width[body] * t.levers[s, k]
    best = 0
    for k in range(moves.shape[0]):
        if moves[k] > moves[best]:
            best = k
    return best


@kernel
def place_box(centre: Floats, half: Floats, t: LinkPair) -> None:
    """Place the bodies in the middle of a box; no shape is placed yet."""
    forward_kinematics(
        centre, t.parent, t.joint_kind, t.q_index, t.gain, t.T_parent_joint, t.axis, t.T
    )
    T, axes = t.T, t.axes
    for b in range(t.parent.shape[0]):
        x, y, z = t.axis[b, 0], t.axis[b, 1], t.axis[b, 2]
        for r in range(3):
            axes[b, r] = T[b, 4 * r] * x + T[b, 4 * r + 1] * y + T[b, 4 * r + 2] * z
            axes[b, 3 + r] = T[b, 4 * r + 3]
        t.width[b] = 0.0
        if t.q_index[b] >= 0:
            t.width[b] = abs(t.gain[b, 0]) * half[t.q_index[b]]
    for s in range(t.kinds.shape[0]):
        t.placed[s] = 0


@kernel
def ball_gap(i: int, j: int, t: LinkPair) -> float:
    """Distance of the balls round two shapes, no more than that of the shapes [m]."""
    a = (t.balls[i, 0], t.balls[i, 1], t.balls[i, 2])
    b = (t.balls[j, 0], t.balls[j, 1], t.balls[j, 2])
    return float(norm(sub(a, b)) - t.balls[i, 3] - t.balls[j, 3])


@kernel
def least_distance(i: int, j: int, witness: Floats, t: LinkPair) -> float:
    """Lower bound of two shapes' distance over the box [m].

    Args:
        i: Shape of side 0.
        j: Shape of side 1.
        witness: Their witness in the middle of the box.
        t: The links.
    """
    distance = witness[0]
    own = distance - (t.sway[i] + t.sway[j])
    if not own > TOUCHING and distance > TOUCHING:
        bend = curvature(
            t.chains[0], 0, t.lengths[0], t.reaches[i], t.joint_kind, t.width
        ) + curvature(t.chains[1], 0, t.lengths[1], t.reaches[j], t.joint_kind, t.width)
        if distance - bend > TOUCHING:
            n = (witness[7], witness[8], witness[9])
            own = max(own, directed_gap(i, j, n, bend, t))
    # A distance that is no number proves nothing.
    return float(own) if own > -inf else -inf


@kernel(inline=False)
def bound_model(
    model: int, full: int, witness: Floats, t: LinkPair
) -> tuple[float, float, float, int]:
    """Bounds of two links' distance over a box, by one model.

    Args:
        model: The model.
        full: See `bound_boxes`.
        witness: Scratch for a pair's witness.
        t: The links; their bodies are in the middle of the box.

    Returns:
        Lower bound of the distance, its value in the middle of the box, its upper
        bound [m], and the joint that moves the nearest pair the most.
    """
    lower = nearest = upper = inf
    split = 0
    for k in range(t.models[model], t.models[model + 1]):
        i, j = t.pairs[k, 0], t.pairs[k, 1]
        for s in (i, j):
            if t.placed[s] == 0:
                t.placed[s] = 1
                place_shape(s, t)
        both = t.sway[i] + t.sway[j]
        clear = ball_gap(i, j, t)
        if clear > nearest and clear - both > lower and clear + both > upper:
            # None of the three is that of this pair.
            continue
        measure(t.kinds[i], t.rows[i], t.kinds[j], t.rows[j], witness)
        distance = witness[0]
        nearest = min(nearest, distance)
        upper = min(upper, distance + both)
        own = least_distance(i, j, witness, t)
        if own < lower:
            lower = own
            if model == 0:
                split = widest_joint(i, j, t)
        if model > 0 and full == 0 and not own > TOUCHING:
            return (lower, -inf, upper, split)
    return (lower, nearest, upper, split)


@kernel(inline=False, entry=True)
def bound_boxes(
    centres: Floats, halves: Floats, full: int, lines: Longs, out: Records[BoxBounds]
) -> None:
    """Bounds of two links' distance over boxes of joint positions.

    A link may be described by more than one union of shapes that holds it; two links
    are apart if any pair of their descriptions, a *model*, is. The first model is that
    of the exact shapes.

    Args:
        centres: Middles of the boxes, shape (k, n) [rad or m].
        halves: Half widths, shape (k, n) [rad or m].
        full: 1 to look at every model in full; 0 where the lower bound alone is wanted,
            and the others are what the search for it came upon.
        lines: Ledger of the links, a `LinkPair`.
        out: Bounds, overwritten, shape (k,).
    """
    t = open_link_pair(lines)
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    for box in range(centres.shape[0]):
        found = out[box]
        place_box(centres[box], halves[box], t)
        found.lower = found.distance = found.upper = -inf
        found.exact_distance, found.split = inf, 0
        for model in range(t.models.shape[0] - 1):
            lower, nearest, upper, split = bound_model(model, full, witness, t)
            if model == 0:
                found.exact_distance, found.split = nearest, split
            found.lower = max(found.lower, lower)
            found.distance = max(found.distance, nearest)
            found.upper = max(found.upper, upper)
            if found.lower > TOUCHING and full == 0:
                break
