"""Surfaces of links and objects as a sensor sees them, and where its rays meet them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import shape_row
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
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
