"""The arms of a scene as a MuJoCo model with masses, friction, motors and payloads."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from armguard.benchmark.peers.mujoco_margin import as_text
from armguard.robot.kinematics import REVOLUTE, KinematicTable, kinematic_table
from armguard.robot.stopping import StoppingFigures
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from armguard.scene.scene import SceneRobot
from arrays import Floats, Ints
from closed_loop.judge_model import placed
from closed_loop.settings import SUBSTEP
from closed_loop.truth import joined

# Friction of a joint: Coulomb, and viscous at top speed, in shares of its torque [-].
COULOMB = 0.02
VISCOUS = 0.03

# Inertia of a motor seen through its gear, in shares of torque limit by [1 rad/s²].
ROTOR = 0.002

# Bandwidth of the servo loop [rad/s], and its damping ratio [-].
BANDWIDTH = 200.0
DAMPING = 1.0

# Configurations over which the servo's nominal inertia of a joint is averaged.
SAMPLES = 64

# Share of its torque a motor needs at most to carry the heaviest payload through any
# sampled state, accelerated or stopped as hard as declared [-], and how many states.
NEEDED, STATES = 1.0, 1500

# How far a payload's centre of mass is from the last joint, and its radius of
# gyration [m].
PAYLOAD_ARM = 0.15
GYRATION = 0.05

# Mass of no payload [kg].
LIGHT = 1e-3

# Gravity [m/s²].
G = 9.81


class TorqueModel(NamedTuple):
    """The model, and what its servo drives know of it.

    Attributes:
        model: MuJoCo's model, one joint and one motor for each driven joint.
        driven: Places of q that motors drive, shape (k,); grippers hold theirs.
        stiffness: Position gain of each servo, shape (k,) [N m/rad].
        damping: Velocity gain of each servo, shape (k,) [N m s/rad].
        inertia: Nominal inertia of each joint, shape (k,) [kg m²].
        payloads: Bodies of the payloads, one for each arm.
        heaviest: Greatest payload of an arm [kg].
    """

    model: mujoco.MjModel
    driven: Ints
    stiffness: Floats
    damping: Floats
    inertia: Floats
    payloads: list[int]
    heaviest: float


class Motor(NamedTuple):
    """A driven joint.

    Attributes:
        name: Of the joint in MuJoCo's model.
        place: Its place in the scene's q.
        torque: Greatest torque of its motor, behind the gear [N m].
        velocity: Its top speed [rad/s].
    """

    name: str
    place: int
    torque: float
    velocity: float


def torque_model(scene: Scene, figures: Sequence[StoppingFigures]) -> TorqueModel:
    """Motors, friction, gravity and payloads of all arms of a scene.

    Args:
        scene: The scene.
        figures: Declared figures of each arm.
    """
    bodies, motors, first = "", [], 0
    for robot in scene.robots.values():
        table = kinematic_table(robot.model)
        own = list(motors_of(robot, table, first))
        bodies += arm(robot, table, own)
        motors += own
        first += table.q_count
    text = (
        f'<mujoco><compiler angle="radian" balanceinertia="true"/>'
        f'<option timestep="{SUBSTEP!r}" gravity="0 0 -{G}" '
        'integrator="implicitfast"><flag contact="disable"/></option>'
        f"<worldbody>{bodies}</worldbody>"
        f"<actuator>{''.join(map(actuator, motors))}</actuator></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(text)
    places = np.array([motor.place for motor in motors])
    payloads = [model.body(f"{name}:payload").id for name in scene.robots]
    heaviest = heaviest_payload(model, places, payloads, scene, figures)
    # Gains fit an arm with half of that.
    for body in payloads:
        carry(model, body, 0.5 * heaviest)
    inertia = nominal_inertia(model)
    stiffness, damping = BANDWIDTH**2 * inertia, 2 * DAMPING * BANDWIDTH * inertia
    model.actuator_gainprm[:, 0] = stiffness
    model.actuator_biasprm[:, 1], model.actuator_biasprm[:, 2] = -stiffness, -damping
    return TorqueModel(model, places, stiffness, damping, inertia, payloads, heaviest)


def carry(model: mujoco.MjModel, body: int, mass: float) -> None:
    """Give an arm a payload; `mj_setConst` has to follow.

    Args:
        model: The model.
        body: Body of the payload.
        mass: Its mass, > 0 [kg].
    """
    model.body_mass[body] = mass
    model.body_inertia[body] = mass * GYRATION**2


def heaviest_payload(
    model: mujoco.MjModel,
    places: Ints,
    payloads: list[int],
    scene: Scene,
    figures: Sequence[StoppingFigures],
) -> float:
    """Heaviest payload with which motors keep the declared figures anywhere [kg].

    The torques that a state needs are affine in the mass, so two masses tell all.

    Args:
        model: The model.
        places: Places of q that motors drive.
        payloads: Bodies of the payloads.
        scene: The scene.
        figures: Declared figures of each arm.

    Raises:
        ValueError: The motors are too weak for the arms alone.
    """
    rng, data = np.random.default_rng(0), mujoco.MjData(model)
    tables = compile_scene(scene)
    lower = np.maximum(tables.lower[places], -np.pi)
    upper = np.minimum(tables.upper[places], np.pi)
    speed = joined(figures, "velocity")[places]
    most = joined(figures, "deceleration_most")
    hardest = np.maximum(joined(figures, "acceleration"), most)[places]
    limit = NEEDED * model.jnt_actfrcrange[:, 1]
    states = [
        (
            rng.uniform(lower, upper),
            speed * rng.choice([-1.0, 1.0], model.nv),
            hardest * rng.choice([-1.0, 1.0], model.nv),
        )
        for _ in range(STATES)
    ]
    needed = []
    for mass in (LIGHT, 1.0):
        for body in payloads:
            carry(model, body, mass)
        mujoco.mj_setConst(model, data)
        rows = []
        for data.qpos[:], data.qvel[:], data.qacc[:] in states:
            mujoco.mj_inverse(model, data)
            rows.append(data.qfrc_inverse.copy())
        needed.append(np.array(rows))
    alone, more = needed[0], needed[1] - needed[0]
    room = (limit - np.sign(more) * alone) / np.maximum(np.abs(more), 1e-9)
    heaviest = float(room.min())
    if heaviest <= LIGHT:
        raise ValueError("the motors are too weak for the arms' declared figures")
    return heaviest


def motors_of(robot: SceneRobot, table: KinematicTable, first: int) -> Iterator[Motor]:
    """Motors of the joints of an arm that turn; its gripper is not driven."""
    limits = {}
    for element in ElementTree.parse(robot.model.path).getroot().iter("joint"):
        limit = element.find("limit")
        if limit is not None:
            limits[element.get("name")] = float(limit.get("effort", "0"))
    for body in np.flatnonzero(table.joint_kind == REVOLUTE).tolist():
        place = int(table.q_index[body])
        name = robot.model.q_names[place]
        joint = robot.model.joints[name]
        yield Motor(f"{robot.name}:{body}", first + place, limits[name], joint.velocity)


def arm(robot: SceneRobot, table: KinematicTable, motors: list[Motor]) -> str:
    """Bodies of an arm, from its base to its payload."""
    inertials = dict(inertials_of(robot))
    own = {motor.name: motor for motor in motors}
    children: dict[int, list[int]] = {}
    for body, parent in enumerate(table.parent.tolist()):
        children.setdefault(parent, []).append(body)

    def body_of(body: int) -> str:
        T = np.eye(4)
        T[:3] = table.T_parent_joint[body].reshape(3, 4)
        if body == 0:
            T = robot.base.matrix()
        name = f"{robot.name}:{body}"
        inner = joint(own[name], table.axis[body]) if name in own else ""
        for link, place in table.body_of_link.items():
            if place == body and link in inertials:
                frame = placed(table.T_body_link[link])
                inner += f"<body {frame}>{inertials[link]}</body>"
        if name == motors[-1].name:
            arms = PAYLOAD_ARM * np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
            inner += (
                f'<body name="{robot.name}:payload"><inertial mass="1" '
                f'pos="{as_text(arms)}" diaginertia="1e-3 1e-3 1e-3"/></body>'
            )
        below = "".join(body_of(child) for child in children.get(body, []))
        return f"<body {placed(T)}>{inner}{below}</body>"

    return "".join(body_of(root) for root in children[-1])


def inertials_of(robot: SceneRobot) -> Iterator[tuple[str, str]]:
    """Mass and inertia of each link of the robot's URDF that has any."""
    for link in ElementTree.parse(robot.model.path).getroot().findall("link"):
        found = link.find("inertial")
        if found is None or float(found.find("mass").get("value")) == 0.0:
            continue
        T, origin = np.eye(4), found.find("origin")
        if origin is not None:
            rpy = [float(x) for x in origin.get("rpy", "0 0 0").split()]
            T[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
            T[:3, 3] = [float(x) for x in origin.get("xyz", "0 0 0").split()]
        six = found.find("inertia")
        ixx, iyy, izz, ixy, ixz, iyz = (
            float(six.get(name, "0"))
            for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        moments, axes = np.linalg.eigh(tensor)
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] = -axes[:, 0]
        T[:3, :3] = T[:3, :3] @ axes
        mass = float(found.find("mass").get("value"))
        yield (
            link.get("name", ""),
            f'<inertial mass="{mass!r}" {placed(T)} diaginertia="{as_text(moments)}"/>',
        )


def joint(motor: Motor, axis: Floats) -> str:
    """A joint with friction, a motor's inertia and the limit of its torque."""
    return (
        f'<joint name="{motor.name}" axis="{as_text(axis)}" '
        f'frictionloss="{COULOMB * motor.torque!r}" '
        f'damping="{VISCOUS * motor.torque / motor.velocity!r}" '
        f'armature="{ROTOR * motor.torque!r}" '
        f'actuatorfrclimited="true" '
        f'actuatorfrcrange="-{motor.torque!r} {motor.torque!r}"/>'
    )


def actuator(motor: Motor) -> str:
    """The servo of a joint; its gains are set later."""
    return f'<general joint="{motor.name}" biastype="affine"/>'


def nominal_inertia(model: mujoco.MjModel) -> Floats:
    """Diagonal of the mass matrix, its mean over random configurations, shape (k,)."""
    rng, data = np.random.default_rng(0), mujoco.MjData(model)
    full = np.zeros((model.nv, model.nv))
    found = np.zeros(model.nv)
    mujoco.mj_setConst(model, data)
    for _ in range(SAMPLES):
        data.qpos[:] = rng.uniform(-1.5, 1.5, model.nq)
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        found += np.diag(full) / SAMPLES
    return found
