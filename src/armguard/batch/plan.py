"""What a batch reads: primitives, balls round them, and the pairs of parts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ROW_WIDTH, ShapeKind
from armguard.scene.standing import Standing
from armguard.scene.tables import SceneTables
from armguard.table import IntMatrix, IntVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Kinds that have a formula in lanes against a sphere.
SIMPLE = (ShapeKind.SPHERE, ShapeKind.CAPSULE, ShapeKind.BOX, ShapeKind.HALF_SPACE)

# A bound may be wrong by less than this through rounding [m].
SLACK = 1e-9

# Into how many groups the parts of a ball are divided.
GROUPS = 4

# Kinds whose rows hold points or directions, and no frame.
CORNERS = (
    ShapeKind.SPHERE,
    ShapeKind.CAPSULE,
    ShapeKind.TRIANGLE,
    ShapeKind.HALF_SPACE,
)


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
        frames: Joint frames, turned so that each joint's axis is z, shape (b, 12).
        kinds: ShapeKind of primitives and balls, shape (k,).
        bodies: Their bodies, -1 for the world, shape (k,).
        rows: Their rows in the frames of their bodies, shape (k, 16).
        ball: Ball that encloses each primitive, shape (p,).
        hull: Row with a formula against spheres that encloses it, shape (p,).
        spread: Farthest point of each primitive, less its radius, from the middle of
            its part's ball, shape (p,) [m].
        part: Part of each primitive, -1 for none, shape (p,).
        parts: First primitive, end, ball and hull of each part; those that move come
            first, shape (t, 4).
        pairs: Two parts that are checked, the first of which moves, and one more than
            the last body that carries both, 0 for the world, shape (c, 3).
        own: First pair and end of each moving part's with moving ones, shape (m, 2).
        loose: Largest buffer of each moving part beside what does not move, minus
            infinity if it is not checked there, shape (m,) [m].
        nodes: Centre and radius of balls, each round some that follow it: what is apart
            from a ball is apart from those, whatever is rounded; the radius is minus
            infinity round objects that are not present, shape (n, 4) [m].
        links: Node that follows those in a node, and the part that a node is, -1 for
            none, shape (n, 2).
        pair_at: Pair of a moving part and another, -1 for none, shape (m, t).
        buffers: Distance that each pair must keep, shape (c,) [m].
    """

    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    frames: Matrix
    kinds: IntVector
    bodies: IntVector
    rows: Matrix
    ball: IntVector
    hull: IntVector
    spread: Vector
    part: IntVector
    parts: IntMatrix
    pairs: IntMatrix
    own: IntMatrix
    loose: Vector
    nodes: Matrix
    links: IntMatrix
    pair_at: IntMatrix
    buffers: Vector


def ball_of(kind: int, row: Floats) -> Floats:
    """Centre and radius of a ball around a primitive, shape (4,) [m]."""
    centre, radius = row[1:4], float(row[0])
    if kind == ShapeKind.CAPSULE:
        centre = (row[1:4] + row[4:7]) / 2.0
        radius += float(np.linalg.norm(row[4:7] - row[1:4])) / 2.0
    elif kind == ShapeKind.TRIANGLE:
        corners = row[1:10].reshape(3, 3)
        centre = corners.mean(axis=0)
        radius += float(np.linalg.norm(corners - centre, axis=1).max())
    elif kind == ShapeKind.BOX:
        radius += float(np.linalg.norm(row[4:7]))
    elif kind in (ShapeKind.CYLINDER, ShapeKind.CONE):
        radius += float(np.hypot(max(row[4], row[6]), row[5]))
    elif kind == ShapeKind.ELLIPSOID:
        radius += float(row[4:7].max())
    elif kind == ShapeKind.HALF_SPACE:
        radius = np.inf
    elif kind != ShapeKind.SPHERE:
        radius += float(row[6])
    return np.array([*centre, radius])


def ball_around(balls: Floats) -> Floats:
    """Centre and radius of a ball around balls, shape (4,) [m]."""
    centre = (balls[:, :3].min(axis=0) + balls[:, :3].max(axis=0)) / 2.0
    reach = np.linalg.norm(balls[:, :3] - centre, axis=1) + balls[:, 3]
    return np.array([*centre, reach.max()])


def turn_to(axis: Floats) -> Floats:
    """A rotation that turns z to a unit vector, shape (3, 3)."""
    x, y, z = axis
    if z < 0.0:
        return np.asarray(turn_to(-axis) * np.array([1.0, -1.0, -1.0]))
    v = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.asarray(np.eye(3) + v + v @ v / (1.0 + z))


def turned_row(kind: int, row: Floats, R: Floats) -> Floats:
    """A row in a frame that is turned by R."""
    row = row.copy()
    for first in (1, 4, 7) if kind in CORNERS else (1,):
        row[first : first + 3] = R.T @ row[first : first + 3]
    if kind not in CORNERS:
        row[7:16] = (R.T @ row[7:16].reshape(3, 3)).reshape(9)
    return row


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


def tree_of(
    balls: Floats, members: list[int], largest: float
) -> list[tuple[Floats, int, int]]:
    """Balls round groups of parts that do not move, each before those in it.

    Args:
        balls: Balls of all parts, shape (t, 4) [m].
        members: Parts to group.
        largest: Members of a group that gets a ball.

    Returns:
        Ball, nodes in it with itself, and part or -1, of each node.
    """
    if len(members) == 1:
        return [(balls[members[0]], 1, members[0])]
    centres = balls[members, :3]
    order = np.argsort(centres[:, np.ptp(centres, axis=0).argmax()], kind="stable")
    named = len(members) <= largest
    halves = np.array_split(np.array(members)[order], 2)
    below = len(members) / GROUPS if named else largest
    nodes = [node for half in halves for node in tree_of(balls, half.tolist(), below)]
    if not named:
        return nodes
    ball = ball_around(balls[members]) + np.array([0.0, 0.0, 0.0, SLACK])
    return [(ball, len(nodes) + 1, -1), *nodes]


def trees(
    balls: Floats, members: list[int]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """`Plan.nodes` and `Plan.links`."""
    finite = [k for k in members if np.isfinite(balls[k, 3])]
    nodes = [(balls[k], 1, k) for k in members if not np.isfinite(balls[k, 3])]
    if finite:
        nodes += tree_of(balls, finite, len(finite) / GROUPS)
    links = [(at + inside, part) for at, (_, inside, part) in enumerate(nodes)]
    return (
        np.array([ball for ball, _, _ in nodes]).reshape(-1, 4),
        np.array(links, dtype=np.int32).reshape(-1, 2),
    )


def aligned_frames(tables: SceneTables, turns: Floats) -> Floats:
    """Joint frames between bodies whose frames are turned, shape (b, 12)."""
    frames = tables.T_parent_joint.reshape(-1, 3, 4).copy()
    for body, up in enumerate(tables.parent):
        frames[body, :, :3] = frames[body, :, :3] @ turns[body]
        if up >= 0:
            frames[body] = turns[up].T @ frames[body]
    return frames.reshape(-1, 12)


def plan_of(tables: SceneTables) -> Plan:
    """The plan of a scene."""
    turns = np.array([turn_to(axis) for axis in tables.axis]).reshape(-1, 3, 3)
    turns[tables.parent < 0] = np.eye(3)
    rows, spans = Rows(tables, turns), ranges(tables)
    parts = [rows.part(*span) for span in spans]
    spread, part = np.zeros(len(tables.kinds)), np.full(len(tables.kinds), -1)
    for k, (first, end, ball, _) in enumerate(parts):
        part[first:end] = k
        for i in range(first, end):
            apart = np.linalg.norm(rows.balls[i, :3] - rows.rows[ball][1:4])
            spread[i] = apart + rows.balls[i, 3] - rows.rows[i][0]
    pairs = np.array(checked_pairs(tables, spans), dtype=np.int32).reshape(-1, 3)
    moving = sum(first < tables.moving_count for first, _ in spans)
    pair_at = np.full((moving, len(parts)), -1, dtype=np.int32)
    pair_at[pairs[:, 0], pairs[:, 1]] = np.arange(len(pairs))
    group = np.array([tables.groups[first] for first, _ in spans], dtype=int)
    buffers = tables.buffers[group[pairs[:, 0]], group[pairs[:, 1]]]
    loose = np.full(moving, -np.inf)
    static = pairs[:, 1] >= moving
    np.maximum.at(loose, pairs[static, 0], buffers[static])
    begin = np.searchsorted(pairs[:, 0], np.arange(moving))
    within = np.bincount(pairs[~static, 0], minlength=moving)
    balls = np.array([[*rows.rows[k][1:4], rows.rows[k][0]] for _, _, k, _ in parts])
    nodes, links = trees(balls, list(range(moving, len(parts))))
    return Plan(
        parent=tables.parent,
        joint_kind=tables.joint_kind,
        q_index=tables.q_index,
        gain=np.ascontiguousarray(tables.gain),
        frames=aligned_frames(tables, turns),
        kinds=np.array(rows.kinds, dtype=np.int32),
        bodies=np.array(rows.bodies, dtype=np.int32),
        rows=np.array(rows.rows, dtype=np.float64).reshape(-1, ROW_WIDTH),
        ball=np.array(rows.ball, dtype=np.int32),
        hull=np.array(rows.hull, dtype=np.int32),
        spread=spread,
        part=part.astype(np.int32),
        parts=np.array(parts, dtype=np.int32).reshape(-1, 4),
        pairs=pairs,
        own=np.column_stack((begin, begin + within)).astype(np.int32),
        loose=loose,
        nodes=nodes,
        links=links,
        pair_at=pair_at,
        buffers=buffers,
    )


def place_object(plan: Plan, item: Standing, T: Floats) -> None:
    """Place an object with its frame at T, shape (4, 4), whether present or not."""
    rows = item.rows(np.eye(4) if item.body >= 0 else T)
    if item.body >= 0:
        plan.frames[item.body] = T[:3].reshape(12)
    for i, row in zip(range(item.first, item.first + item.count), rows, strict=True):
        plan.rows[i] = row
        if plan.ball[i] != i:
            ball = ball_of(plan.kinds[i], row)
            plan.rows[plan.ball[i], :4] = ball[3], *ball[:3]
    for part in parts_of(plan, item):
        first, end, ball = plan.parts[part, :3]
        if end > first + 1:
            inner = plan.rows[plan.ball[first:end]]
            around = ball_around(inner[:, [1, 2, 3, 0]])
            plan.rows[ball, :4] = around[3], *around[:3]
        refit(plan, part)


def remove_object(plan: Plan, item: Standing) -> None:
    """Remove an object: nothing is near a ball whose radius is minus infinity."""
    for part in parts_of(plan, item):
        plan.rows[plan.parts[part, 2], 0] = -np.inf
        refit(plan, part)


def parts_of(plan: Plan, item: Standing) -> list[int]:
    """Parts of an object."""
    return sorted(set(plan.part[item.places].tolist()) - {-1})


def refit(plan: Plan, part: int) -> None:
    """Fit the balls round a part that does not move to the part's own ball."""
    found = np.flatnonzero(plan.links[:, 1] == part)
    if part < len(plan.own) or not len(found):
        return
    leaf, ball = int(found[0]), plan.rows[plan.parts[part, 2]]
    plan.nodes[leaf] = *ball[1:4], ball[0]
    above = np.flatnonzero(plan.links[:leaf, 0] > leaf)
    for node in above[::-1].tolist():
        inside, at = [], node + 1
        while at < plan.links[node, 0]:
            inside.append(at)
            at = int(plan.links[at, 0])
        balls = plan.nodes[inside]
        balls = balls[balls[:, 3] > -np.inf]
        plan.nodes[node] = 0.0, 0.0, 0.0, -np.inf
        if len(balls):
            plan.nodes[node] = ball_around(balls)
            plan.nodes[node, 3] += SLACK
