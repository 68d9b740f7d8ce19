"""What a batch reads: primitives, balls round them, and the pairs of parts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.batch.balls import ball_around, ball_of, trees
from armguard.batch.frames import (
    levers_of,
    points_at,
    sampled_poses,
    turned_bodies,
    turned_row,
)
from armguard.batch.grids import COARSE, joint_grid, region_of, ways_of
from armguard.geometry.shapes import ROW_WIDTH, ShapeKind
from armguard.lanes import WIDTH
from armguard.scene.tables import SceneTables
from armguard.table import ByteVector, IntMatrix, IntVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Kinds that have a formula in lanes against a sphere.
SIMPLE = (ShapeKind.SPHERE, ShapeKind.CAPSULE, ShapeKind.BOX, ShapeKind.HALF_SPACE)

# Pairs of parts with what does not move that wait to be compared, at most.
MOST_OPEN = 64

# Most parts that some moving parts are not checked with, and that are in no group.
MOST_PARTIAL = 16


@table
class Plan(NamedTuple):
    """Scene tables in the order in which a batch reads them; see `SceneTables`.

    A part is what rides on one body in one rule group, or one static primitive. Balls
    follow the primitives as rows of their own.

    Attributes:
        parent: Parent body, shape (b,).
        joint_kind: Kinds of the joints, shape (b,).
        q_index: Places in q, shape (b,).
        gain: Multipliers and offsets, shape (b, 2).
        frames: Joint frames, turned so that each joint's axis is z; see
            `turned_bodies`, shape (b, 12).
        carries: 1 for bodies that carry moving parts, shape (b,).
        middles: Middle of a ball round the primitives of each body, in its frame,
            shape (b, 3) [m].
        levers: Of the usual distance c of each body's middle from the axis of each
            joint: 1 / 2c and c / 2, shape (b, 2 · b) [1/m, m].
        kinds: ShapeKind of primitives and balls, shape (k,).
        bodies: Their bodies, -1 for the world, shape (k,).
        rows: Their rows in the frames of their bodies, shape (k, 16).
        ball: Ball that encloses each primitive, shape (p,).
        hull: Row with a formula against spheres that encloses it, shape (p,).
        spread: Farthest point of each moving primitive, less its radius, from the
            middle of its body, shape (p,) [m].
        part: Part of each primitive, -1 for none, shape (p,).
        parts: First primitive, end, ball and hull of each part; those that move come
            first, shape (t, 4).
        sways: Distance of the middle of each moving part's ball from its body's middle,
            and the largest spread of its primitives, shape (m, 2) [m].
        pairs: Two parts that are checked, the first of which moves, and one more than
            the last body that carries both, 0 for the world, shape (c, 3).
        listed: How many of the first pairs have cells, and how many are compared one
            by one: the others are found by nodes, shape (2,).
        ends: Where the lanes of those pairs are: in `Place.shift` those of both bodies,
            and in `Place.rows` those of the middles of both balls, shape (l, 4).
        loose: Largest buffer of each moving part beside what does not move, minus
            infinity if it is not checked there, shape (m,) [m].
        nodes: Centre and radius of balls, each round some that follow it: what is apart
            from a ball is apart from those, whatever is rounded; the radius is minus
            infinity round objects that are not present, shape (n, 4) [m].
        links: Node that follows those in a node, and the part that a node is, -1 for
            none, shape (n, 2).
        pair_at: Pair of a moving part and another, -1 for none, shape (m, t).
        buffers: Distance that each pair must keep, shape (c,) [m].
        grid: Lower end of the first cell of each joint, and cells in a unit, (n, 2).
        ways: First of the cells of each pair that has some, how many joints lie between
            its parts, and these, shape (w, 5).
        gaps: What the gap of each pair's primitives is not below in each of its cells,
            as in `batch.cells`.
        region: The same as `grid` for the axes of the world, shape (3, 2).
        room: What the distance of each cell of the world from all that does not move is
            not below, as in `batch.cells`, shape (COARSE³,).
        exact_of: First exact shape of the link of each primitive, and how many there
            are; (-1, 0) where the primitive is exact itself, shape (p, 2).
        exact_kinds: ShapeKind of each exact shape, shape (e,).
        exact_rows: Their rows in the frame of their body, or in the world, (e, 16).
    """

    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    frames: Matrix
    carries: IntVector
    middles: Matrix
    levers: Matrix
    kinds: IntVector
    bodies: IntVector
    rows: Matrix
    ball: IntVector
    hull: IntVector
    spread: Vector
    part: IntVector
    parts: IntMatrix
    sways: Matrix
    pairs: IntMatrix
    listed: IntVector
    ends: IntMatrix
    loose: Vector
    nodes: Matrix
    links: IntMatrix
    pair_at: IntMatrix
    buffers: Vector
    grid: Matrix
    ways: IntMatrix
    gaps: ByteVector
    region: Matrix
    room: ByteVector
    exact_of: IntMatrix
    exact_kinds: IntVector
    exact_rows: Matrix


class Rows:
    """Rows of primitives, with those of balls added behind them.

    Args:
        tables: The scene.
        turns: Rotation of each body's frame, shape (b, 3, 3).
    """

    def __init__(self, tables: SceneTables, turns: Floats) -> None:
        self.kinds = tables.kinds.tolist()
        self.bodies = tables.bodies.tolist()
        self.rows = [
            turned_row(kind, row, turns[body]) if body >= 0 else row
            for kind, body, row in zip(
                self.kinds, self.bodies, tables.local_rows, strict=True
            )
        ]
        count = len(self.kinds)
        self.balls = np.array(
            [ball_of(self.kinds[i], self.rows[i]) for i in range(count)]
        ).reshape(-1, 4)
        spheres = [kind == ShapeKind.SPHERE for kind in self.kinds]
        self.ball = [
            i if spheres[i] else self.add(self.balls[i], self.bodies[i])
            for i in range(count)
        ]
        self.hull = [
            i if self.kinds[i] in SIMPLE else self.ball[i] for i in range(count)
        ]

    def add(self, ball: Floats, body: int) -> int:
        """Add a ball's row, and return its number."""
        row = np.zeros(ROW_WIDTH)
        row[0], row[1:4] = ball[3], ball[:3]
        self.kinds.append(int(ShapeKind.SPHERE))
        self.bodies.append(body)
        self.rows.append(row)
        return len(self.kinds) - 1

    def part(self, first: int, end: int) -> tuple[int, int, int, int]:
        """A row of `Plan.parts`."""
        if end == first + 1:
            return first, end, self.ball[first], self.hull[first]
        ball = self.add(ball_around(self.balls[first:end]), self.bodies[first])
        return first, end, ball, ball

    def middles(self, spans: list[tuple[int, int]], count: int) -> Floats:
        """`Plan.middles`, for the primitives of parts that move and so many bodies."""
        middles = np.zeros((count, 3))
        places = [i for span in spans for i in range(*span)]
        for body in {self.bodies[i] for i in places}:
            balls = self.balls[[i for i in places if self.bodies[i] == body]]
            middles[body] = ball_around(balls)[:3]
        return middles

    def sways(
        self, spans: list[tuple[int, int]], balls: Floats, middles: Floats
    ) -> tuple[Floats, Floats]:
        """`Plan.spread` and `Plan.sways` of parts that move, with these balls."""
        spread, sways = np.zeros(len(self.balls)), np.zeros((len(spans), 2))
        for k, (first, end) in enumerate(spans):
            middle = middles[self.bodies[first]]
            for i in range(first, end):
                apart = np.linalg.norm(self.balls[i, :3] - middle)
                spread[i] = apart + self.balls[i, 3] - self.rows[i][0]
            sways[k] = np.linalg.norm(balls[k, :3] - middle), spread[first:end].max()
        return spread, sways


def turned_exact_rows(tables: SceneTables, turns: Floats) -> Floats:
    """`Plan.exact_rows`, for turned frames of bodies, shape (b, 3, 3)."""
    exact = tables.exact
    rows = exact.rows.copy()
    # Primitives of one link have the same exact shapes.
    for (first, count), body in {
        *zip(
            map(tuple, exact.of_primitive.tolist()), tables.bodies.tolist(), strict=True
        )
    }:
        for e in range(first, first + count) if body >= 0 else ():
            rows[e] = turned_row(exact.kinds[e], exact.rows[e], turns[body])
    return rows


def ranges(tables: SceneTables) -> list[tuple[int, int]]:
    """First primitive and end of each part; boxes that stand for a gripper are none."""
    coarse = {part.coarse for part in tables.holds.grippers}
    count, moving = len(tables.kinds), tables.moving_count
    key = [
        (tables.bodies[i], tables.groups[i], i if i >= moving else -1)
        for i in range(count)
    ]
    starts = [i for i in range(count) if i == 0 or key[i] != key[i - 1]]
    ends = [*starts[1:], count]
    return [
        (first, end)
        for first, end in zip(starts, ends, strict=False)
        if tables.body_names[first] not in coarse
    ]


def carriers(parent: Ints, body: int) -> list[int]:
    """A body, its parent and so on to the root, and -1 for the world."""
    found = [body]
    while found[-1] >= 0:
        found.append(int(parent[found[-1]]))
    return found


def checked_pairs(
    tables: SceneTables, spans: list[tuple[int, int]]
) -> list[tuple[int, int, int]]:
    """Rows of `Plan.pairs`."""
    group = [int(tables.groups[first]) for first, _ in spans]
    above = [carriers(tables.parent, int(tables.bodies[first])) for first, _ in spans]
    return [
        (a, b, 1 + next(body for body in above[a] if body in above[b]))
        for a in range(len(spans))
        if spans[a][0] < tables.moving_count
        for b in range(a + 1, len(spans))
        if tables.checked[group[a], group[b]]
    ]


def plan_of(tables: SceneTables) -> Plan:
    """The plan of a scene."""
    turns, frames, gain = turned_bodies(tables)
    rows, spans = Rows(tables, turns), ranges(tables)
    parts = [rows.part(*span) for span in spans]
    starts = [first for first, _ in spans]
    moving = sum(first < tables.moving_count for first in starts)
    balls = np.array([[*rows.rows[k][1:4], rows.rows[k][0]] for _, _, k, _ in parts])
    middles = rows.middles(spans[:moving], len(tables.parent))
    spread, sways = rows.sways(spans[:moving], balls, middles)
    bodies = np.array([tables.bodies[first] for first in starts], dtype=np.int32)
    pairs = np.array(checked_pairs(tables, spans), dtype=np.int32).reshape(-1, 3)
    pairs, with_cells, listed = ordered_pairs(
        tables, pairs, bodies, (moving, len(parts))
    )
    pair_at = np.full((moving, len(parts)), -1, dtype=np.int32)
    pair_at[pairs[:, 0], pairs[:, 1]] = np.arange(len(pairs))
    group = np.array([tables.groups[first] for first in starts], dtype=int)
    buffers = tables.buffers[group[pairs[:, 0]], group[pairs[:, 1]]]
    apart = {*range(moving, len(parts))} - {*pairs[:listed, 1].tolist()}
    nodes, links = trees(balls, sorted(apart))
    carries = np.isin(np.arange(len(tables.parent)), bodies[:moving])
    poses = sampled_poses(tables, frames, gain)
    levers = levers_of(poses, middles)
    ways, cells = ways_of(tables, pairs[:with_cells], bodies)
    return Plan(
        parent=tables.parent,
        joint_kind=tables.joint_kind,
        q_index=tables.q_index,
        gain=gain,
        frames=frames,
        carries=carries.astype(np.int32),
        middles=middles,
        levers=np.stack((0.5 / levers, 0.5 * levers), axis=2).reshape(len(levers), -1),
        kinds=np.array(rows.kinds, dtype=np.int32),
        bodies=np.array(rows.bodies, dtype=np.int32),
        rows=np.array(rows.rows, dtype=np.float64).reshape(-1, ROW_WIDTH),
        ball=np.array(rows.ball, dtype=np.int32),
        hull=np.array(rows.hull, dtype=np.int32),
        spread=spread,
        part=part_numbers(spans, len(tables.kinds)),
        parts=np.array(parts, dtype=np.int32).reshape(-1, 4),
        sways=sways,
        pairs=pairs,
        listed=np.array([with_cells, listed], dtype=np.int32),
        ends=ends_of(pairs[:listed], np.array(parts)[:, 2], bodies, len(tables.parent)),
        loose=largest_static_buffers(pairs, buffers, moving),
        nodes=nodes,
        links=links,
        pair_at=pair_at,
        buffers=buffers,
        grid=joint_grid(tables),
        ways=ways,
        gaps=np.zeros(cells, dtype=np.uint8),
        region=region_of(points_at(poses, middles)[:, carries].reshape(-1, 3)),
        room=np.zeros(COARSE**3, dtype=np.uint8),
        exact_of=tables.exact.of_primitive,
        exact_kinds=tables.exact.kinds,
        exact_rows=turned_exact_rows(tables, turns),
    )


def part_numbers(spans: list[tuple[int, int]], count: int) -> Ints:
    """Part of each of so many primitives, -1 for none, shape (count,)."""
    part = np.full(count, -1, dtype=np.int32)
    for k, span in enumerate(spans):
        part[slice(*span)] = k
    return part


def largest_static_buffers(pairs: Ints, buffers: Floats, moving: int) -> Floats:
    """Largest buffer to a static part, of each moving part; -inf without any [m]."""
    largest = np.full(moving, -np.inf)
    static = pairs[:, 1] >= moving
    np.maximum.at(largest, pairs[static, 0], buffers[static])
    return largest


def ordered_pairs(
    tables: SceneTables, pairs: Ints, bodies: Ints, shape: tuple[int, int]
) -> tuple[Ints, int, int]:
    """`Plan.pairs` in their order, and `Plan.listed`.

    Listed are the pairs of parts that move, and those with the few that some moving
    parts are not checked with.

    Args:
        tables: The scene.
        pairs: The pairs, shape (c, 3).
        bodies: Body of each part, shape (t,).
        shape: How many parts move, and how many there are.
    """
    moving, count = shape
    checked = np.bincount(pairs[:, 1], minlength=count)[moving:]
    partial = moving + np.flatnonzero((checked > 0) & (checked < moving))
    listed = pairs[:, 1] < moving
    if len(partial) <= MOST_PARTIAL:
        listed |= np.isin(pairs[:, 1], partial)
    with_cells = ways_of(tables, pairs, bodies)[0][:, 0] >= 0
    order = np.argsort(2 - listed - (listed & with_cells), kind="stable")
    return pairs[order], int((listed & with_cells).sum()), int(listed.sum())


def ends_of(pairs: Ints, balls: Ints, bodies: Ints, count: int) -> Ints:
    """`Plan.ends`, for the balls and bodies of all parts, and so many bodies."""
    a, b, slot = pairs.T
    carrier, other = bodies[a], bodies[b]
    # A body's middle stays where it is, as seen from the body itself.
    still = carrier * (count + 1) + 1 + carrier
    first, second = carrier * (count + 1) + slot, other * (count + 1) + slot
    ends = [first, np.where(other < 0, still, second)]
    ends += [balls[k] * ROW_WIDTH + 1 for k in (a, b)]
    return np.ascontiguousarray(WIDTH * np.column_stack(ends), dtype=np.int32)


def open_of(plan: Plan) -> int:
    """Room for pairs of parts that wait to be compared."""
    return len(plan.ends) + len(plan.loose) + MOST_OPEN
