"""The peer: OctoMap and a distance threshold at 10 Hz, as MoveIt Servo has them.

Points of both cameras that are on the robots, or on objects of the scene, are left out;
others go into the tree. Ten times a second the distance of each arm to the occupied
voxels is computed. Below a threshold the arm's velocities are scaled by an exponential,
to a thousandth in a contact. Unknown space is free. Contacts with objects of the scene
are not this gate's task.
"""

from importlib import import_module
from math import exp, inf, log
from types import SimpleNamespace
from typing import Any

import numpy as np

from armguard.respond import Action, Blocked
from armguard.scene.compile import compile_scene
from armguard.sense.history import JointHistory
from armguard.sense.ranging import nearest
from armguard.sense.world import Placed, World
from arrays import Floats
from freedom.runs import Frames
from freedom.worlds import World as Foreign
from freedom.worlds import sensing_bay

# Edge of a voxel, MoveIt's resolution [m], rate of checks [Hz], and padding of links
# and objects [m].
VOXEL, RATE, PADDING = 0.025, 10.0, 0.03

# Share of the velocity in a contact [-].
LEAST = 1e-3


class OctomapGate:
    """Scales desired velocities by the distance to occupied voxels.

    Args:
        foreign: The foreign objects, which its cameras see.
        threshold: Distance from which on an arm is slowed [m].
        seed: Seed of the noise.
    """

    def __init__(self, foreign: Foreign, threshold: float, seed: int) -> None:
        octomap: Any = import_module("octomap")
        scene = sensing_bay(VOXEL, zones=False, rate=RATE)
        self.tables = compile_scene(scene)
        self._threshold, self._tree = threshold, octomap.OcTree(VOXEL)
        self._frames, self._sensors = Frames(scene, foreign, seed), scene.sensors
        self._world = World(scene)
        self._history = JointHistory(*self._world.joint_figures())
        self._voxels = np.zeros((0, 3))
        self._scales = {part.name: 0.0 for part in self.tables.robots}
        self._next = -inf

    def engage(self, robot: str) -> None:
        """Do nothing: the gate holds no robot."""

    def filter(
        self, q: Floats, v_desired: Floats, stamp: float, *, velocity: Floats,
        now: float,
    ) -> Any:  # fmt: skip
        """See `runs.Commanding`."""
        self._history.add(q, stamp)
        placed = self._world.at(self._history, stamp, 0.0)
        frames = self._frames.look(q, stamp, now)
        if placed is not None:
            for name, depth, _, at in frames:
                self._insert(name, depth, at - self._sensors[name].delay)
            if stamp >= self._next:
                self._next = stamp + 1.0 / RATE
                self._check(placed)
        command = v_desired.copy()
        for part in self.tables.robots:
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            command[own] *= self._scales[part.name]
        return SimpleNamespace(
            velocity=command, actions=dict.fromkeys(self._scales, Action.FOLLOW),
            blocked=dict.fromkeys(self._scales, Blocked.NOT),
            verdict=SimpleNamespace(cycle_time=0.0),
        )  # fmt: skip

    def _insert(self, name: str, depth: Floats, measured: float) -> None:
        """Insert the foreign points of an image."""
        placed = self._world.at(self._history, measured, 0.0)
        sensor = self._sensors[name]
        T = sensor.pose.matrix()
        v, u = np.nonzero(depth > 0.0)
        z = depth[v, u]
        (fx, fy), (cx, cy) = sensor.focal, sensor.middle
        local = np.stack([(u - cx) / fx * z, (v - cy) / fy * z, z], axis=1)
        points = np.ascontiguousarray(local @ T[:3, :3].T + T[:3, 3])
        if placed is None:
            return
        points = points[self._gaps(points, placed, PADDING) >= PADDING]
        if len(points) == 0:
            return
        self._tree.insertPointCloud(points, T[:3, 3].copy(), discretize=True)
        places = np.floor(points / VOXEL) * VOXEL + 0.5 * VOXEL
        self._voxels = np.unique(np.concatenate([self._voxels, places]), axis=0)

    def _gaps(
        self, points: Floats, placed: Placed, reach: float, arm: int | None = None
    ) -> Floats:
        """Distances of points to all primitives, or to an arm's [m], shape (n,)."""
        chosen = placed.balls[:, 3] >= 0.0
        if arm is not None:
            robots = np.full(len(chosen), -1)
            known = self.tables.robot_of_primitive
            robots[: len(known)] = known
            chosen &= robots == arm
        out = np.zeros((len(points), 4))
        nearest(
            points, self._world.kinds[chosen], placed.rows[chosen],
            placed.balls[chosen], reach, out,
        )  # fmt: skip
        return np.asarray(out[:, 0])

    def _check(self, placed: Placed) -> None:
        """Compute the scales of both arms from the distances of voxels."""
        labels = self._tree.getLabels(self._voxels) if len(self._voxels) else []
        occupied = np.ascontiguousarray(self._voxels[np.asarray(labels) == 1])
        for r, part in enumerate(self.tables.robots):
            reach = self._threshold + VOXEL
            gaps = self._gaps(occupied, placed, reach, r)
            gap = float(gaps.min(initial=inf)) - 0.5 * VOXEL
            share = min(max(gap, 0.0) / self._threshold - 1.0, 0.0)
            self._scales[part.name] = exp(-log(LEAST) * share)
