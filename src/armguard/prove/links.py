"""Pairs of links in a tile: what a bound of their distance reads and writes."""

from math import cos, sin
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.batch.plan import Plan
from armguard.kernel import kernel
from armguard.motion.joint_rows import JointRow
from armguard.record import Records
from armguard.robot.kinematics import FIXED, PRISMATIC
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

# Columns of `Links.pairs`.
LINK_A, LINK_B, SHARED, FOLLOWS = range(4)

# What the joints of a pair of links follow in a tile: one place of a line, a place of
# its own for each link, or a place of its own for each joint.
TOGETHER, APART, ANYHOW = range(3)

# Models of a link: primitives that enclose it, and its exact shapes.
PRIMITIVES, EXACT = range(2)


@table
class Links(NamedTuple):
    """Pairs of links, and what a bound of them writes.

    Attributes:
        body: Body of each link, -1 for the world, shape (l,).
        spans: First shape and end of both models of each link, shape (l, 4); exact
            shapes are counted on from the primitives.
        pairs: Two links, how many joints move both alike, and what the joints follow,
            shape (k, 4).
        need: Distance that each pair has to keep, shape (k,) [m].
        joints: See `Chains`, shape (b, depth).
        length: Lengths of the chains, shape (b,).
        q: Joint positions in the middle of the tile, shape (n,).
        line: Half of each joint's line, signed, shape (n,).
        bow: How far each joint's curve may leave its line, shape (n,).
        wide: How far each joint may leave its curve, shape (n,).
        away: Joint positions, each off by its width so that a pair is nearer, (n,).
        slope: Derivative of a pair's distance by each joint, shape (n,).
        T: Poses of the bodies, shape (b, 12).
        axes: Their axes: direction and a point, shape (b, 6).
        size: Greatest displacement of each body's joint, shape (b,).
        drift: The same without `wide`, shape (b,).
        turn: Number of the tile, counted on, shape (1,).
        placed: Number of the last tile that each link's shapes were placed for, and how
            many joints did not count then, for both models, shape (l, 4).
        rows: Rows of all shapes, where they are placed, shape (s, 16).
        reaches: Greatest distance of a shape's points from each axis anywhere in the
            tile, shape (s, depth) [m].
        sway: How far a shape's points may be carried, and how far without `wide`,
            shape (s, 2) [m].
        lever_rows: Scratch for gradients, see `joint_rows`, shape (depth,).
        hessian: Scratch for second derivatives, shape (depth, 8 · depth).
    """

    body: IntVector
    spans: IntMatrix
    pairs: IntMatrix
    need: Vector
    joints: IntMatrix
    length: IntVector
    q: Vector
    line: Vector
    bow: Vector
    wide: Vector
    away: Vector
    slope: Vector
    T: Matrix
    axes: Matrix
    size: Vector
    drift: Vector
    turn: LongVector
    placed: LongMatrix
    rows: Matrix
    reaches: Matrix
    sway: Matrix
    lever_rows: Annotated[Records[JointRow], 1]
    hessian: Matrix


class TileGap(NamedTuple):
    """Distance of two links in a tile [m].

    Attributes:
        lower: It is never below this.
        upper: At every place of the line some position has it below this.
        found: A distance that it has in the tile.
        deepest: About the least that `upper` can come down to by the joints' widths.
    """

    lower: float
    upper: float
    found: float
    deepest: float


@kernel
def move_links(q: Floats, p: Plan, t: Links) -> None:
    """Poses of all bodies and axes of their joints, see `forward_kinematics`."""
    t.turn[0] += 1
    for body in range(p.parent.shape[0]):
        up, kind, T, F = p.parent[body], p.joint_kind[body], t.T[body], p.frames[body]
        if up < 0:
            for k in range(12):
                T[k] = F[k]
        else:
            above = t.T[up]
            angle, sine, cosine = 0.0, 0.0, 1.0
            if kind != FIXED:
                angle = q[p.q_index[body]] * p.gain[body, 0] + p.gain[body, 1]
            if kind != FIXED and kind != PRISMATIC:
                sine, cosine = sin(angle), cos(angle)
            for r in range(3):
                u, v, x = above[4 * r], above[4 * r + 1], above[4 * r + 2]
                a = u * F[0] + v * F[4] + x * F[8]
                b = u * F[1] + v * F[5] + x * F[9]
                d = u * F[2] + v * F[6] + x * F[10]
                o = u * F[3] + v * F[7] + x * F[11] + above[4 * r + 3]
                T[4 * r], T[4 * r + 1] = a * cosine + b * sine, b * cosine - a * sine
                T[4 * r + 2] = d
                T[4 * r + 3] = o + (angle * d if kind == PRISMATIC else 0.0)
        for r in range(3):
            t.axes[body, r], t.axes[body, r + 3] = T[4 * r + 2], T[4 * r + 3]


@kernel
def move_to_tile(p: Plan, t: Links) -> None:
    """Poses in the middle of the tile, and the greatest displacement of each joint."""
    move_links(t.q, p, t)
    for body in range(p.parent.shape[0]):
        t.size[body] = t.drift[body] = 0.0
        if p.parent[body] >= 0 and p.joint_kind[body] != FIXED:
            j, gain = p.q_index[body], abs(p.gain[body, 0])
            t.drift[body] = gain * (abs(t.line[j]) + t.bow[j])
            t.size[body] = t.drift[body] + gain * t.wide[j]


@kernel
def has_exact(link: int, t: Links) -> bool:
    """Whether a link has exact shapes beside its primitives."""
    return bool(t.spans[link, 2] != t.spans[link, 0])


@kernel
def kind_of(shape: int, p: Plan) -> int:
    """ShapeKind of a shape."""
    primitives = p.ball.shape[0]
    if shape < primitives:
        return int(p.kinds[shape])
    return int(p.exact_kinds[shape - primitives])
