"""Poses of eight configurations at once, and how far a span may be from its middle."""

from typing import Any, NamedTuple

from armguard.batch.plan import Plan
from armguard.batch.sine import sincos
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import WIDTH, item, load, splat, store
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
CELLS = 4  # cells of the joints between two links; what their gap is not below


@table
class Place(NamedTuple):
    """Eight configurations, each a row of a batch or the middle of a span.

    Lanes are flat, eight numbers after each other. A *slot* is 0 for the world and
    1 + b for body b.

    Attributes:
        mode: SPANS, ROWS, MOTIONS, NEAR or CELLS, shape (1,).
        q: Joint positions, shape (8 · n,).
        half: Largest distance of a span's joint positions from q, shape (8 · n,).
        T: Poses of the bodies, shape (8 · 12 · b,).
        rows: Rows of primitives and balls that move, shape (8 · 16 · k,).
        stamp: Turn in which a row was placed last, shape (k,).
        turn: Number of this turn, shape (1,).
        shift: Largest way of a body's middle, as seen from each of its carriers, shape
            (8 · b · (1 + b),) [m].
        swing: Sum of the angles by which joints between may turn it, of that shape
            [rad].
        cells: Cells of the joint positions, shape (8 · n,).
        best: Least distance so far; of a span of rows, a number that no row's exceeds;
            of a span of a motion, 0, or -inf if a pair is not proven, shape (8,).
        pair: Its pair, i · CODE + j; -1 for none; of a span of a motion, -2 where the
            middle does not keep a buffer, shape (8,).
        lead: The last such pair of each lane, shape (8,).
        bound: Lower bounds of a pair, shape (8,) [m].
        open: Pairs of parts to be compared, shape (o,).
        apart: 0 in lanes in which they may be near, else minus infinity, (8 · o,).
        close: Primitives of a part that may be near another part, shape (k,).
        growth: How far a span may carry both, minus infinity in lanes in which they are
            known to be apart, shape (8 · k,) [m].
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
    cells: Vector
    best: Vector
    pair: Vector
    lead: Vector
    bound: Vector
    open: LongVector
    apart: Vector
    close: LongVector
    growth: Vector


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
    for k in range(p.listed[1]):
        ball = p.parts[p.pairs[k, 1], 2]
        if p.bodies[ball] < 0:
            for r in range(1, 4):
                store(w.rows, (ball * ROW_WIDTH + r) * WIDTH, splat(p.rows[ball, r]))


@kernel
def move_bodies(first: int, p: Plan, w: Place) -> None:
    """Poses of a body and all behind it in lanes, see `forward_kinematics`."""
    T = w.T
    w.turn[0] += 1
    for body in range(first, p.parent.shape[0]):
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
            a, b = u, v * F[body, 5] + x * F[body, 9]
            d = v * F[body, 6] + x * F[body, 10]
            if F[body, 0] != 1.0:
                a = u * F[body, 0] + v * F[body, 4] + x * F[body, 8]
                b = b + u * F[body, 1]
                d = d + u * F[body, 2]
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
    if item(p.bodies, i) < 0 or item(w.stamp, i) == item(w.turn, 0):
        return
    w.stamp[i] = w.turn[0]
    kind = item(p.kinds, i)
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
    at = i * ROW_WIDTH + first
    x, y = item(p.rows, at), item(p.rows, at + step)
    z = item(p.rows, at + 2 * step)
    for r in range(3):
        at = (item(p.bodies, i) * 12 + 4 * r) * WIDTH
        value = (
            load(w.T, at) * x
            + load(w.T, at + WIDTH) * y
            + load(w.T, at + 2 * WIDTH) * z
        )
        value = value + load(w.T, at + 3 * WIDTH) * share
        store(w.rows, (i * ROW_WIDTH + first + step * r) * WIDTH, value)


@kernel(inline=False)
def widen(p: Plan, w: Place) -> None:
    """How far each span may carry each body's middle from where it is at q."""
    for body in range(p.carries.shape[0]):
        if p.carries[body] == 1:
            widen_body(body, -1, p, w)


@kernel
def widen_body(body: int, carrier: int, p: Plan, w: Place) -> None:
    """How far each span may carry a body's middle, as seen from its carriers.

    Joints are turned from q one after another, from the root on. Until a joint's turn
    comes, what lies behind it keeps its distance from its axis, and the turn carries
    it no farther than that distance times the angle. No root is taken: a distance d is
    at most (d² / c + c) / 2, where c is a usual one.

    Args:
        body: The body.
        carrier: The last of its carriers; -1 for the world.
        p: The plan.
        w: Where the spans are.
    """
    bodies = p.parent.shape[0]
    x = middle_of(body, 0, p, w)
    y = middle_of(body, 1, p, w)
    z = middle_of(body, 2, p, w)
    shift, swing, at = splat(0.0), splat(0.0), body
    slot = (body * (bodies + 1) + 1) * WIDTH
    while at != carrier:
        store(w.shift, slot + at * WIDTH, shift)
        store(w.swing, slot + at * WIDTH, swing)
        up, kind = item(p.parent, at), item(p.joint_kind, at)
        if up >= 0 and kind != FIXED:
            angle = load(w.half, item(p.q_index, at) * WIDTH)
            angle = angle * abs(item(p.gain, 2 * at))
            if kind == PRISMATIC:
                shift = shift + angle
            else:
                lever = (body * bodies + at) * 2
                squared = squared_lever(at, x, y, z, w)
                way = squared * item(p.levers, lever) + item(p.levers, lever + 1)
                shift = shift + angle * way
                swing = swing + angle
        at = up
    store(w.shift, slot + carrier * WIDTH, shift)
    store(w.swing, slot + carrier * WIDTH, swing)


@kernel
def middle_of(body: int, r: int, p: Plan, w: Place) -> Any:
    """One coordinate of a body's middle in the world [m]."""
    at = (body * 12 + 4 * r) * WIDTH
    return (
        load(w.T, at) * item(p.middles, 3 * body)
        + load(w.T, at + WIDTH) * item(p.middles, 3 * body + 1)
        + load(w.T, at + 2 * WIDTH) * item(p.middles, 3 * body + 2)
        + load(w.T, at + 3 * WIDTH)
    )


@kernel
def squared_lever(body: int, x: Any, y: Any, z: Any, w: Place) -> Any:
    """Square of the distance of points from a body's axis [m²]."""
    f = body * 12 * WIDTH
    u = x - load(w.T, f + 3 * WIDTH)
    v = y - load(w.T, f + 7 * WIDTH)
    t = z - load(w.T, f + 11 * WIDTH)
    along = (
        u * load(w.T, f + 2 * WIDTH)
        + v * load(w.T, f + 6 * WIDTH)
        + t * load(w.T, f + 10 * WIDTH)
    )
    return u * u + v * v + t * t - along * along
