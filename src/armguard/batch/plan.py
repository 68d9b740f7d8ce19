"""What a batch reads: primitives, balls round them, and the pairs of parts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ROW_WIDTH, ShapeKind
from armguard.scene.tables import SceneTables
from armguard.table import IntMatrix, IntVector, Matrix, Vector, table

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Kinds that have a formula in lanes against a sphere.
SIMPLE = (ShapeKind.SPHERE, ShapeKind.CAPSULE, ShapeKind.BOX, ShapeKind.HALF_SPACE)


@table
class Plan(NamedTuple):
    """Scene tables in the order in which a batch reads them; see `SceneTables`.

    A part is what rides on one body in one rule group, or one primitive that stands
    still. Balls follow the primitives as rows of their own.

    Attributes:
        parent: Parent body, shape (b,).
        joint_kind: Kinds of the joints, shape (b,).
        q_index: Places in q, shape (b,).
        gain: Multipliers and offsets, shape (b, 2).
        frames: Joint frames, shape (b, 12).
        axis: Joint axes, shape (b, 3).
        kinds: ShapeKind of primitives and balls, shape (k,).
        bodies: Their bodies, -1 for the world, shape (k,).
        rows: Their rows in the frames of their bodies, shape (k, 16).
        ball: Ball that encloses each primitive, shape (p,).
        hull: Row with a formula against spheres that encloses it, shape (p,).
        parts: First primitive, end, ball and hull of each part, shape (t, 4).
        pairs: Two parts that are checked, shape (c, 2).
        buffers: Distance that each pair must keep, shape (c,) [m].
    """

    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    frames: Matrix
    axis: Matrix
    kinds: IntVector
    bodies: IntVector
    rows: Matrix
    ball: IntVector
    hull: IntVector
    parts: IntMatrix
    pairs: IntMatrix
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


class Rows:
    """Rows of primitives, with those of balls added behind them.

    Args:
        tables: The scene.
    """

    def __init__(self, tables: SceneTables) -> None:
        self.kinds = tables.kinds.tolist()
        self.bodies = tables.bodies.tolist()
        self.rows = list(tables.local_rows)
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


def plan_of(tables: SceneTables) -> Plan:
    """The plan of a scene; boxes that stand for a gripper are left out of it."""
    rows = Rows(tables)
    coarse = {part.coarse for part in tables.holds.grippers}
    count, moving = len(tables.kinds), tables.moving_count
    key = [
        (tables.bodies[i], tables.groups[i], i if i >= moving else -1)
        for i in range(count)
    ]
    starts = [i for i in range(count) if i == 0 or key[i] != key[i - 1]]
    ends = [*starts[1:], count]
    spans = [
        (first, end)
        for first, end in zip(starts, ends, strict=False)
        if tables.body_names[first] not in coarse
    ]
    parts = [rows.part(*span) for span in spans]
    group = [int(tables.groups[first]) for first, _ in spans]
    pairs = [
        (a, b)
        for a in range(len(parts))
        for b in range(a + 1, len(parts))
        if spans[a][0] < moving and tables.checked[group[a], group[b]]
    ]
    return Plan(
        parent=tables.parent,
        joint_kind=tables.joint_kind,
        q_index=tables.q_index,
        gain=np.ascontiguousarray(tables.gain),
        frames=np.ascontiguousarray(tables.T_parent_joint),
        axis=np.ascontiguousarray(tables.axis),
        kinds=np.array(rows.kinds, dtype=np.int32),
        bodies=np.array(rows.bodies, dtype=np.int32),
        rows=np.array(rows.rows, dtype=np.float64).reshape(-1, ROW_WIDTH),
        ball=np.array(rows.ball, dtype=np.int32),
        hull=np.array(rows.hull, dtype=np.int32),
        parts=np.array(parts, dtype=np.int32).reshape(-1, 4),
        pairs=np.array(pairs, dtype=np.int32).reshape(-1, 2),
        buffers=np.array([tables.buffers[group[a], group[b]] for a, b in pairs]),
    )
