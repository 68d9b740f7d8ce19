"""Simulated sensors: zones and depth cameras that see a scene by MuJoCo's rays."""

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Hull,
    PlacedShape,
    Shape,
    Sphere,
)
from armguard.robot.kinematics import PRISMATIC, REVOLUTE
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.sensors import SceneSensor

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GEOM, JOINT = mujoco.mjtGeom, mujoco.mjtJoint

# Rays along each edge of a zone.
RAYS = 4

# Where a foreign box is that is not in the world [m].
AWAY = (0.0, 0.0, -50.0)


class Reading(NamedTuple):
    """A frame of a simulated sensor.

    Attributes:
        distance: Distances by rows and columns, points, or one distance, by the form of
            the sensor's frames [m].
        status: Status of each distance, by the codes of the kind; None of points and of
            one distance.
    """

    distance: Floats
    status: Ints | None


class Rig:
    """Sensors of a scene in a world with foreign bodies.

    Links are their hulls where a scene has them, else their primitives. MuJoCo has the
    kinematics and the rays.

    Attributes:
        scene: The scene with its sensors.
        truth: True pose of each sensor in its link or in the world, by name; at first
            that of the scene.
        invalid: Share of distances of arrays that are invalid at random [-].
        strength: Reflectance of all surfaces times the cosine of the angle of
            incidence, for infrared sensors [-].
        drift: Signal of pads beside that of bodies, in units of the gain.

    Args:
        scene: See the attribute.
        boxes: The foreign bodies: shapes, or edges of boxes [m].
        seed: Seed of the noise.
        without: Modelled objects that are not there in truth.

    Raises:
        ValueError: MuJoCo has no shape for a shape of the scene.
    """

    def __init__(
        self, scene: Scene, boxes: Sequence[Shape | tuple[float, float, float]] = (),
        seed: int = 0, without: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.scene, self._tables = scene, compile_scene(scene)
        spec = mujoco.MjSpec()
        spec.memory = 64 << 20
        self._add_bodies(spec, without)
        for k, given in enumerate(boxes):
            body = spec.worldbody.add_body(name=f"box{k}", mocap=True, pos=AWAY)
            shape = given if isinstance(given, Shape) else Box(size=given)
            body.add_geom(**sizes_of(shape))
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._rng, self.invalid = np.random.default_rng(seed), 0.0
        self.strength, self.drift = 0.5, 0.0
        self.truth = {n: one.pose.matrix() for n, one in scene.sensors.items()}
        self._ways = {n: ways_of(one) for n, one in scene.sensors.items()}
        self._held: dict[str, Floats] = {}

    def _add_bodies(self, spec: Any, without: Sequence[str]) -> None:
        """Add robots and objects."""
        tables, names = self._tables, iter(range(10**6))
        bodies: dict[int, Any] = {-1: spec.worldbody}
        kinds = {REVOLUTE: JOINT.mjJNT_HINGE, PRISMATIC: JOINT.mjJNT_SLIDE}
        self._joints: list[tuple[str, int, Floats]] = []
        for b, up in enumerate(tables.parent.tolist()):
            T = tables.T_parent_joint[b].reshape(3, 4)
            body = bodies[up].add_body(
                name=f"b{b}", **frame_of(T), explicitinertial=True, mass=1.0,
                inertia=(1, 1, 1),
            )  # fmt: skip
            bodies[b] = body
            if kind := kinds.get(int(tables.joint_kind[b])):
                body.add_joint(name=f"j{b}", type=kind, axis=tables.axis[b])
                place = int(tables.q_index[b])
                self._joints.append((f"j{b}", place, tables.gain[b]))
        for link, frame in tables.links.items():
            robot, name = link.split("/", 1)
            fit = self.scene.robots[robot].fits.get(name)
            for placed in (fit.exact or fit.shapes) if fit is not None else ():
                add_geom(spec, bodies[frame.body], placed, frame.T_body_link, names)
        for name, item in self.scene.objects.items():
            if name in without or not item.present:
                continue
            body, T = spec.worldbody, item.pose.matrix()
            if item.attached_to is not None:
                frame = tables.links[item.attached_to]
                body, T = bodies[frame.body], frame.T_body_link @ T
            for placed in item.shapes:
                add_geom(spec, body, placed, T, names)

    def place(self, box: int, pose: Pose | None) -> None:
        """Put a foreign box into the world, or take it out of it.

        Args:
            box: Its number.
            pose: Its pose; None to take it out.
        """
        T = Pose(xyz=AWAY).matrix() if pose is None else pose.matrix()
        found = frame_of(T)
        self._data.mocap_pos[box], self._data.mocap_quat[box] = found.values()

    def look(self, name: str, q: Floats, rays: Floats) -> Floats:
        """Depths along rays of a sensor, infinite where there is nothing.

        Args:
            name: Name of the sensor.
            q: Joint positions, shape (n,) [rad or m].
            rays: Unit vectors in the sensor, shape (k, 3).
        """
        model, data = self._model, self._data
        for joint, place, (factor, offset) in self._joints:
            data.joint(joint).qpos[0] = factor * q[place] + offset
        mujoco.mj_kinematics(model, data)
        sensor, T = self.scene.sensors[name], self.truth[name]
        if sensor.on is not None:
            link = self._tables.links[sensor.on]
            body, base = data.body(f"b{link.body}"), np.eye(4)
            base[:3, :3], base[:3, 3] = body.xmat.reshape(3, 3), body.xpos
            T = base @ link.T_body_link @ T
        count = len(rays)
        vectors = np.ascontiguousarray(rays @ T[:3, :3].T).reshape(-1)
        ids, distance = np.zeros(count, dtype=np.int32), np.zeros(count)
        mujoco.mj_multiRay(
            model, data, T[:3, 3].copy(), vectors, None, True, -1, ids, distance, None,
            count, 20.0,
        )  # fmt: skip
        return np.where(ids >= 0, distance, inf) * rays[:, 2]

    def read(self, name: str, q: Floats) -> Reading:
        """A frame of a sensor, with noise and invalid distances.

        Args:
            name: Name of the sensor.
            q: Joint positions when it is measured, shape (n,) [rad or m].
        """
        sensor, rays = self.scene.sensors[name], self._ways[name]
        if sensor.form == "points":
            return Reading(self._points(sensor, rays, q), None)
        if sensor.form in ("infrared", "capacitive"):
            return Reading(np.array(self._signal(sensor, rays, q)), None)
        if sensor.form == "beam":
            return Reading(np.array(self._beam(sensor, rays, q)), None)
        columns, rows = sensor.zones
        depth = self.look(name, q, rays.reshape(-1, 3)).reshape(rows, columns, -1)
        depth = np.sort(depth, axis=2)
        least = max(int(np.ceil(sensor.fill * depth.shape[2])), 1)
        found = depth[:, :, least - 1]
        if not sensor.image:
            # Objects that do not fill their share pull a distance towards them.
            part = depth[:, :, :least]
            near = part[:, :, 0]
            merges = (found > near + 0.05) & (found < near + sensor.merge)
            found = np.where(merges, part.mean(axis=2), found)
        seen = (found >= sensor.range[0]) & (found <= sensor.range[1])
        within = np.where(seen, found, 0.0)
        value = self._noisy(sensor, within)
        if sensor.image:
            return Reading(np.where(seen, value, 0.0), np.zeros((rows, columns), int))
        codes = sensor.codes
        status = np.where(seen, codes.valid[0], codes.nothing[0])
        broken = self._rng.random(found.shape) < self.invalid
        status = np.where(broken, 0 if 0 not in codes.valid else 7, status)
        # Where nothing is seen the value of the last measurement stays.
        held = self._held.get(name, np.zeros(found.shape))
        value = np.where(seen & ~broken, value, held)
        self._held[name] = value
        return Reading(value, status)

    def _noisy(self, sensor: SceneSensor, distance: Floats) -> Floats:
        """Distances with the noise of a sensor [m]."""
        a, b, c = sensor.noise
        noise = a + b * distance + c * distance * distance
        return distance + noise * self._rng.standard_normal(distance.shape)

    def _points(self, sensor: SceneSensor, rays: Floats, q: Floats) -> Floats:
        """Points of a sensor, NaN without any within its range, shape (n, 3) [m]."""
        way = self.look(sensor.name, q, rays) / rays[:, 2]
        seen = (way >= sensor.range[0]) & (way <= sensor.range[1])
        found = self._noisy(sensor, np.where(seen, way, np.nan))
        return np.asarray(found[:, None] * rays)

    def _signal(self, sensor: SceneSensor, rays: Floats, q: Floats) -> float:
        """Signal of an infrared sensor or of a pad, by the rays of its cone."""
        rays = rays.reshape(-1, 3)
        rays = rays[rays[:, 2] > np.cos(0.5 * sensor.view[0])]
        way = self.look(sensor.name, q, rays) / rays[:, 2]
        if sensor.form == "infrared":
            share = self.strength / (way + sensor.offset) ** 2
            weight = np.ones(len(rays))
        else:
            share = (sensor.offset / (sensor.offset + way)) ** 2
            # Rays of a plane before the pad are denser to its sides.
            weight = rays[:, 2] ** 4
        value = sensor.gain * float(weight @ share / weight.sum()) + self.drift
        a, b, c = sensor.noise
        noise = a + b * value + c * value * value
        return value + noise * float(self._rng.standard_normal())

    def _beam(self, sensor: SceneSensor, rays: Floats, q: Floats) -> float:
        """The distance at which bodies fill their share of a cone [m]."""
        rays = rays.reshape(-1, 3)
        rays = rays[rays[:, 2] > np.cos(0.5 * sensor.view[0])]
        way = np.sort(self.look(sensor.name, q, rays) / rays[:, 2])
        found = way[max(int(np.ceil(sensor.fill * len(way))), 1) - 1 :][:1]
        if found[0] > sensor.range[1]:
            return inf
        return (
            float(self._noisy(sensor, found)[0]) if found >= sensor.range[0] else -inf
        )


def add_geom(
    spec: Any, body: Any, placed: PlacedShape, T: Floats, names: Iterator[int]
) -> None:
    """Add a shape to a body.

    Args:
        spec: The model.
        body: The body.
        placed: The shape.
        T: Its frame's frame in the body, shape (4, 4).
        names: Numbers for names of meshes.

    Raises:
        ValueError: MuJoCo has no such shape.
    """
    shape, where = placed.shape, T @ placed.pose.matrix()
    if isinstance(shape, Hull):
        name = f"m{next(names)}"
        spec.add_mesh(name=name, uservert=np.asarray(shape.points).ravel())
        body.add_geom(type=GEOM.mjGEOM_MESH, meshname=name, **frame_of(where))
        return
    if isinstance(shape, Capsule):
        ends = np.array([shape.start, shape.end]) @ where[:3, :3].T + where[:3, 3]
        radius = shape.radius + shape.rounding
        if np.linalg.norm(ends[1] - ends[0]) > 1e-9:
            size = (radius, 0.0, 0.0)
            body.add_geom(type=GEOM.mjGEOM_CAPSULE, size=size, fromto=ends.ravel())
            return
        shape, where = Sphere(radius=radius), Pose(xyz=ends[0]).matrix()
    body.add_geom(**sizes_of(shape), **frame_of(where))


def sizes_of(shape: object) -> dict[str, Any]:
    """A shape as the type and the size of a geom.

    Raises:
        ValueError: MuJoCo has no such shape.
    """
    if isinstance(shape, Sphere):
        radius = shape.radius + shape.rounding
        return {"type": GEOM.mjGEOM_SPHERE, "size": (radius, 0.0, 0.0)}
    if isinstance(shape, Box):
        half = np.asarray(shape.half_extents) + shape.rounding
        return {"type": GEOM.mjGEOM_BOX, "size": half}
    if isinstance(shape, Cylinder):
        size = (shape.radius + shape.rounding, shape.height / 2.0 + shape.rounding, 0.0)
        return {"type": GEOM.mjGEOM_CYLINDER, "size": size}
    if isinstance(shape, HalfSpace):
        return {"type": GEOM.mjGEOM_PLANE, "size": (20.0, 20.0, 1.0)}
    raise ValueError(f"MuJoCo has no shape for {type(shape).__name__}")


def frame_of(T: Floats) -> dict[str, Floats]:
    """A frame as the place and the quaternion of a body or a geom."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).reshape(9))
    return {"pos": T[:3, 3].copy(), "quat": quat}


def ways_of(sensor: SceneSensor) -> Floats:
    """Unit vectors of the rays of a sensor, shape (rows, columns, rays, 3).

    Those of points are within 45° about the axis, shape (n, 3).
    """
    if sensor.form == "points":
        slope = np.arange(-0.41, 0.41, sensor.spacing)
        flat = np.stack([*np.meshgrid(slope, slope), np.ones((len(slope),) * 2)], 2)
        flat = flat.reshape(-1, 3)
        return np.asarray(flat / np.linalg.norm(flat, axis=1, keepdims=True))
    columns, rows = sensor.zones
    parts = np.zeros(1) if sensor.image else (np.arange(RAYS) + 0.5) / RAYS - 0.5
    u, v = (part.ravel() for part in np.meshgrid(parts, parts))
    x = (np.arange(columns)[:, None] + u - sensor.middle[0]) / sensor.focal[0]
    y = (np.arange(rows)[:, None] + v - sensor.middle[1]) / sensor.focal[1]
    ways = np.ones((rows, columns, len(u), 3))
    ways[..., 0], ways[..., 1] = x[None], y[:, None]
    return np.asarray(ways / np.linalg.norm(ways, axis=3, keepdims=True))


def mounted(pose: Pose, offset: Mapping[str, Sequence[float]]) -> Floats:
    """A pose with an error of its mounting, shape (4, 4).

    Args:
        pose: The pose.
        offset: `xyz` [m] and `rpy` [rad] of the true frame in the declared one.
    """
    return np.asarray(pose.matrix() @ Pose(**offset).matrix())
