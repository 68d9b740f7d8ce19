"""Links and modelled objects of a scene at a time, each with the error of its place."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.bounds import row_bounds
from armguard.guard.monitor import Monitor
from armguard.index.octree_state import ABSENT
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.sensing import SceneSensing
from armguard.sense.history import JointHistory, Positions
from armguard.sense.placing import spread, turn_of
from armguard.sense.ranging import place_rows

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]

# Ball about a primitive that is absent: it is near to nothing.
NOWHERE = np.array([1e9, 1e9, 1e9, -1.0])


class Placed(NamedTuple):
    """Primitives at a time.

    Attributes:
        T: Poses of the bodies at the time, and at both ends of the time in question,
            shape (3, b, 12).
        error: How far off each joint position may be, shape (n,) [rad or m].
        rows: Rows of the primitives in the world, shape (p, 16).
        balls: Middle and radius of a ball about each, and how far each primitive may be
            from its place, shape (p, 5) [m].
    """

    T: Floats
    error: Floats
    rows: Floats
    balls: Floats

    @property
    def shifts(self) -> Floats:
        """How far each primitive may be from its place, shape (p,) [m]."""
        return self.balls[:, 4]


class World:
    """Primitives of a scene, placed by joint positions.

    Attributes:
        tables: The compiled scene; that of the guard, if there is one.
        kinds: ShapeKind of each modelled primitive, shape (p,).
        model_errors: How far each may reach beyond its surface, shape (p,) [m].
        static: Rows of the primitives that no joint moves, in the order of the tables.
        object_names: Object of each primitive, "" for links, shape (p,).

    Args:
        scene: The scene.
        guard: A guard of it.
    """

    def __init__(self, scene: Scene, guard: Monitor | None = None) -> None:
        tables = compile_scene(scene) if guard is None else guard.tables
        self.tables, self._moving = tables, tables.moving_count
        # Behind the modelled primitives a guard has slots for sensed cells.
        self._count = count = tables.modelled
        self.kinds, self._bodies = tables.kinds[:count], tables.bodies[:count]
        self.model_errors = tables.model_errors[:count]
        self.static = tables.local_rows[self._moving : count].copy()
        self._balls = balls_about(self.kinds, tables.local_rows[:count])
        self._local = tables.local_rows[:count].copy()
        joints = np.stack([tables.joint_kind, tables.q_index], axis=1)
        self._joints = joints.astype(np.int32)
        self.object_names = np.array(
            ["" if "/" in name else name for name in tables.body_names[:count]]
        )
        for item in tables.standing.values():
            if not item.present and item.body < 0:
                self._balls[item.places] = NOWHERE

    def joint_figures(self) -> tuple[Floats, Floats]:
        """Error of measured positions, and greatest acceleration, each of shape (n,).

        Of robots without stopping figures they are 0.
        """
        error, acceleration = np.zeros((2, len(self.tables.q_names)))
        for part in self.tables.robots:
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            if part.stopping is not None:
                error[own] = part.stopping.position_error
                hardest = part.stopping.deceleration_most
                hardest = np.where(np.isfinite(hardest), hardest, 0.0)
                acceleration[own] = np.maximum(part.stopping.acceleration, hardest)
        return error, acceleration

    def follow(self, guard: Monitor) -> bool:
        """Take over where a guard has static objects; whether one has moved."""
        rows = guard.index.world.rows[self._moving : self._count]
        there = guard.index.state.residency["status"][self._moving : self._count]
        absent = there == ABSENT
        same = np.array_equal(rows, self.static, equal_nan=True)
        if same and np.array_equal(absent, self._balls[self._moving :, 3] < 0.0):
            return False
        self.static = rows.copy()
        self._local[self._moving :] = rows
        kinds = self.kinds[self._moving :]
        self._balls[self._moving :] = balls_about(kinds, rows)
        self._balls[self._moving :][absent] = NOWHERE
        return True

    @property
    def own(self) -> NDArray[np.bool_]:
        """Which primitives robots move, shape (p,): links and held objects."""
        tables = self.tables
        own = np.zeros(self._count, dtype=np.bool_)
        bodies = tables.bodies[: tables.moving_count]
        # A body that no robot holds has no parent, and it is no root of a robot.
        own[: tables.moving_count] = tables.parent[bodies] >= 0
        return own

    def at(self, history: JointHistory, stamp: float, jitter: float) -> Placed | None:
        """Primitives at a time; None if the joint positions of it are not known.

        Args:
            history: The joint positions.
            stamp: The time [s].
            jitter: How far off it may be [s].
        """
        middle = history.at(stamp)
        if middle is None:
            return None
        ways = (-jitter, jitter) if jitter > 0.0 else ()
        found = [history.at(stamp + way) or middle for way in ways]
        first, last = found or (middle, middle)
        return self._placed(middle, first, last)

    def _placed(self, middle: Positions, first: Positions, last: Positions) -> Placed:
        T = np.zeros((3, len(self.tables.parent), 12))
        for k, positions in enumerate((middle, first, last)):
            T[k] = self.poses(positions.q)
        error = np.maximum(np.maximum(first.error, last.error), middle.error)
        # What a robot holds rides on it since the last frame.
        self._local[: self._moving] = self.tables.local_rows[: self._moving]
        rows = np.empty_like(self._local)
        place_rows(self.kinds, self._bodies, self._local, T[0], rows)
        balls = np.zeros((len(rows), 5))
        placed = Placed(T, error, rows, balls)
        moving = slice(0, self._moving)
        balls[:, :4] = self._balls
        balls[moving] = self.spread(placed, self._bodies[moving], self._balls[moving])
        return placed

    def poses(self, q: Floats) -> Floats:
        """Poses of all bodies, shape (b, 12)."""
        t, out = self.tables, np.zeros((len(self.tables.parent), 12))
        forward_kinematics(
            q, t.parent, t.joint_kind, t.q_index, t.gain, t.T_parent_joint, t.axis, out
        )
        return out

    def spread(self, placed: Placed, bodies: Ints, balls: Floats) -> Floats:
        """Balls on bodies in the world, and how far each may be from there.

        Args:
            placed: The bodies.
            bodies: Body of each, shape (k,).
            balls: Middle in the body and radius of each, shape (k, 4) [m].

        Returns:
            Middle, radius and that way, shape (k, 5) [m].
        """
        t, out = self.tables, np.zeros((len(bodies), 5))
        T, error = placed.T, placed.error
        spread(bodies, balls, T, error, t.parent, self._joints, t.gain, out)
        return out

    def turn(self, placed: Placed, body: int) -> float:
        """By what angle a body may be turned against its pose [rad]."""
        t, T, error = self.tables, placed.T, placed.error
        return float(turn_of(body, T, error, t.parent, self._joints, t.gain))


def points_at(T: Floats, points: Floats) -> Floats:
    """Points in frames as points of the world.

    Args:
        T: The frames, shape (k, 12).
        points: A point in each, shape (k, 3) [m].
    """
    frames = T.reshape(-1, 3, 4)
    turned = np.einsum("kij,kj->ki", frames[:, :, :3], points)
    return np.asarray(turned + frames[:, :, 3])


def balls_about(kinds: Ints, rows: Floats) -> Floats:
    """Middle and radius of a ball about each of some primitives, shape (k, 4) [m]."""
    balls, box = np.zeros((len(kinds), 4)), np.zeros(6)
    for kind, row, ball in zip(kinds.tolist(), rows, balls, strict=True):
        row_bounds(kind, row, 0.0, box)
        middle = 0.5 * (box[:3] + box[3:])
        ball[:] = *row[1:4], np.inf
        if np.isfinite(box).all():
            ball[:] = *middle, np.linalg.norm(box[3:] - middle)
    return balls


def sensed_space(scene: Scene) -> SceneSensing:
    """The sensed space of a scene with sensors.

    Raises:
        SceneError: It has none, or no sensors.
    """
    if not scene.sensors:
        raise SceneError(
            "the scene has no sensors; declare some, as in `sensors: {top: {kind: "
            "depth, focal: 615, at: {xyz: [0.4, 0, 1.5], rpy: [3.14, 0, 0]}}}`"
        )
    if scene.sensing is None:
        raise SceneError(
            "the scene has sensors and does not declare the space that they see; add "
            "`sensing: {region: {centre: [0, 0, 0.5]}, unknown: still, intruder: "
            "{speed: 1.6, size: 0.05}}`, see docs/sense.md"
        )
    return scene.sensing
