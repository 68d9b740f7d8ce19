"""A Panda as MuJoCo sees it: its own meshes, where they are, and how its hand moves."""

from math import pi

import mujoco
import numpy as np

from armguard.benchmark.peers.mujoco_margin import as_text
from armguard.geometry import Pose
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Joint, JointKind, MeshFile, RobotModel
from arrays import Floats
from closed_loop.judge_model import kind_and_size, placed
from gripping.solids import Solid

# Where it stands: its base is beside the table [m].
BASE = (-0.6, 0.0, 0.0)

# Links by what the judge calls them; all others by their own names.
HAND = "panda_hand"
PARTS = {HAND: "hand", "panda_leftfinger": "left", "panda_rightfinger": "right"}

# Joints of the arm; its last position is that of both fingers.
ARM = 7

# Axes of a hand that looks down, with its fingers one beside the other along y.
DOWN = np.diag([1.0, -1.0, -1.0])

# Posture the arm is drawn to as far as that leaves the hand where it is [rad], and how
# hard [1/s].
POSTURE = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, pi / 4.0])
DRAWN = 4.0

# How fast the hand is turned back to look down [1/s].
UPRIGHT = 15.0

# A joint that is so near to its limit is at it [rad].
AT_LIMIT = 0.03

# Damping of what leads the hand, so that it stays slow where the arm is stretched.
DAMPED = 1e-6 * np.eye(6)


class PandaArm:
    """The arm, its hand and all that stands round it, as a model of MuJoCo.

    Attributes:
        model: MuJoCo's model.
        data: Where everything is, after `put`.
        parts: What the judge calls the link of each geom of the arm, in order.
        solids: Number of the geom of each solid.
        limits: Least and greatest positions of the arm's joints, shape (2, 7) [rad].

    Args:
        model: The robot.
        solids: What stands round it, by name.
    """

    def __init__(self, model: RobotModel, solids: dict[str, Solid]) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf(model, solids))
        self.data = mujoco.MjData(self.model)
        m = self.model
        names = [m.body(int(m.geom_bodyid[g])).name for g in range(m.ngeom)]
        self.parts = {
            g: PARTS.get(name, name) for g, name in enumerate(names) if name != "world"
        }
        self.solids = {name: m.geom(f"solid:{name}").id for name in solids}
        joints = [model.joints[f"panda_joint{k + 1}"] for k in range(ARM)]
        self.limits = np.array([[j.lower for j in joints], [j.upper for j in joints]])
        self._hand = m.body(HAND).id
        self._jacobian = np.zeros((2, 3, m.nv))

    def put(self, q: Floats) -> None:
        """Put the arm to joint positions, shape (8,)."""
        self.data.qpos[:] = [*q, q[ARM]]
        mujoco.mj_kinematics(self.model, self.data)

    def hand(self, q: Floats) -> Floats:
        """Pose of the hand in the world, shape (4, 4)."""
        self.put(q)
        T = np.eye(4)
        T[:3, :3] = self.data.xmat[self._hand].reshape(3, 3)
        T[:3, 3] = self.data.xpos[self._hand]
        return T

    def lead(self, q: Floats, velocity: Floats) -> Floats:
        """Joint velocities that move the hand, and keep it looking down.

        Args:
            q: Joint positions, shape (8,).
            velocity: Velocity of the hand, shape (3,) [m/s].

        Returns:
            Velocities of the arm's joints, shape (7,) [rad/s].
        """
        R = self.hand(q)[:3, :3]
        mujoco.mj_comPos(self.model, self.data)
        place, turn = self._jacobian
        mujoco.mj_jacBody(self.model, self.data, place, turn, self._hand)
        # Half the sum of the axes' cross products with those of `DOWN`.
        off = (R[2, 1] - R[1, 2], R[2, 0] + R[0, 2], -R[0, 1] - R[1, 0])
        wanted = np.array([*velocity, *off])
        wanted[3:] *= 0.5 * UPRIGHT
        J = self._jacobian.reshape(6, -1)[:, :ARM]
        drawn = DRAWN * (POSTURE - q[:ARM])
        free = np.ones(ARM)
        for _ in range(ARM):
            own = J * free
            push = np.linalg.solve(own @ own.T + DAMPED, wanted - own @ drawn)
            speeds = free * (own.T @ push + drawn)
            # What a joint at its limit would do is left to the others.
            up = (q[:ARM] > self.limits[1] - AT_LIMIT) & (speeds > 0.0)
            down = (q[:ARM] < self.limits[0] + AT_LIMIT) & (speeds < 0.0)
            if not (up | down).any():
                break
            free[up | down] = 0.0
        return np.asarray(speeds)


def mjcf(model: RobotModel, solids: dict[str, Solid]) -> str:
    """The robot by its own files, and what stands round it, as text."""
    assets: list[str] = []
    children: dict[str, list[Joint]] = {}
    for joint in model.joints.values():
        children.setdefault(joint.parent, []).append(joint)

    def tree(link: str, frame: str, moved: str) -> str:
        below = ""
        for joint in children.get(link, []):
            below += tree(joint.child, placed(joint.T_parent_joint), as_joint(joint))
        inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        own = geoms(model, link, assets)
        return f'<body name="{link}" {frame}>{inertia}{moved}{own}{below}</body>'

    robot = tree(model.root, placed(Pose(xyz=BASE).matrix()), "")
    around = "".join(as_geom(name, solid) for name, solid in solids.items())
    return (
        f"<mujoco><asset>{''.join(assets)}</asset>"
        f"<worldbody>{around}{robot}</worldbody></mujoco>"
    )


def geoms(model: RobotModel, link: str, assets: list[str]) -> str:
    """The shapes of a link as its files have them; meshes are added to the assets."""
    text = ""
    for k, element in enumerate(model.links[link].collisions):
        if isinstance(element.geometry, MeshFile):
            corners = load_triangles(element.geometry).reshape(-1, 3)
            vertices = as_text(np.unique(corners, axis=0).ravel())
            assets.append(f'<mesh name="{link}{k}" vertex="{vertices}"/>')
            kind = f'type="mesh" mesh="{link}{k}"'
        else:
            kind = kind_and_size(element.geometry)
        text += f"<geom {kind} {placed(element.T_link_geometry)}/>"
    return text


def as_joint(joint: Joint) -> str:
    """A joint of a body as text; nothing where the body does not move."""
    kind = {JointKind.REVOLUTE: "hinge", JointKind.PRISMATIC: "slide"}.get(joint.kind)
    if kind is None:
        return ""
    return f'<joint type="{kind}" axis="{as_text(joint.axis)}"/>'


def as_geom(name: str, solid: Solid) -> str:
    """Something that stands, as text."""
    at = f'name="solid:{name}" pos="{as_text(solid.at)}"'
    if solid.radius:
        sizes = f"{solid.radius!r} {float(solid.half[2])!r}"
        return f'<geom type="cylinder" size="{sizes}" {at}/>'
    return f'<geom type="box" size="{as_text(solid.half)}" {at}/>'
