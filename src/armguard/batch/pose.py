"""Poses of eight configurations at once, and how far a span may be from its middle."""

from typing import NamedTuple

from armguard.batch.plan import Plan
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import WIDTH, load, root, sincos, splat, store
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.table import LongVector, Vector, table

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
TRIANGLE = int(ShapeKind.TRIANGLE)
HALF_SPACE = int(ShapeKind.HALF_SPACE)

# What a place holds in its lanes.
SPANS = 0  # spans of rows; pairs are kept for their rows
ROWS = 1  # rows; the least distance is found
MOTIONS = 2  # spans of motions; they are proven, or not
NEAR = 3  # rows; every pair that may be nearer than the margin is kept


@table
class Place(NamedTuple):
    """Eight configurations, each a row of a batch or the middle of a span.

    Lanes are flat, eight numbers after each other. A *slot* is 0 for the world and
    1 + b for body b.

    Attributes:
        mode: SPANS, ROWS, MOTIONS or NEAR, shape (1,).
        q: Joint positions, shape (8 · n,).
        half: Largest distance of a span's joint positions from q, shape (8 · n,).
        T: Poses of the bodies, shape (8 · 12 · b,).
        rows: Rows of primitives and balls that move, shape (8 · 16 · k,).
        stamp: Turn in which a row was placed last, shape (k,).
        turn: Number of this turn, shape (1,).
        shift: Largest way of the middle of a part's ball, as seen from each of its
            carriers, shape (8 · m · (1 + b),) [m].
        swing: Sum of the angles by which joints between may turn it, of that shape
            [rad].
        best: Least distance so far; of a span of rows, a number that no row's exceeds;
            of a span of a motion, 0, or -inf if a pair is not proven, shape (8,).
        pair: Its pair, i · CODE + j; -1 for none; of a span of a motion, -2 where the
            middle does not keep a buffer, shape (8,).
        lead: The last such pair of each lane, shape (8,).
        bound: Lower bounds of a pair, shape (8,) [m].
    """

    mode: LongVector
    q: Vector
    half: Vector
    T: Vector
    rows: Vector
    stamp: LongVector
    turn: LongVector
    shift: Vector
    swing: Vector
    best: Vector
    pair: Vector
    lead: Vector
    bound: Vector


@kernel
def spread(p: Plan, w: Place) -> None:
    """Write to all lanes what no joint moves."""
    for body in range(p.parent.shape[0]):
        if p.parent[body] < 0:
            for k in range(12):
                store(w.T, (body * 12 + k) * WIDTH, splat(p.frames[body, k]))
    for i in range(p.kinds.shape[0]):
        if p.bodies[i] >= 0:
            for k in (0, 4, 5, 6):
                store(w.rows, (i * ROW_WIDTH + k) * WIDTH, splat(p.rows[i, k]))


@kernel
def move_bodies(p: Plan, w: Place) -> None:
    """Poses of all bodies in lanes, see `forward_kinematics`."""
    T = w.T
    w.turn[0] += 1
    for body in range(p.parent.shape[0]):
        up, kind = p.parent[body], p.joint_kind[body]
        if up < 0:
            continue
        angle = load(w.q, p.q_index[body] * WIDTH)
        angle = angle * p.gain[body, 0] + p.gain[body, 1]
        sine, cosine = sincos(angle)
        F = p.frames
        for r in range(3):
            above = (up * 12 + 4 * r) * WIDTH
            out = (body * 12 + 4 * r) * WIDTH
            u, v = load(T, above), load(T, above + WIDTH)
            x, o = load(T, above + 2 * WIDTH), load(T, above + 3 * WIDTH)
            a = u * F[body, 0] + v * F[body, 4] + x * F[body, 8]
            b = u * F[body, 1] + v * F[body, 5] + x * F[body, 9]
            d = u * F[body, 2] + v * F[body, 6] + x * F[body, 10]
            o = u * F[body, 3] + v * F[body, 7] + x * F[body, 11] + o
            if kind == PRISMATIC:
                o = o + angle * d
            elif kind != FIXED:
                a, b = a * cosine + b * sine, b * cosine - a * sine
            store(T, out, a)
            store(T, out + WIDTH, b)
            store(T, out + 2 * WIDTH, d)
            store(T, out + 3 * WIDTH, o)


@kernel
def place(i: int, p: Plan, w: Place) -> None:
    """Put row i, of what moves, into the world; see `place_row`."""
    if p.bodies[i] < 0 or w.stamp[i] == w.turn[0]:
        return
    w.stamp[i] = w.turn[0]
    kind = p.kinds[i]
    place_vector(i, 1, 1, 1.0, p, w)
    if kind != SPHERE:
        place_rest(i, p, w)


@kernel(inline=False)
def place_rest(i: int, p: Plan, w: Place) -> None:
    """Put into the world what a row holds behind its origin."""
    kind = p.kinds[i]
    if kind == CAPSULE or kind == TRIANGLE:
        place_vector(i, 4, 1, 1.0, p, w)
        if kind == TRIANGLE:
            place_vector(i, 7, 1, 1.0, p, w)
    elif kind == HALF_SPACE:
        place_vector(i, 4, 1, 0.0, p, w)
    else:
        for k in range(3):
            place_vector(i, 7 + k, 3, 0.0, p, w)


@kernel
def place_vector(
    i: int, first: int, step: int, share: float, p: Plan, w: Place
) -> None:
    """Place three numbers of row i: a point, or a direction where `share` is 0."""
    x, y, z = p.rows[i, first], p.rows[i, first + step], p.rows[i, first + 2 * step]
    for r in range(3):
        at = (p.bodies[i] * 12 + 4 * r) * WIDTH
        value = (
            load(w.T, at) * x
            + load(w.T, at + WIDTH) * y
            + load(w.T, at + 2 * WIDTH) * z
        )
        value = value + load(w.T, at + 3 * WIDTH) * share
        store(w.rows, (i * ROW_WIDTH + first + step * r) * WIDTH, value)


@kernel(inline=False)
def widen(p: Plan, w: Place) -> None:
    """How far each span may carry each part from where it is at q.

    Joints are turned from q one after another, from the root on. Until a joint's turn
    comes, what lies behind it keeps its distance from its axis, and the turn carries
    it no farther than that distance times the angle.
    """
    slots = p.parent.shape[0] + 1
    for part in range(p.own.shape[0]):
        ball = p.parts[part, 2]
        place(ball, p, w)
        at = ball * ROW_WIDTH * WIDTH
        x = load(w.rows, at + WIDTH)
        y = load(w.rows, at + 2 * WIDTH)
        z = load(w.rows, at + 3 * WIDTH)
        shift, swing = splat(0.0), splat(0.0)
        body = p.bodies[ball]
        while body >= 0:
            slot = (part * slots + 1 + body) * WIDTH
            store(w.shift, slot, shift)
            store(w.swing, slot, swing)
            if p.parent[body] >= 0 and p.joint_kind[body] != FIXED:
                angle = load(w.half, p.q_index[body] * WIDTH) * abs(p.gain[body, 0])
                if p.joint_kind[body] == PRISMATIC:
                    shift = shift + angle
                else:
                    f = body * 12 * WIDTH
                    nx = load(w.T, f + 2 * WIDTH)
                    ny = load(w.T, f + 6 * WIDTH)
                    nz = load(w.T, f + 10 * WIDTH)
                    u = x - load(w.T, f + 3 * WIDTH)
                    v = y - load(w.T, f + 7 * WIDTH)
                    t = z - load(w.T, f + 11 * WIDTH)
                    a, b, d = v * nz - t * ny, t * nx - u * nz, u * ny - v * nx
                    shift = shift + angle * root(a * a + b * b + d * d)
                    swing = swing + angle
            body = p.parent[body]
        store(w.shift, part * slots * WIDTH, shift)
        store(w.swing, part * slots * WIDTH, swing)
