"""How far primitives are apart: MuJoCo's kinematics, Coal's distances, of chosen pairs.

MuJoCo's own distance will not do: of a capsule that sticks through a plate
`mj_geomDistance` (4.0) may say that they are apart.
"""

from collections import defaultdict, deque
from typing import Any

import coal
import mujoco
import numpy as np

from armguard.scene import Scene, SceneTables
from arrays import Floats
from closed_loop.judge import Judge as PlacedJudge


class Judge:
    """Distances between primitives of a scene, by other people's code.

    Attributes:
        model: MuJoCo's model.
        data: Where everything was placed.
        geoms: The geom of each primitive.
        pairs: Checked pairs of primitives, shape (k, 2).
        reach: How far a unit of each joint can move anything, shape (n,) [m/rad].
        levers: The same of each joint for each pair, shape (k, n): 0 for joints that
            move neither side, or both alike.
        normal: Unit vector from A to B of the last gradient, shape (3,).

    Args:
        scene: The scene; its links have no meshes.
        tables: Its tables: frames, primitives, and what is checked.
    """

    def __init__(self, scene: Scene, tables: SceneTables) -> None:
        self._placed = PlacedJudge(scene, tables)
        self.model, self.data = self._placed.model, self._placed.data
        self.reach = self._placed.reach
        # A geom may be put elsewhere: it is not always where its body is.
        self.model.geom_sameframe[:] = 0
        of_owner: dict[str, deque[int]] = defaultdict(deque)
        for geom, owner in enumerate(self._placed.owners):
            of_owner[owner].append(geom)
        self.geoms = [of_owner[owner].popleft() for owner in tables.body_names]
        self._shapes = [shape_of(self.model, g) for g in self.geoms]
        self._request, self._found = coal.DistanceRequest(), coal.DistanceResult()
        self.pairs = np.array(
            [
                (i, j)
                for i in range(tables.moving_count)
                for j in range(i + 1, len(self.geoms))
                if tables.checked[tables.groups[i], tables.groups[j]]
            ]
        )
        self._place_of = {(int(i), int(j)): k for k, (i, j) in enumerate(self.pairs)}
        a, b = np.array(self.geoms)[self.pairs].T
        moves = self._placed.carries[a] != self._placed.carries[b]
        self.levers = np.zeros((len(self.pairs), len(self.reach)))
        for k, row in enumerate(moves):
            own = np.unique(self._placed.source[row])
            self.levers[k, own] = self.reach[own]
        self.normal = np.zeros(3)

    def place_of(self, i: int, j: int) -> int:
        """Where a pair of primitives is in `pairs`."""
        return self._place_of[i, j]

    def stand_at(self, primitive: int, T: Floats) -> None:
        """Put a primitive of the world elsewhere; its frame is that of its geom."""
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).reshape(9))
        geom = self.geoms[primitive]
        self.model.geom_pos[geom], self.model.geom_quat[geom] = T[:3, 3], quat

    def place(self, q: Floats) -> None:
        """Kinematics of joint positions, shape (n,) [rad or m]."""
        self._placed.place(q)

    def gap(self, k: int) -> float:
        """Signed distance of a pair where it was placed [m]."""
        self._found.clear()
        sides = []
        for primitive in self.pairs[k]:
            g, data = self.geoms[primitive], self.data
            frame = data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]
            sides += [self._shapes[primitive], coal.Transform3s(*frame)]
        return float(coal.distance(*sides, self._request, self._found))

    def gaps(self) -> Floats:
        """Signed distances of all pairs where they were placed [m]."""
        return np.array([self.gap(k) for k in range(len(self.pairs))])

    def gradient(self, k: int) -> Floats:
        """Change of a pair's distance by each joint, shape (n,) [m/rad]."""
        gap = self.gap(k)
        one = np.array(self._found.getNearestPoint1())
        other = np.array(self._found.getNearestPoint2())
        length = float(np.linalg.norm(other - one))
        if length == 0.0:
            return np.zeros(len(self.reach))
        self.normal = (other - one) / (length if gap > 0.0 else -length)
        a, b = (self.geoms[i] for i in self.pairs[k])
        return self._placed.gradient((a, b), self.normal, one, other)

    def point_jacobian(self, primitive: int, point: Floats) -> Floats:
        """Change of a point of a primitive by each joint, shape (3, n) [m/rad].

        Args:
            primitive: The primitive, where it was placed.
            point: The point, in the frame of its body [m].
        """
        model, data, placed = self.model, self.data, self._placed
        body = int(model.geom_bodyid[self.geoms[primitive]])
        at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point
        jacobian, found = np.zeros((3, model.nv)), np.zeros((3, len(self.reach)))
        mujoco.mj_comPos(model, data)
        mujoco.mj_jac(model, data, jacobian, None, at, body)
        found[:, placed.source] = placed.gain[:, 0] * jacobian[:, placed.address]
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
