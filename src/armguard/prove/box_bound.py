"""Bounds of a pair's distance over boxes of joint positions.

Let the joints between two links stand in the middle of a box of positions, with half
widths h. Two lower bounds of the distance over the box are known; the larger counts:

- The distance in the middle minus the sway of both sides. Change the joints one after
  the other, the one nearest to the root first: what a joint turns then still stands as
  in the middle of the box, so a point goes along a chord of no more than
  2 R sin(h / 2), where R is its distance from the axis in the middle. The sway of a
  shape is the sum of these chords, each for its farthest point. The signed distance
  changes by no more than both sways, overlapping as well as apart, so this bounds it
  from above as well.
- The gap along the normal in the middle, by the first two derivatives of both sides'
  reach, see `armguard.motion.gap_bound`. It feels only what a joint moves along the
  normal, and errs by the square of the widths where the first errs by the widths.

Everything stands in the frame of the body that carries both chains.
"""

from math import inf, pi, sin

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_point, place_row
from armguard.geometry.vec3 import Vec3, cross, norm, scaled, sub
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from armguard.motion.gap_bound import curvature, side_reach
from armguard.motion.joint_rows import joint_ranges, joint_rows
from armguard.prove.pair_proof import TOUCHING
from armguard.robot.kinematics import PRISMATIC, forward_kinematics

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Points that hold a shape: its convex hull lies in theirs, grown by the radius.
HOLD_POINTS = 8

# Places in a row of bounds.
LOWER = 0  # lower bound of the distance over the box, the best of all models [m]
UPPER = 1  # upper bound of the distance over the box, the worst of all models [m]
GAP = 2  # signed distance of the exact shapes in the middle of the box [m]
APART = 3  # the best distance of all models there [m]
SPLIT = 4  # place in q of the joint that moves the worst pair the most
BOUNDS = 5


@kernel
def place_shape(
    s: int,
    side: int,
    kinds: Ints,
    local_rows: Floats,
    hold: Floats,
    hold_count: Ints,
    hold_radius: Floats,
    joint_kind: Ints,
    chains: Ints,
    lengths: Ints,
    T: Floats,
    axes: Floats,
    width: Floats,
    rows: Floats,
    levers: Floats,
    reaches: Floats,
    sway: Floats,
    balls: Floats,
) -> None:
    """Place a shape in the middle of a box, and find how far the box moves its points.

    Args:
        s: The shape.
        side: 0 or 1, whose chain it rides on.
        kinds: Shape kinds, shape (s,).
        local_rows: Rows in the frames of their bodies, shape (s, 16).
        hold: Points that hold each shape, in its body, shape (s, 8, 3).
        hold_count: How many, shape (s,).
        hold_radius: Radius these are grown by, shape (s,).
        joint_kind: Joint kinds, shape (b,).
        chains: Bodies of both chains, shape (2, depth).
        lengths: Lengths of both chains, shape (2,).
        T: Poses of the bodies, shape (b, 12).
        axes: Their axes: direction and a point, shape (b, 6).
        width: Half widths of the bodies' joints, shape (b,).
        rows: Rows where the shapes stand, its own is written, shape (s, 16).
        levers: Distance of its farthest point from each axis in the middle of the box,
            1 for sliding joints; written, shape (s, depth).
        reaches: The same anywhere in the box; written, shape (s, depth).
        sway: How far its points may be from where they are; written, shape (s,).
        balls: Middle and radius of a ball round it; written, shape (s, 4).
    """
    count = lengths[side]
    body = chains[side, count - 1] if count > 0 else 0
    place_row(kinds[s], local_rows[s], T[body], rows[s])
    for k in range(count):
        levers[s, k] = 0.0
    ball = balls[s]
    for k in range(4):
        ball[k] = 0.0
    for i in range(hold_count[s]):
        for r in range(3):
            ball[r] += hold[s, i, r] / hold_count[s]
    for i in range(hold_count[s]):
        x, y, z = hold[s, i, 0], hold[s, i, 1], hold[s, i, 2]
        p = (
            T[body, 0] * x + T[body, 1] * y + T[body, 2] * z + T[body, 3],
            T[body, 4] * x + T[body, 5] * y + T[body, 6] * z + T[body, 7],
            T[body, 8] * x + T[body, 9] * y + T[body, 10] * z + T[body, 11],
        )
        for k in range(count):
            b = chains[side, k]
            arm = sub(p, (axes[b, 3], axes[b, 4], axes[b, 5]))
            across = cross((axes[b, 0], axes[b, 1], axes[b, 2]), arm)
            levers[s, k] = max(levers[s, k], norm(across))
        from_middle = sub((x, y, z), (ball[0], ball[1], ball[2]))
        ball[3] = max(ball[3], norm(from_middle) + hold_radius[s])
    place_point(T[body], ball, 0, ball)
    total = 0.0
    for back in range(count):
        k = count - 1 - back
        b = chains[side, k]
        if joint_kind[b] == PRISMATIC:
            levers[s, k] = reaches[s, k] = 1.0
            total += width[b]
        else:
            levers[s, k] += hold_radius[s]
            reaches[s, k] = levers[s, k] + total
            total += 2.0 * levers[s, k] * sin(0.5 * min(width[b], pi))
    sway[s] = total


@kernel(inline=False)
def directed_gap(
    kind_a: int,
    row_a: Floats,
    kind_b: int,
    row_b: Floats,
    n: Vec3,
    sway_a: float,
    sway_b: float,
    bend: float,
    chains: Ints,
    lengths: Ints,
    axes: Floats,
    joint_kind: Ints,
    middle: Floats,
    width: Floats,
    lever_rows: Floats,
) -> float:
    """Least gap along a direction over a box, bounded to the second order [m].

    Args:
        kind_a: Shape kind of A.
        row_a: Its row in the middle of the box.
        kind_b: Shape kind of B.
        row_b: Its row.
        n: Unit direction from A to B.
        sway_a: How far any point of A may move [m].
        sway_b: How far any point of B may move [m].
        bend: What the second order leaves out of both sides [m].
        chains: Bodies of both chains, shape (2, depth).
        lengths: Lengths of both chains, shape (2,).
        axes: Axes of the bodies, shape (b, 6).
        joint_kind: Joint kinds, shape (b,).
        middle: Zeros, shape (b,).
        width: Half widths, shape (b,).
        lever_rows: Scratch, see `joint_rows`.
    """
    joint_rows(n, chains[0], 0, lengths[0], axes, 0, joint_kind, lever_rows)
    joint_ranges(chains[0], 0, lengths[0], middle, width, lever_rows)
    gap = -side_reach(kind_a, row_a, n, False, sway_a, 0, lengths[0], lever_rows)[0]
    back = scaled(-1.0, n)
    joint_rows(back, chains[1], 0, lengths[1], axes, 0, joint_kind, lever_rows)
    joint_ranges(chains[1], 0, lengths[1], middle, width, lever_rows)
    gap -= side_reach(kind_b, row_b, back, False, sway_b, 0, lengths[1], lever_rows)[0]
    return float(gap - bend)


@kernel
def widest_joint(
    a: int,
    b: int,
    q_index: Ints,
    chains: Ints,
    lengths: Ints,
    width: Floats,
    levers: Floats,
    moves: Floats,
) -> int:
    """Place in q whose joints move a pair the most over the box.

    Args:
        a: Shape of side 0.
        b: Shape of side 1.
        q_index: Place in q of each body's joint, shape (b,).
        chains: Bodies of both chains, shape (2, depth).
        lengths: Lengths of both chains, shape (2,).
        width: Half widths, shape (b,).
        levers: Distances from the axes, shape (s, depth).
        moves: Scratch, shape (n,).
    """
    for j in range(moves.shape[0]):
        moves[j] = 0.0
    for side in range(2):
        s = a if side == 0 else b
        for k in range(lengths[side]):
            body = chains[side, k]
            moves[q_index[body]] += width[body] * levers[s, k]
    best = 0
    for j in range(moves.shape[0]):
        if moves[j] > moves[best]:
            best = j
    return best


@kernel(inline=False, entry=True)
def bound_boxes(
    centres: Floats,
    halves: Floats,
    full: int,
    parent: Ints,
    joint_kind: Ints,
    q_index: Ints,
    gain: Floats,
    T_parent_joint: Floats,
    axis: Floats,
    chains: Ints,
    lengths: Ints,
    kinds: Ints,
    sides: Ints,
    local_rows: Floats,
    hold: Floats,
    hold_count: Ints,
    hold_radius: Floats,
    pairs: Ints,
    models: Ints,
    T: Floats,
    axes: Floats,
    middle: Floats,
    width: Floats,
    rows: Floats,
    levers: Floats,
    reaches: Floats,
    sway: Floats,
    balls: Floats,
    placed: Ints,
    moves: Floats,
    lever_rows: Floats,
    out: Floats,
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
        hold: Points that hold each shape, shape (s, 8, 3).
        hold_count: How many, shape (s,).
        hold_radius: Radius these are grown by, shape (s,).
        pairs: Pairs of shapes, side 0 first, those of one model together, shape (p, 2).
        models: Where the pairs of each model start, and the end, shape (m + 1,).
        T: Scratch, shape (b, 12).
        axes: Scratch, shape (b, 6).
        middle: Zeros, shape (b,).
        width: Scratch, shape (b,).
        rows: Scratch, shape (s, 16).
        levers: Scratch, shape (s, depth).
        reaches: Scratch, shape (s, depth).
        sway: Scratch, shape (s,).
        balls: Scratch, shape (s, 4).
        placed: Scratch, shape (s,).
        moves: Scratch, shape (n,).
        lever_rows: Scratch, see `joint_rows`.
        out: Bounds, overwritten, shape (k, BOUNDS).
    """
    witness = numba.carray(stack(10), (WITNESS_WIDTH,), np.float64)
    for box in range(centres.shape[0]):
        forward_kinematics(
            centres[box], parent, joint_kind, q_index, gain, T_parent_joint, axis, T
        )
        for b in range(parent.shape[0]):
            x, y, z = axis[b, 0], axis[b, 1], axis[b, 2]
            for r in range(3):
                axes[b, r] = T[b, 4 * r] * x + T[b, 4 * r + 1] * y + T[b, 4 * r + 2] * z
                axes[b, 3 + r] = T[b, 4 * r + 3]
            width[b] = 0.0
            if q_index[b] >= 0:
                width[b] = abs(gain[b, 0]) * halves[box, q_index[b]]
        for s in range(kinds.shape[0]):
            placed[s] = 0
        best_lower = best_apart = best_upper = -inf
        gap = inf
        split = 0
        for m in range(models.shape[0] - 1):
            lower = nearest = upper = inf
            for k in range(models[m], models[m + 1]):
                i, j = pairs[k, 0], pairs[k, 1]
                for end in range(2):
                    s = i if end == 0 else j
                    if placed[s] == 0:
                        placed[s] = 1
                        place_shape(
                            s, sides[s], kinds, local_rows, hold, hold_count,
                            hold_radius, joint_kind, chains, lengths, T, axes, width,
                            rows, levers, reaches, sway, balls,
                        )  # fmt: skip
                both = sway[i] + sway[j]
                between = norm(
                    sub(
                        (balls[i, 0], balls[i, 1], balls[i, 2]),
                        (balls[j, 0], balls[j, 1], balls[j, 2]),
                    )
                )
                clear = between - balls[i, 3] - balls[j, 3]
                if clear > nearest and clear - both > lower and clear + both > upper:
                    # Not the pair that any of these will be told for.
                    continue
                measure(kinds[i], rows[i], kinds[j], rows[j], witness)
                distance = witness[0]
                nearest = min(nearest, distance)
                upper = min(upper, distance + both)
                own = distance - both
                if not own > TOUCHING and distance > TOUCHING:
                    bend = curvature(
                        chains[0], 0, lengths[0], reaches[i], joint_kind, width
                    ) + curvature(
                        chains[1], 0, lengths[1], reaches[j], joint_kind, width
                    )
                    if distance - bend > TOUCHING:
                        n = (witness[7], witness[8], witness[9])
                        own = max(
                            own,
                            directed_gap(
                                kinds[i], rows[i], kinds[j], rows[j], n,
                                sway[i], sway[j], bend, chains, lengths, axes,
                                joint_kind, middle, width, lever_rows,
                            ),
                        )  # fmt: skip
                if not own > -inf:
                    # A distance that is no number proves nothing.
                    own = -inf
                if own < lower:
                    lower = own
                    if m == 0:
                        split = widest_joint(
                            i, j, q_index, chains, lengths, width, levers, moves
                        )
                if m > 0 and full == 0 and not own > TOUCHING:
                    nearest = -inf
                    break
            if m == 0:
                gap = nearest
            best_lower = max(best_lower, lower)
            best_apart = max(best_apart, nearest)
            best_upper = max(best_upper, upper)
            if best_lower > TOUCHING and full == 0:
                break
        out[box, LOWER] = best_lower
        out[box, UPPER] = best_upper
        out[box, GAP] = gap
        out[box, APART] = best_apart
        out[box, SPLIT] = split
