"""MuJoCo: kinematics and collision with a margin."""

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import mujoco
import numpy as np

from armguard.geometry.shapes import ShapeKind
from armguard.scene import SceneTables
from arrays import Floats
from peers import Pairs
from peers.shapes import is_ball

GEOM = mujoco.mjtGeom
JOINTS = {1: mujoco.mjtJoint.mjJNT_HINGE, 2: mujoco.mjtJoint.mjJNT_SLIDE}

# No part moves by itself here, but a model must have masses.
INERTIA = {
    "explicitinertial": True,
    "mass": 1.0,
    "inertia": (1, 1, 1),
    "ipos": (0, 0, 0),
    "iquat": (1, 0, 0, 0),
}


def quaternion_of(R: Floats) -> Floats:
    """Quaternion of a rotation, scalar first."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(R).reshape(9))
    return quat


def placed(T: Floats) -> dict[str, Floats]:
    """A frame of three or four rows as attributes."""
    return {"pos": T[:3, 3], "quat": quaternion_of(T[:3, :3])}


def bodies_of(spec: mujoco.MjSpec, tables: SceneTables) -> Iterator[tuple[int, Any]]:
    """Add the bodies of a scene's tables, with their joints.

    Yields:
        Number of each body, -1 of the world's, and the body; none rides on it yet.
    """
    bodies: dict[int, Any] = {-1: spec.worldbody}
    yield -1, spec.worldbody
    for b, up in enumerate(tables.parent.tolist()):
        frame = placed(tables.T_parent_joint[b].reshape(3, 4))
        bodies[b] = body = bodies[up].add_body(name=f"b{b}", **frame, **INERTIA)
        if kind := JOINTS.get(int(tables.joint_kind[b])):
            body.add_joint(name=f"j{b}", type=kind, axis=tables.axis[b])
        yield b, body


def model_of(tables: SceneTables) -> mujoco.MjModel:
    """The scene's tables as a MuJoCo model; half of the margin is each geom's own.

    MuJoCo leaves out pairs of bodies, not of geoms: where only some geoms of the world
    are allowed to touch a body, they are filtered from the answer instead.
    """
    spec = mujoco.MjSpec()
    spec.memory = 64 << 20
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    bodies = dict(bodies_of(spec, tables))
    margin = {"margin": tables.margin, "gap": tables.margin}
    for i, b in enumerate(tables.bodies.tolist()):
        shape = geom(int(tables.kinds[i]), tables.local_rows[i])
        bodies[b].add_geom(name=f"p{i}", **margin, **shape)
    groups = [tables.groups[tables.bodies == b] for b in range(len(tables.parent))]
    for a, b in combinations(range(len(groups)), 2):
        if not tables.checked[np.ix_(groups[a], groups[b])].any():
            spec.add_exclude(bodyname1=f"b{a}", bodyname2=f"b{b}")
    return spec.compile()


def geom(kind: int, row: Floats) -> dict[str, Any]:
    """A primitive as the attributes of a geom.

    Raises:
        ValueError: MuJoCo has no such shape.
    """
    if is_ball(kind, row):
        return {"type": GEOM.mjGEOM_SPHERE, "size": (row[0], 0, 0), "pos": row[1:4]}
    if kind == ShapeKind.CAPSULE:
        size = row[0], 0, 0
        return {"type": GEOM.mjGEOM_CAPSULE, "size": size, "fromto": row[1:7]}
    if kind != ShapeKind.BOX:
        raise ValueError(f"MuJoCo has no shape for {ShapeKind(kind).name}")
    # MuJoCo has no rounded box: one grown by the radius is larger at its edges.
    return {
        "type": GEOM.mjGEOM_BOX,
        "size": row[4:7] + row[0],
        "pos": row[1:4],
        "quat": quaternion_of(row[7:16].reshape(3, 3)),
    }


class MujocoMargin:
    """`mj_kinematics`, `mj_comPos` and `mj_collision`, margins on all geoms.

    `mj_collision` needs what `mj_comPos` computes for its bounding volumes.
    """

    name = "mujoco"

    def __init__(self, tables: SceneTables) -> None:
        self.tables = tables
        self.model = model_of(tables)
        self.data = mujoco.MjData(self.model)
        bodies = np.flatnonzero(tables.joint_kind != 0)
        self.address = np.array([self.model.joint(f"j{b}").qposadr[0] for b in bodies])
        self.source = tables.q_index[bodies]
        self.gain = tables.gain[bodies]

    def positions(self, q: Floats) -> Floats:
        """Rows of `q`: `step` finds each joint's own number."""
        return q

    def step(self, q: Floats) -> object:
        """Kinematics and every pair within the margin."""
        self.data.qpos[self.address] = q[self.source]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        return self.data.ncon

    def near_pairs(self, q: Floats) -> Pairs:
        """Pairs with a contact within the margin, without those the scene allows."""
        self.step(q)
        found = set()
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            i, j = sorted(int(self.model.geom(int(g)).name[1:]) for g in contact.geom)
            t = self.tables
            if contact.dist <= t.margin and t.checked[t.groups[i], t.groups[j]]:
                found.add((i, j))
        return found


# The peers of a cycle.
PEERS = (MujocoMargin,)
