"""Arms with limited torque: servos follow the set-points of the plant's drives.

The double integrators of `plant.py` are the drives' set-point generators. A servo for
each joint, with feed-forward, follows them against gravity, friction, the coupling of
the joints and a payload that it knows only roughly. What moves is MuJoCo's model.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple
from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from armguard.robot.kinematics import REVOLUTE, KinematicTable, kinematic_table
from armguard.robot.stopping import StoppingFigures
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from armguard.scene.scene import SceneRobot
from arrays import Floats, Ints
from closed_loop.settings import SUBSTEP
from closed_loop.truth import UNKNOWN, joined
from peers.mujoco_margin import placed, quaternion_of

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
        payloads: Bodies of the payloads, one for each arm.
        heaviest: Greatest payload of an arm [kg].
    """

    model: mujoco.MjModel
    driven: Ints
    stiffness: Floats
    damping: Floats
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
    spec = mujoco.MjSpec()
    spec.compiler.balanceinertia = True
    spec.option.timestep, spec.option.gravity = SUBSTEP, (0.0, 0.0, -G)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    motors, first = [], 0
    for robot in scene.robots.values():
        table = kinematic_table(robot.model)
        own = list(motors_of(robot, table, first))
        add_arm(spec, robot, table, own)
        motors += own
        first += table.q_count
    for motor in motors:
        # A servo; its gains are set later.
        joint, affine = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtBias.mjBIAS_AFFINE
        spec.add_actuator(trntype=joint, target=motor.name, biastype=affine)
    model = spec.compile()
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
    return TorqueModel(model, places, stiffness, damping, payloads, heaviest)


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

    The torques that a state needs are affine in the mass, so two masses determine them.

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


def add_arm(
    spec: mujoco.MjSpec, robot: SceneRobot, table: KinematicTable, motors: list[Motor]
) -> None:
    """Add the bodies of an arm, from its base to its payload."""
    inertials = dict(inertials_of(robot))
    own = {motor.name: motor for motor in motors}
    bodies = {-1: spec.worldbody}
    for b, up in enumerate(table.parent.tolist()):
        T = table.T_parent_joint[b].reshape(3, 4) if b else robot.base.matrix()
        bodies[b] = body = bodies[up].add_body(**placed(T))
        name = f"{robot.name}:{b}"
        if name in own:
            body.add_joint(axis=table.axis[b], **joint(own[name]))
        for link, place in table.body_of_link.items():
            if place == b and link in inertials:
                frame = placed(table.T_body_link[link])
                body.add_body(**frame, explicitinertial=True, **inertials[link])
        if name == motors[-1].name:
            body.add_body(
                name=f"{robot.name}:payload",
                explicitinertial=True,
                mass=1.0,
                ipos=PAYLOAD_ARM * np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0),
                inertia=(1e-3, 1e-3, 1e-3),
            )


def inertials_of(robot: SceneRobot) -> Iterator[tuple[str, dict[str, Any]]]:
    """Mass and inertia of each link of the robot's URDF that has any, as attributes."""
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
        turn = quaternion_of(T[:3, :3])
        frame = {"ipos": T[:3, 3], "iquat": turn, "inertia": moments}
        yield link.get("name", ""), {"mass": mass, **frame}


def joint(motor: Motor) -> dict[str, Any]:
    """A joint with friction, a motor's inertia and the limit of its torque."""
    return {
        "name": motor.name,
        "frictionloss": COULOMB * motor.torque,
        "damping": VISCOUS * motor.torque / motor.velocity,
        "armature": ROTOR * motor.torque,
        "actfrclimited": True,
        "actfrcrange": (-motor.torque, motor.torque),
    }


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


# Substeps between two looks of the feed-forward at the arms' model: 1 kHz.
FEED_FORWARD = 4

# Share of the payload's mass that the servos know, least and most [-].
KNOWN = (0.85, 1.05)


# What is left to the servos of each declared figure; the rest is the drives'. Shares of
# speeds, of accelerations and decelerations, of ramps and errors [-], and part of the
# delays [s].
FASTER, HARDER, HALF, LATER = 0.03, 0.15, 0.5, 0.001


def driven_figures(figures: StoppingFigures) -> StoppingFigures:
    """Figures of the drives and sensors alone, so that the arm keeps the declared.

    Args:
        figures: Declared figures of an arm.
    """
    least = figures.deceleration / (1.0 - HARDER)
    most = np.minimum(figures.deceleration_most, UNKNOWN * figures.deceleration)
    return replace(
        figures,
        velocity=(1.0 - FASTER) * figures.velocity,
        acceleration=(1.0 - HARDER) * figures.acceleration,
        deceleration=least,
        deceleration_most=np.maximum((1.0 - HARDER) * most, least),
        brake_deceleration=figures.brake_deceleration / (1.0 - HARDER),
        ramp=HALF * figures.ramp,
        # The swing is the arm's own.
        settle=np.zeros_like(figures.settle),
        command=figures.command - LATER,
        brake_delay=figures.brake_delay - LATER,
        position_error=HALF * figures.position_error,
        velocity_error=HALF * figures.velocity_error,
        tracking_error=HALF * figures.tracking_error,
    )


class TorqueArms:
    """All arms of a scene.

    Attributes:
        built: Their model.
        saturated: Substeps in which a motor gave all its torque.

    Args:
        built: Their model.
    """

    def __init__(self, built: TorqueModel) -> None:
        self.built = built
        self._model, self._data = built.model, mujoco.MjData(built.model)
        # What the servos believe: the same arms, with another payload, no friction.
        self._nominal = copy(built.model)
        self._believed = mujoco.MjData(self._nominal)
        self._limits = built.model.jnt_actfrcrange[:, 1]
        self._before = np.zeros(len(built.driven))
        self._torque = np.zeros(len(built.driven))
        self.saturated = 0

    def start(self, q: Floats, rng: np.random.Generator, *, full: bool) -> None:
        """Rest at a configuration, with another payload.

        Args:
            q: Positions, shape (n,) [rad or m].
            rng: Of the episode.
            full: Whether payloads are the heaviest.
        """
        model, built = self._model, self.built
        for body in built.payloads:
            mass = built.heaviest * (1.0 if full else rng.uniform(LIGHT, 1.0))
            carry(model, body, mass)
            carry(self._nominal, body, mass * rng.uniform(*KNOWN))
        for m, data in ((model, self._data), (self._nominal, self._believed)):
            mujoco.mj_setConst(m, data)
            mujoco.mj_resetData(m, data)
            data.qpos[:] = q[built.driven]
        self._before[:] = 0.0
        self.saturated = 0

    def follow(self, q_rows: Floats, v_rows: Floats) -> None:
        """Move the arms after the set-points of some substeps.

        Args:
            q_rows: Set-points of positions after each substep, shape (k, n); positions
                of the arms from then on [rad or m].
            v_rows: The same of velocities, shape (k, n) [rad/s or m/s].
        """
        model, data, built = self._model, self._data, self.built
        q, v = q_rows[:, built.driven], v_rows[:, built.driven]
        pushed = np.diff(v, axis=0, prepend=self._before[None]) / SUBSTEP
        self._before = v[-1].copy()
        for k in range(len(q)):
            if k % FEED_FORWARD == 0:
                self._believed.qpos[:], self._believed.qvel[:] = q[k], v[k]
                mujoco.mj_fwdPosition(self._nominal, self._believed)
                mujoco.mj_fwdVelocity(self._nominal, self._believed)
            mujoco.mj_mulM(self._nominal, self._believed, self._torque, pushed[k])
            self._torque += self._believed.qfrc_bias
            self._torque += built.damping * v[k]
            data.ctrl[:] = q[k] + self._torque / built.stiffness
            mujoco.mj_step(model, data)
            q[k], v[k] = data.qpos, data.qvel
            spent = np.abs(data.qfrc_actuator) >= self._limits * (1.0 - 1e-9)
            self.saturated += bool(spent.any())
        q_rows[:, built.driven], v_rows[:, built.driven] = q, v
