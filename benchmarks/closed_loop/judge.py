"""Distances and contacts on the true states by MuJoCo's collision detection."""

from math import sqrt

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

from armguard.scene import Scene, SceneTables
from arrays import Bools, Floats, Ints
from closed_loop.judge_model import SIGHT, JudgeModel

# Pairs of kinds whose distance in a contact is exact, apart too. That of others can be
# too large by a quarter while they are apart, since `mj_collision` grows both sides by
# the margin and takes the depth; they are measured by `mj_geomDistance`.
CLOSED_FORM = np.zeros((mujoco.mjtGeom.mjNGEOMTYPES,) * 2, dtype=bool)
_SPHERE, _CAPSULE, _BOX = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    for kind in ("SPHERE", "CAPSULE", "BOX")
)
_ROUND = [_SPHERE, _CAPSULE, _BOX]
CLOSED_FORM[_SPHERE, _ROUND] = CLOSED_FORM[_ROUND, _SPHERE] = True
CLOSED_FORM[_CAPSULE, _ROUND] = CLOSED_FORM[_ROUND, _CAPSULE] = True


# Distance beyond which nothing is looked for [m].
FAR = 3.0


class Judge:
    """Distances of all checked pairs, by MuJoCo.

    Attributes:
        owners: 'robot/link' or object of each geom.
        reach: How far a unit of each joint can move anything, shape (n,) [m/rad or 1].
        pairs: Pairs of geoms that are checked.
        carries: Which of the joints that follow q move each geom, shape (g, k).

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
        self.source = tables.q_index[moving]
        self.gain = tables.gain[moving]
        ids = np.array([j.id for j in joints])
        self._followers = ids, self.source, np.ascontiguousarray(self.gain[:, 0])
        self._slides = self.model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
        self.carries = carriers(self.model, ids)
        self.reach = np.zeros(len(tables.q_names))
        for j, place, gain in zip(joints, self.source, self.gain, strict=True):
            body = int(self.model.jnt_bodyid[j.id])
            far = 1.0 if self._slides[j.id] else extent(self.model, body)
            self.reach[place] += abs(gain[0]) * far
        self.pairs = checked_geoms(built, tables)
        kinds = self.model.geom_type
        self._estimated = ~CLOSED_FORM[kinds[:, None], kinds[None, :]]
        self._estimates = any(self._estimated[pair] for pair in self.pairs)
        self._pos = self.model.body_pos.copy()
        self._quat = self.model.body_quat.copy()
        self._tips = last_bodies(built)
        # Views of what MuJoCo writes: to make one takes longer than to use it.
        self._qpos, self._xpos = self.data.qpos, self.data.xpos
        self._axes, self._anchors = self.data.xaxis, self.data.xanchor
        self._body_pos = self.model.body_pos
        self._fromto = np.zeros(6)
        self._distances = np.zeros(0)
        self._geoms = np.zeros((0, 2), dtype=np.int32)

    def stand_at(self, name: str, p: Floats) -> None:
        """Put the origin of an object's frame, as the scene has it, elsewhere by p."""
        body = self._built.objects[name]
        self._body_pos[body] = self._pos[body] + p

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
        follow(q, self.source, self.gain, self.address, self._qpos)
        mujoco.mj_kinematics(self.model, self.data)

    def measure(self, q: Floats) -> tuple[Floats, NDArray[np.int32]]:
        """Distances within sight [m], shape (k,), and their pairs of geoms, (k, 2)."""
        self.place(q)
        mujoco.mj_collision(self.model, self.data)
        contact = self.data.contact
        self._distances, self._geoms = contact.dist.copy(), contact.geom.copy()
        if self._estimates:
            a, b = self._geoms.T
            for k in np.flatnonzero(self._estimated[a, b]).tolist():
                self._distances[k] = self.gap((int(a[k]), int(b[k])))
        return self._distances, self._geoms

    def distance(self, q: Floats) -> float:
        """Least signed distance of a checked pair; `SIGHT` if none is in sight [m]."""
        distances, _ = self.measure(q)
        return float(distances.min(initial=SIGHT))

    def nearest(self) -> tuple[float, Floats]:
        """Least distance in the state measured last, and its gradient over q.

        Returns:
            Signed distance [m], `SIGHT` and no gradient if no pair is in sight; shape
            (n,) [m/rad or 1].
        """
        if len(self._distances) == 0:
            return SIGHT, np.zeros(len(self.reach))
        k = int(np.argmin(self._distances))
        contact = self.data.contact[k]
        normal, midway = contact.frame[:3].copy(), contact.pos.copy()
        a, b = self._geoms[k].tolist()
        return float(self._distances[k]), self.gradient((a, b), normal, midway, midway)

    def apart(self, pair: tuple[int, int], limit: float = FAR) -> tuple[float, Floats]:
        """Signed distance of a pair of geoms [m] and its gradient over q, shape (n,).

        Args:
            pair: Geoms.
            limit: Distance beyond which nothing is looked for [m].
        """
        distance = mujoco.mj_geomDistance(
            self.model, self.data, *pair, limit, self._fromto
        )
        a, b = self._fromto[:3], self._fromto[3:]
        way = b - a
        length = sqrt(way @ way)
        if length == 0.0:
            return distance, np.zeros(len(self.reach))
        normal = way / (length if distance > 0.0 else -length)
        return distance, self.gradient(pair, normal, a, b)

    def gap(self, pair: tuple[int, int], limit: float = FAR) -> float:
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
        found = np.zeros(len(self.reach))
        slopes(
            self.carries[list(pair)],
            normal,
            (a, b),
            self._axes,
            self._anchors,
            self._slides,
            self._followers,
            found,
        )
        return found

    def tips(self) -> Floats:
        """Origins of the arms' last bodies in the state placed last, shape (a, 3)."""
        return self._xpos[self._tips]


@numba.njit(cache=True)
def slopes(carries, normal, points, axes, anchors, slides, followers, found):
    """Change of a distance by each place of q.

    Args:
        carries: Whether each of k joints that follow q moves either side, shape (2, k).
        normal: Unit vector from the first side to the second, shape (3,).
        points: Nearest point of each side, shape (3,) [m].
        axes: Axis of every joint of the model, world, shape (j, 3).
        anchors: A point of each axis, world, shape (j, 3) [m].
        slides: Which of them slide, shape (j,).
        followers: Joint of the model, place of q it follows, and factor of each of the
            k joints.
        found: Added to, shape (n,) [m/rad or 1].
    """
    joints, source, factors = followers
    for k in range(len(joints)):
        u, at = axes[joints[k]], anchors[joints[k]]
        rate = 0.0
        for side, sign in ((0, -1.0), (1, 1.0)):
            if not carries[side, k]:
                continue
            x, y, z = u[0], u[1], u[2]
            if not slides[joints[k]]:
                p = points[side]
                rx, ry, rz = p[0] - at[0], p[1] - at[1], p[2] - at[2]
                x, y, z = y * rz - z * ry, z * rx - x * rz, x * ry - y * rx
            rate += sign * (normal[0] * x + normal[1] * y + normal[2] * z)
        found[source[k]] += factors[k] * rate


@numba.njit(cache=True)
def follow(q, source, gain, address, qpos):
    """Write positions of joints that follow places of q."""
    for k in range(len(source)):
        qpos[address[k]] = gain[k, 0] * q[source[k]] + gain[k, 1]


def carriers(model: mujoco.MjModel, joints: Ints) -> Bools:
    """Which of some joints move each geom, shape (g, k)."""
    found = np.zeros((model.ngeom, len(joints)), dtype=np.bool_)
    for g in range(model.ngeom):
        body = int(model.geom_bodyid[g])
        while body > 0:
            found[g] |= model.jnt_bodyid[joints] == body
            body = int(model.body_parentid[body])
    return found


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
