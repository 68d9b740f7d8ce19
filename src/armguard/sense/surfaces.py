"""Surfaces of links and objects as a sensor sees them, and where its rays meet them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import shape_row
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.sensors import SceneSensor
from armguard.sense.alignment import rotation
from armguard.sense.ranging import cast, nearest, place_rows
from armguard.sense.world import balls_about, points_at

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Least cosine of the angle between a ray and the normal where it meets a surface.
GRAZING = 0.2

# How far from a surface the search along a ray may end [m].
NEAR = 0.01


class Placed(NamedTuple):
    """Surfaces at joint positions.

    Attributes:
        T_world: Poses of the bodies, shape (b, 12).
        rows: Rows of the shapes in the world, shape (p, 16).
        balls: Middle and radius of a ball about each, shape (p, 4) [m].
    """

    T_world: Floats
    rows: Floats
    balls: Floats


class Met(NamedTuple):
    """Where rays meet surfaces.

    Attributes:
        way: Distance along each ray, infinite without a surface, shape (n,) [m].
        which: The shape, -1 for none, shape (n,).
        normal: Unit normal of the surface there, shape (n, 3).
    """

    way: Floats
    which: Ints
    normal: Floats


class Surfaces:
    """Exact shapes of links where a scene has them, else their primitives; objects.

    Args:
        scene: The scene, with objects where it has them.
    """

    def __init__(self, scene: Scene) -> None:
        self.tables = tables = compile_scene(scene)
        found = []
        for link, frame in tables.links.items():
            robot, name = link.split("/", 1)
            fit = scene.robots[robot].fits.get(name)
            for placed in (fit.exact or fit.shapes) if fit is not None else ():
                found.append((placed, frame.body, frame.T_body_link))
        for item in scene.objects.values():
            if not item.present:
                continue
            body, T = -1, item.pose.matrix()
            if item.attached_to is not None:
                frame = tables.links[item.attached_to]
                body, T = frame.body, frame.T_body_link @ T
            found += [(placed, body, T) for placed in item.shapes]
        # Rows of hulls have the addresses of their vertices, so their shapes are kept.
        self._shapes = [placed.shape for placed, _, _ in found]
        self._kinds = np.array([int(one.kind) for one in self._shapes], dtype=np.int32)
        self._bodies = np.array([body for _, body, _ in found], dtype=np.int32)
        self._local = np.array(
            [
                shape_row(placed.shape, T @ placed.pose.matrix())
                for placed, _, T in found
            ]
        )
        self._balls = balls_about(self._kinds, self._local)

    def at(self, q: Floats) -> Placed:
        """The surfaces at joint positions [rad or m]."""
        t, T = self.tables, np.zeros((len(self.tables.parent), 12))
        forward_kinematics(
            q, t.parent, t.joint_kind, t.q_index, t.gain, t.T_parent_joint, t.axis, T
        )
        rows, balls = np.empty_like(self._local), self._balls.copy()
        place_rows(self._kinds, self._bodies, self._local, T, rows)
        moved = np.flatnonzero(self._bodies >= 0)
        balls[moved, :3] = points_at(T[self._bodies[moved]], self._balls[moved, :3])
        return Placed(T, rows, balls)

    def meet(self, placed: Placed, origin: Floats, ways: Floats, reach: float) -> Met:
        """Where rays meet the surfaces.

        Args:
            placed: The surfaces.
            origin: Where the rays begin, shape (3,) [m].
            ways: Their directions, unit vectors, shape (n, 3).
            reach: Distance up to which they are followed [m].
        """
        _, rows, balls = placed
        out, near = np.zeros((len(ways), 2)), np.zeros((len(ways), 4))
        cast(origin, ways, self._kinds, rows, balls, reach, out)
        ends = origin + np.where(np.isfinite(out[:, :1]), out[:, :1], 0.0) * ways
        nearest(ends, self._kinds, rows, balls, NEAR, near)
        # The search ends before the surface, so the rest is added.
        normal = np.where(np.isfinite(near[:, 1:]), near[:, 1:], 0.0)
        facing = np.maximum(-(normal * ways).sum(axis=1), GRAZING)
        rest = np.where(np.isfinite(near[:, 0]), near[:, 0] / facing, 0.0)
        return Met(out[:, 0] + rest, out[:, 1].astype(np.int32), normal)


class Expected(NamedTuple):
    """Distances that are expected of a frame, with their derivatives.

    Attributes:
        way: The distances along the axis of the sensor, or along rays of points,
            infinite without a surface, shape (z,) [m].
        whole: Whether all rays of the zone meet one surface, and none only grazes it,
            shape (z,).
        spread: Farthest less nearest of its rays, shape (z,) [m].
        rows: Derivatives by shift and turn of the entry, shape (z, 6).
    """

    way: Floats
    whole: NDArray[np.bool_]
    spread: Floats
    rows: Floats


def expected(
    surfaces: Surfaces, sensor: SceneSensor, rays: Floats, q: Floats, x: Floats
) -> Expected:
    """Distances of rays of a sensor.

    Args:
        surfaces: What it sees.
        sensor: The sensor.
        rays: Rays of each zone, unit vectors, shape (z, r, 3).
        q: Joint positions [rad or m].
        x: Shift [m] and turn [rad] of its entry, shape (6,) or more.
    """
    placed = surfaces.at(q)
    base = np.eye(4)
    if sensor.on is not None:
        frame = surfaces.tables.links[sensor.on]
        base[:3] = placed.T_world[frame.body].reshape(3, 4)
        base = base @ frame.T_body_link
    entry, X = base @ sensor.mount.matrix(), np.eye(4)
    X[:3, :3], X[:3, 3] = rotation(x[3:6]), x[:3]
    inner = np.linalg.inv(sensor.mount.matrix()) @ sensor.pose.matrix()
    T = entry @ X @ inner
    zones, count, _ = rays.shape
    ways = rays.reshape(-1, 3) @ T[:3, :3].T
    met = surfaces.meet(placed, T[:3, 3], ways, 2.0 * sensor.range[1])
    along = rays[:, :, 2] if sensor.form != "points" else np.ones(rays.shape[:2])
    way = met.way.reshape(zones, count) * along
    which = met.which.reshape(zones, count)
    whole = (which == which[:, :1]).all(axis=1) & (which[:, 0] >= 0)
    # A zone has the distance at which its share is filled.
    order = np.argsort(way, axis=1)
    place = max(int(np.ceil(sensor.fill * count)), 1) - 1
    picked = order[:, place] + count * np.arange(zones)
    normal, there = met.normal[picked], ways[picked]
    facing = (normal * there).sum(axis=1)
    whole &= facing < -GRAZING
    facing = np.minimum(facing, -GRAZING)
    far = np.where(np.isfinite(met.way[picked]), met.way[picked], 0.0)
    # By a turn about the entry the origin of a sensor moves as well.
    turned = T[:3, 3] + far[:, None] * there - entry[:3, 3] - entry[:3, :3] @ x[:3]
    scale = -along.reshape(-1)[picked] / facing
    rows = np.hstack([normal, np.cross(turned, normal)]) * scale[:, None]
    with np.errstate(invalid="ignore"):
        spread = np.where(whole, way.max(axis=1) - way.min(axis=1), np.inf)
    frames = np.kron(np.eye(2), entry[:3, :3])
    return Expected(way.reshape(-1)[picked], whole, spread, rows @ frames)
