"""Who touches whom: MuJoCo's collision detection on the true states."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from armguard.scene import Scene, SceneTables
from closed_loop.judge_model import SIGHT, JudgeModel

Floats = NDArray[np.float64]

# Pairs of kinds whose distance in a contact is exact, apart too. That of others can be
# too large by a quarter while they are apart, since `mj_collision` grows both sides by
# the margin and takes the depth; they are measured by `mj_geomDistance`.
CLOSED_FORM = np.zeros((mujoco.mjtGeom.mjNGEOMTYPES,) * 2, dtype=bool)
for _a, _b in (
    (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_SPHERE),
    (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE),
    (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX),
    (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CAPSULE),
    (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_BOX),
):
    CLOSED_FORM[_a, _b] = CLOSED_FORM[_b, _a] = True


class Nearest(NamedTuple):
    """The nearest checked pair within sight.

    Attributes:
        distance: Signed distance [m].
        geoms: Its two geoms.
        normal: Unit vector from the first to the second, shape (3,).
        point: Point midway, shape (3,) [m].
    """

    distance: float
    geoms: tuple[int, int]
    normal: Floats
    point: Floats


class Judge:
    """Distances of all checked pairs, by other people's code.

    Attributes:
        owners: 'robot/link' or object of each geom.
        reach: How far a unit of each joint can move anything, shape (n,) [m/rad or 1].
        pairs: Pairs of geoms that are checked.

    Args:
        scene: The scene.
        tables: Its tables: frames, primitives, and what is checked.
    """

    def __init__(self, scene: Scene, tables: SceneTables) -> None:
        built = JudgeModel(scene, tables)
        self.model = built.model
        self.data = mujoco.MjData(self.model)
        self.owners = built.owners
        self.arm_of = built.arm_of
        self._built = built
        moving = np.flatnonzero(tables.joint_kind != 0)
        joints = [self.model.joint(f"j{b}") for b in moving]
        self.address = np.array([int(j.qposadr[0]) for j in joints])
        self.dof = np.array([int(j.dofadr[0]) for j in joints])
        self.source = tables.q_index[moving]
        self.gain = tables.gain[moving]
        self.reach = np.zeros(len(tables.q_names))
        for j, place, gain in zip(joints, self.source, self.gain, strict=True):
            slides = self.model.jnt_type[j.id] == mujoco.mjtJoint.mjJNT_SLIDE
            far = (
                1.0 if slides else extent(self.model, int(self.model.jnt_bodyid[j.id]))
            )
            self.reach[place] += abs(gain[0]) * far
        self.pairs = checked_geoms(built, tables)
        self._pos = self.model.body_pos.copy()
        self._quat = self.model.body_quat.copy()
        self._tips = last_bodies(built)
        self._jacobian = np.zeros((2, 3, self.model.nv))
        self._fromto = np.zeros(6)
        self._distances = np.zeros(0)

    def stand_at(self, name: str, p: Floats) -> None:
        """Put the origin of an object's frame, as the scene has it, elsewhere by p."""
        body = self._built.objects[name]
        self.model.body_pos[body] = self._pos[body] + p

    def displace_base(self, robot: str, T: Floats) -> None:
        """Turn a robot about the origin of its base and shift it, T of shape (4, 4)."""
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, np.ascontiguousarray(T[:3, :3]).reshape(9))
        base = self._pos[self._built.bases[robot]]
        for body in self._built.roots[robot]:
            away = T[:3, :3] @ (self._pos[body] - base)
            self.model.body_pos[body] = base + away + T[:3, 3]
            mujoco.mju_mulQuat(self.model.body_quat[body], turn, self._quat[body])

    def place(self, q: Floats) -> None:
        """Kinematics of the true state."""
        self.data.qpos[self.address] = (
            self.gain[:, 0] * q[self.source] + self.gain[:, 1]
        )
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def measure(self, q: Floats) -> tuple[Floats, NDArray[np.int32]]:
        """Distances within sight [m], shape (k,), and their pairs of geoms, (k, 2)."""
        self.place(q)
        mujoco.mj_collision(self.model, self.data)
        contact = self.data.contact
        self._distances, geoms = contact.dist.copy(), contact.geom
        if len(geoms):
            kinds = self.model.geom_type[geoms]
            for k in np.flatnonzero(~CLOSED_FORM[kinds[:, 0], kinds[:, 1]]):
                self._distances[k] = self.gap((int(geoms[k, 0]), int(geoms[k, 1])))
        return self._distances, geoms

    def clearance(self, q: Floats) -> float:
        """Least signed distance of a checked pair; `SIGHT` if none is in sight [m]."""
        distances, _ = self.measure(q)
        return min(SIGHT, float(distances.min(initial=SIGHT)))

    def nearest(self) -> Nearest | None:
        """The nearest pair of the state measured last; None if none is in sight."""
        contact = self.data.contact
        if len(self._distances) == 0:
            return None
        k = int(np.argmin(self._distances))
        a, b = (int(g) for g in contact.geom[k])
        normal, point = contact.frame[k, :3].copy(), contact.pos[k].copy()
        return Nearest(float(self._distances[k]), (a, b), normal, point)

    def apart(self, pair: tuple[int, int], limit: float = 3.0) -> tuple[float, Floats]:
        """Signed distance of a pair of geoms [m] and its gradient over q, shape (n,).

        Args:
            pair: Geoms.
            limit: Distance beyond which nothing is looked for [m].
        """
        distance = mujoco.mj_geomDistance(
            self.model, self.data, *pair, limit, self._fromto
        )
        a, b = self._fromto[:3], self._fromto[3:]
        length = float(np.linalg.norm(b - a))
        if length == 0.0:
            return distance, np.zeros(len(self.reach))
        normal = (b - a) / (length if distance > 0.0 else -length)
        return distance, self.gradient(pair, normal, a, b)

    def gap(self, pair: tuple[int, int], limit: float = 3.0) -> float:
        """Signed distance of a pair of geoms, at most the limit [m]."""
        return mujoco.mj_geomDistance(self.model, self.data, *pair, limit, None)

    def gradient(
        self, pair: tuple[int, int], normal: Floats, a: Floats, b: Floats
    ) -> Floats:
        """Change of a pair's distance by each joint, shape (n,) [m/rad or 1].

        Args:
            pair: Geoms.
            normal: Unit vector from the first to the second.
            a: Nearest point of the first, world [m].
            b: Nearest point of the second, world [m].
        """
        bodies = self.model.geom_bodyid
        first, second = self._jacobian
        mujoco.mj_jac(self.model, self.data, first, None, a, bodies[pair[0]])
        mujoco.mj_jac(self.model, self.data, second, None, b, bodies[pair[1]])
        by_dof = normal @ (second - first)
        found = np.zeros(len(self.reach))
        np.add.at(found, self.source, self.gain[:, 0] * by_dof[self.dof])
        return found

    def tips(self) -> Floats:
        """Origins of the arms' last bodies in the state placed last, shape (a, 3)."""
        return self.data.xpos[self._tips].copy()


def checked_geoms(built: JudgeModel, tables: SceneTables) -> list[tuple[int, int]]:
    """Pairs of geoms whose owners the scene checks, one of an arm."""
    group = dict(zip(tables.body_names, tables.groups, strict=True))
    owners = built.owners
    return [
        (a, b)
        for a in range(len(owners))
        for b in range(a + 1, len(owners))
        if owners[a] != owners[b]
        and max(built.arm_of[a], built.arm_of[b]) >= 0
        and tables.checked[group[owners[a]], group[owners[b]]]
    ]


def last_bodies(built: JudgeModel) -> NDArray[np.intp]:
    """The body farthest down the chain of each arm."""
    geoms = [
        int(np.flatnonzero(built.arm_of == a)[-1]) for a in range(len(built.robots))
    ]
    return built.model.geom_bodyid[geoms].astype(np.intp)


def extent(model: mujoco.MjModel, body: int) -> float:
    """Radius about a body's origin that nothing riding on it can leave [m]."""
    far = 0.0
    for g in np.flatnonzero(model.geom_bodyid == body):
        size = model.geom_rbound[g]
        far = max(far, float(np.linalg.norm(model.geom_pos[g]) + size))
    for child in np.flatnonzero(model.body_parentid == body):
        stroke = 0.0
        for j in np.flatnonzero(model.jnt_bodyid == child):
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE:
                stroke = STROKE
        at = float(np.linalg.norm(model.body_pos[child]))
        far = max(far, at + stroke + extent(model, int(child)))
    return far


# Longest stroke of a prismatic joint in the scenes, with room to spare [m].
STROKE = 0.1
