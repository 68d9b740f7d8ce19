"""How far primitives are apart: MuJoCo's kinematics, Coal's distances, of chosen pairs.

MuJoCo's own distance will not do: of a capsule that sticks through a plate
`mj_geomDistance` (4.0) may say that they are apart.
"""

from typing import Any

import coal
import mujoco
import numpy as np

from armguard.scene import SceneTables
from arrays import Floats
from closed_loop.judge import extent
from peers.mujoco_margin import model_of


class Judge:
    """Distances between primitives of a scene, by other people's code.

    Attributes:
        pairs: Checked pairs of primitives, shape (k, 2).
        reach: How far a unit of each joint can move anything, shape (n,) [m/rad].
        levers: The same of each joint for each pair, shape (k, n): 0 for joints that
            move neither side, or both alike.
        normal: Unit vector from A to B of the last gradient, shape (3,).

    Args:
        tables: The scene's tables: frames, primitives, and what is checked.
    """

    def __init__(self, tables: SceneTables) -> None:
        self.model = model_of(tables)
        self.data = mujoco.MjData(self.model)
        moving = np.flatnonzero(tables.joint_kind != 0)
        joints = [self.model.joint(f"j{b}") for b in moving]
        self._address = np.array([int(j.qposadr[0]) for j in joints])
        self._dof = np.array([int(j.dofadr[0]) for j in joints])
        self._source = tables.q_index[moving]
        self._gain = tables.gain[moving]
        count = len(tables.kinds)
        self._geoms = [int(self.model.geom(f"p{i}").id) for i in range(count)]
        self._shapes = [shape_of(self.model, g) for g in self._geoms]
        self._request, self._found = coal.DistanceRequest(), coal.DistanceResult()
        self.pairs = np.array(
            [
                (i, j)
                for i in range(tables.moving_count)
                for j in range(i + 1, count)
                if tables.checked[tables.groups[i], tables.groups[j]]
            ]
        )
        self._place_of = {(int(i), int(j)): k for k, (i, j) in enumerate(self.pairs)}
        self.reach = np.zeros(len(tables.q_names))
        for b, place in zip(moving, self._source, strict=True):
            body = int(self.model.body(f"b{b}").id)
            self.reach[place] = extent(self.model, body)
        self.levers = np.array([self._levers(tables, i, j) for i, j in self.pairs])
        self.normal = np.zeros(3)
        self._jacobian = np.zeros((2, 3, self.model.nv))

    def _levers(self, tables: SceneTables, i: int, j: int) -> Floats:
        """Reaches of the joints that move one side of a pair and not the other."""
        moved = [joints_above(tables, int(tables.bodies[k])) for k in (i, j)]
        levers = np.zeros_like(self.reach)
        for b in moved[0] ^ moved[1]:
            levers[tables.q_index[b]] = self.reach[tables.q_index[b]]
        return levers

    def place_of(self, i: int, j: int) -> int:
        """Where a pair of primitives is in `pairs`."""
        return self._place_of[i, j]

    def stand_at(self, primitive: int, T: Floats) -> None:
        """Put a primitive of the world elsewhere; its frame is that of its geom."""
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).reshape(9))
        geom = self._geoms[primitive]
        self.model.geom_pos[geom], self.model.geom_quat[geom] = T[:3, 3], quat

    def place(self, q: Floats) -> None:
        """Kinematics of joint positions, shape (n,) [rad or m]."""
        self.data.qpos[self._address] = self._gain[:, 0] * q[self._source]
        mujoco.mj_kinematics(self.model, self.data)

    def gap(self, k: int) -> float:
        """Signed distance of a pair where it was placed [m]."""
        i, j = self.pairs[k]
        self._found.clear()
        distance = coal.distance(
            self._shapes[i],
            self._frame(i),
            self._shapes[j],
            self._frame(j),
            self._request,
            self._found,
        )
        return float(distance)

    def _frame(self, primitive: int) -> Any:
        """Where a primitive was placed."""
        g, data = self._geoms[primitive], self.data
        return coal.Transform3s(data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g])

    def gaps(self) -> Floats:
        """Signed distances of all pairs where they were placed [m]."""
        return np.array([self.gap(k) for k in range(len(self.pairs))])

    def gradient(self, k: int) -> Floats:
        """Change of a pair's distance by each joint, shape (n,) [m/rad]."""
        gap = self.gap(k)
        one = np.array(self._found.getNearestPoint1())
        other = np.array(self._found.getNearestPoint2())
        length = float(np.linalg.norm(other - one))
        found = np.zeros(len(self.reach))
        if length == 0.0:
            return found
        normal = (other - one) / (length if gap > 0.0 else -length)
        self.normal = normal
        mujoco.mj_comPos(self.model, self.data)
        a, b = (self.model.geom_bodyid[self._geoms[i]] for i in self.pairs[k])
        first, second = self._jacobian
        mujoco.mj_jac(self.model, self.data, first, None, one, a)
        mujoco.mj_jac(self.model, self.data, second, None, other, b)
        by_dof = normal @ (second - first)
        np.add.at(found, self._source, self._gain[:, 0] * by_dof[self._dof])
        return found

    def point_jacobian(self, primitive: int, point: Floats) -> Floats:
        """Change of a point of a primitive by each joint, shape (3, n) [m/rad].

        Args:
            primitive: The primitive, where it was placed.
            point: The point, in the frame of its body [m].
        """
        body = int(self.model.geom_bodyid[self._geoms[primitive]])
        at = self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ point
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_jac(self.model, self.data, self._jacobian[0], None, at, body)
        found = np.zeros((3, len(self.reach)))
        found[:, self._source] = self._gain[:, 0] * self._jacobian[0][:, self._dof]
        return found

    def least_on_line(
        self, start: Floats, end: Floats, floor: float, grain: float
    ) -> float:
        """Least distance of any pair on a straight line of joint positions [m].

        From each sample nothing can get nearer than the floor before the next one, by
        how far the joints can move anything; samples are no denser than the grain.

        Args:
            start: Joint positions, shape (n,).
            end: Joint positions, shape (n,).
            floor: Distance that is asked about [m].
            grain: Way between two samples that is short enough [m].
        """
        way = float(self.reach @ np.abs(end - start))
        self.place(start)
        bounds = self.gaps()
        least, s = float(bounds.min()), 0.0
        while s < 1.0:
            step = max(abs(float(bounds.min()) - floor), grain) / way
            step = min(step, 1.0 - s)
            s = 1.0 if step >= 1.0 - s else s + step
            bounds -= way * step
            self.place(start + s * (end - start))
            fresh = set()
            while (k := int(bounds.argmin())) not in fresh:
                bounds[k] = self.gap(k)
                fresh.add(k)
            least = min(least, float(bounds[k]))
        return least


def shape_of(model: mujoco.MjModel, geom: int) -> Any:
    """A geom as Coal has it; all are convex, in a frame at their centre."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return coal.Sphere(size[0])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return coal.Capsule(size[0], 2.0 * size[1])
    return coal.Box(*(2.0 * size))


def joints_above(tables: SceneTables, body: int) -> set[int]:
    """Bodies with a joint that move a body, itself among them."""
    found = set()
    while body >= 0:
        if tables.joint_kind[body] != 0:
            found.add(body)
        body = int(tables.parent[body])
    return found
