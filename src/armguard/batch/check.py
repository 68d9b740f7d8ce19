"""Least signed distances of eight configurations at once."""

from math import inf, isfinite, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.batch.gaps import has_lanes, lane_gap
from armguard.batch.lanes import (
    WIDTH,
    either,
    load,
    most,
    sincos,
    some,
    store,
)
from armguard.batch.plan import Plan
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.table import Matrix, Vector, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
TRIANGLE = int(ShapeKind.TRIANGLE)
HALF_SPACE = int(ShapeKind.HALF_SPACE)

# A lower bound may exceed the distance by less than this through rounding [m].
SLACK = 1e-9

# Places in `Scratch.settings`.
MARGIN = 0  # distances from this on are left out [m]
STRICT = 1  # 1: distances count above the pair's buffer
DROP = 2  # infinite where one pair decides a configuration, else 0
LIMIT = 3  # greatest joint position [rad or m]
SETTINGS = 4


@table
class Scratch(NamedTuple):
    """What one call writes; lanes are flat, eight numbers after each other.

    Attributes:
        settings: See MARGIN, shape (SETTINGS,).
        q: Joint positions in lanes, shape (8 · n,).
        T: Poses of the bodies in lanes, shape (8 · 12 · b,).
        rows: Rows of primitives and balls in lanes, shape (8 · 16 · k,).
        best: Least distance so far, shape (8,) [m].
        who: Its pair, i · k + j; -1 for none, shape (8,).
        bound: Lower bounds of a pair, shape (8,) [m].
        single: Rows of a pair in one configuration, and its witness, shape (3, 16).
    """

    settings: Vector
    q: Vector
    T: Vector
    rows: Vector
    best: Vector
    who: Vector
    bound: Vector
    single: Matrix


open_plan = opener(Plan)
open_scratch = opener(Scratch)


@kernel(inline=False, entry=True)
def check_rows(q: Floats, plan: Longs, scratch: Longs, found: Floats) -> None:
    """Least signed distance and its pair, of each configuration.

    Args:
        q: Joint positions, shape (rows, n) [rad or m].
        plan: Ledger of the plan.
        scratch: Ledger of the scratch, with settings.
        found: Overwritten: distance, NaN for a row that cannot be judged, and the two
            primitives, -1 for none, shape (rows, 3).
    """
    p, s = open_plan(plan), open_scratch(scratch)
    count = p.kinds.shape[0]
    spread(p, s)
    for start in range(0, q.shape[0], WIDTH):
        take_rows(q, start, s)
        move_bodies(p, s)
        place_rows(p, s)
        for k in range(p.pairs.shape[0]):
            if not some(load(s.best, 0) > -inf):
                break
            compare_parts(k, p, s)
        for lane in range(min(WIDTH, q.shape[0] - start)):
            out = found[start + lane]
            out[0], who = s.best[lane], s.who[lane]
            if who == -2.0:
                out[0] = nan
            out[1] = who // count if who >= 0.0 else -1.0
            out[2] = who - out[1] * count if who >= 0.0 else -1.0


@kernel
def spread(p: Plan, s: Scratch) -> None:
    """Write to all lanes what no joint moves."""
    for body in range(p.parent.shape[0]):
        for k in range(12):
            for lane in range(WIDTH):
                s.T[(body * 12 + k) * WIDTH + lane] = p.frames[body, k]
    for i in range(p.kinds.shape[0]):
        for k in range(ROW_WIDTH):
            for lane in range(WIDTH):
                s.rows[(i * ROW_WIDTH + k) * WIDTH + lane] = p.rows[i, k]


@kernel
def take_rows(q: Floats, start: int, s: Scratch) -> None:
    """Turn eight configurations to lanes; one that cannot be judged is left at 0."""
    for lane in range(WIDTH):
        row = start + lane
        good = row < q.shape[0]
        if good:
            for k in range(q.shape[1]):
                good = good and isfinite(q[row, k])
                good = good and abs(q[row, k]) <= s.settings[LIMIT]
        for k in range(q.shape[1]):
            s.q[k * WIDTH + lane] = q[row, k] if good else 0.0
        s.best[lane] = s.settings[MARGIN] if good else -inf
        s.who[lane] = -1.0 if good else -2.0


@kernel
def move_bodies(p: Plan, s: Scratch) -> None:
    """Poses of all bodies in lanes, see `forward_kinematics`."""
    T = s.T
    for body in range(p.parent.shape[0]):
        up, kind = p.parent[body], p.joint_kind[body]
        if up < 0:
            continue
        angle = load(s.q, p.q_index[body] * WIDTH)
        angle = angle * p.gain[body, 0] + p.gain[body, 1]
        sine, cosine = sincos(angle)
        x, y, z = p.axis[body, 0], p.axis[body, 1], p.axis[body, 2]
        rest = 1.0 - cosine
        sx, sy, sz = sine * x, sine * y, sine * z
        xx, xy, xz = rest * (x * x) + cosine, rest * (x * y), rest * (x * z)
        yy, yz, zz = rest * (y * y) + cosine, rest * (y * z), rest * (z * z) + cosine
        for r in range(3):
            above = (up * 12 + 4 * r) * WIDTH
            out = (body * 12 + 4 * r) * WIDTH
            u, v = load(T, above), load(T, above + WIDTH)
            w, o = load(T, above + 2 * WIDTH), load(T, above + 3 * WIDTH)
            F = p.frames
            a = u * F[body, 0] + v * F[body, 4] + w * F[body, 8]
            b = u * F[body, 1] + v * F[body, 5] + w * F[body, 9]
            d = u * F[body, 2] + v * F[body, 6] + w * F[body, 10]
            o = u * F[body, 3] + v * F[body, 7] + w * F[body, 11] + o
            if kind == PRISMATIC:
                o = o + angle * (a * x + b * y + d * z)
            elif kind != FIXED:
                m = a * xx + b * (xy + sz) + d * (xz - sy)
                n = a * (xy - sz) + b * yy + d * (yz + sx)
                d = a * (xz + sy) + b * (yz - sx) + d * zz
                a, b = m, n
            store(T, out, a)
            store(T, out + WIDTH, b)
            store(T, out + 2 * WIDTH, d)
            store(T, out + 3 * WIDTH, o)


@kernel
def place_rows(p: Plan, s: Scratch) -> None:
    """Rows in the world, in lanes, of all that rides on a body; see `place_row`."""
    for i in range(p.kinds.shape[0]):
        body, kind = p.bodies[i], p.kinds[i]
        if body < 0:
            continue
        place_vector(p, s, i, 1, 1, 1.0)
        if kind == CAPSULE or kind == TRIANGLE:
            place_vector(p, s, i, 4, 1, 1.0)
            if kind == TRIANGLE:
                place_vector(p, s, i, 7, 1, 1.0)
        elif kind == HALF_SPACE:
            place_vector(p, s, i, 4, 1, 0.0)
        elif kind != SPHERE:
            for k in range(3):
                place_vector(p, s, i, 7 + k, 3, 0.0)


@kernel
def place_vector(
    p: Plan, s: Scratch, i: int, first: int, step: int, share: float
) -> None:
    """Place three numbers of row i: a point, or a direction where `share` is 0."""
    x, y, z = p.rows[i, first], p.rows[i, first + step], p.rows[i, first + 2 * step]
    for r in range(3):
        at = (p.bodies[i] * 12 + 4 * r) * WIDTH
        value = (
            load(s.T, at) * x
            + load(s.T, at + WIDTH) * y
            + load(s.T, at + 2 * WIDTH) * z
        )
        value = value + load(s.T, at + 3 * WIDTH) * share
        store(s.rows, (i * ROW_WIDTH + first + step * r) * WIDTH, value)


@kernel(inline=False)
def compare_parts(k: int, p: Plan, s: Scratch) -> None:
    """Compare two parts: balls first, then their primitives."""
    a, b = p.pairs[k, 0], p.pairs[k, 1]
    ball, hull = p.parts[a, 2], p.parts[b, 3]
    buffer = p.buffers[k] * s.settings[STRICT]
    needed = lane_gap(SPHERE, ball, p.kinds[hull], hull, s.rows) - (buffer + SLACK)
    if not some(needed < load(s.best, 0)):
        return
    several = p.parts[b, 1] - p.parts[b, 0] > 1
    for i in range(p.parts[a, 0], p.parts[a, 1]):
        if several:
            ball = p.ball[i]
            needed = lane_gap(SPHERE, ball, p.kinds[hull], hull, s.rows)
            if not some(needed - (buffer + SLACK) < load(s.best, 0)):
                continue
        for j in range(p.parts[b, 0], p.parts[b, 1]):
            if p.kinds[i] <= p.kinds[j]:
                compare(i, j, buffer, p, s)
            else:
                compare(j, i, buffer, p, s)


@kernel(inline=False)
def compare(i: int, j: int, buffer: float, p: Plan, s: Scratch) -> None:
    """Compare two primitives, for kind of i <= kind of j."""
    code = float(min(i, j) * p.kinds.shape[0] + max(i, j))
    best = load(s.best, 0)
    if has_lanes(p.kinds[i], p.kinds[j]):
        gap = lane_gap(p.kinds[i], i, p.kinds[j], j, s.rows) - buffer
        nearer = gap < best
        if some(nearer):
            store(s.best, 0, either(nearer, gap - s.settings[DROP], best))
            store(s.who, 0, either(nearer, code, load(s.who, 0)))
        return
    hull_i, hull_j = p.hull[i], p.hull[j]
    bound = most(
        lane_gap(SPHERE, p.ball[i], p.kinds[hull_j], hull_j, s.rows),
        lane_gap(SPHERE, p.ball[j], p.kinds[hull_i], hull_i, s.rows),
    ) - (buffer + SLACK)
    if not some(bound < best):
        return
    store(s.bound, 0, bound)
    for lane in range(WIDTH):
        if s.bound[lane] < s.best[lane]:
            gap_here = gap_in_lane(i, j, lane, p, s) - buffer
            if not gap_here >= s.best[lane]:
                s.best[lane] = gap_here - s.settings[DROP]
                s.who[lane] = code


@kernel
def gap_in_lane(i: int, j: int, lane: int, p: Plan, s: Scratch) -> float:
    """Signed distance of two primitives in one configuration [m]."""
    for k in range(ROW_WIDTH):
        s.single[0, k] = s.rows[(i * ROW_WIDTH + k) * WIDTH + lane]
        s.single[1, k] = s.rows[(j * ROW_WIDTH + k) * WIDTH + lane]
    measure(p.kinds[i], s.single[0], p.kinds[j], s.single[1], s.single[2])
    return float(s.single[2, 0])
