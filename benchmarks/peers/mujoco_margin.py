"""MuJoCo: kinematics and collision with a margin."""

from itertools import combinations

import mujoco
import numpy as np

from armguard.geometry.shapes import ShapeKind
from armguard.scene import SceneTables
from arrays import Floats
from peers import Pairs


def as_text(values: Floats) -> str:
    """Numbers for an attribute, exact."""
    return " ".join(repr(float(v)) for v in values)


def quaternion(R: Floats) -> str:
    """Quaternion of a rotation, scalar first, for an attribute."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(R).reshape(9))
    return as_text(quat)


def mjcf(tables: SceneTables) -> str:
    """The scene's tables as a MuJoCo model."""
    lines: dict[int, list[str]] = {-1: []}
    for b in range(len(tables.parent)):
        T = tables.T_parent_joint[b].reshape(3, 4)
        kind = {1: "hinge", 2: "slide"}.get(int(tables.joint_kind[b]))
        at = f'pos="{as_text(T[:, 3])}" quat="{quaternion(T[:, :3])}"'
        lines[b] = [
            f'<body name="b{b}" {at}>',
            '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
        ]
        if kind:
            axis = as_text(tables.axis[b])
            lines[b].append(f'<joint name="j{b}" type="{kind}" axis="{axis}"/>')
    for i, kind in enumerate(tables.kinds):
        lines[int(tables.bodies[i])].append(
            geom(i, int(kind), tables.local_rows[i], tables.margin)
        )
    children: dict[int, list[int]] = {}
    for b, up in enumerate(tables.parent):
        children.setdefault(int(up), []).append(b)

    def tree(b: int) -> str:
        inner = "".join(tree(child) for child in children.get(b, []))
        return "\n".join(lines[b]) + inner + ("</body>" if b >= 0 else "")

    excluded = exclusions(tables)
    return (
        "<mujoco><option><flag filterparent='disable'/></option>"
        "<size memory='64M'/>"
        f"<worldbody>{tree(-1)}</worldbody><contact>{excluded}</contact></mujoco>"
    )


def geom(i: int, kind: int, row: Floats, margin: float) -> str:
    """A primitive as a geom; half of the margin is its own."""
    common = f'<geom name="p{i}" margin="{margin!r}" gap="{margin!r}" '
    if kind == ShapeKind.SPHERE:
        return (
            common
            + f'type="sphere" size="{float(row[0])!r}" pos="{as_text(row[1:4])}"/>'
        )
    if kind == ShapeKind.CAPSULE:
        ends = as_text(row[1:7])
        return common + f'type="capsule" size="{float(row[0])!r}" fromto="{ends}"/>'
    # MuJoCo has no rounded box; the benchmark's scenes have none either.
    half, R = as_text(row[4:7] + row[0]), row[7:16].reshape(3, 3)
    return common + (
        f'type="box" size="{half}" pos="{as_text(row[1:4])}" quat="{quaternion(R)}"/>'
    )


def exclusions(tables: SceneTables) -> str:
    """Pairs of bodies that are not checked.

    MuJoCo leaves out pairs of bodies, not of geoms: where only some geoms of the world
    are allowed to touch a body, they are filtered from the answer instead.
    """
    bodies = range(len(tables.parent))
    groups = [tables.groups[tables.bodies == body] for body in bodies]
    return "".join(
        f'<exclude body1="b{a}" body2="b{b}"/>'
        for a, b in combinations(bodies, 2)
        if not tables.checked[np.ix_(groups[a], groups[b])].any()
    )


class MujocoMargin:
    """`mj_kinematics`, `mj_comPos` and `mj_collision`, margins on all geoms.

    `mj_collision` needs what `mj_comPos` computes for its bounding volumes.
    """

    name = "mujoco"

    def __init__(self, tables: SceneTables) -> None:
        self.tables = tables
        self.model = mujoco.MjModel.from_xml_string(mjcf(tables))
        self.data = mujoco.MjData(self.model)
        bodies = np.flatnonzero(tables.joint_kind != 0)
        self.address = np.array([self.model.joint(f"j{b}").qposadr[0] for b in bodies])
        self.source = tables.q_index[bodies]
        self.gain = tables.gain[bodies]

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
