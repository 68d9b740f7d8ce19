"""A Panda picks something up among clutter and puts it down where it is free."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import pi, sqrt
from time import process_time
from typing import Any

import mujoco
import numpy as np

from armguard.errors import ArmguardError
from armguard.geometry import Pose
from armguard.respond import Action, Command, Guard
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Cylinder, JointKind, MeshFile, RobotModel
from armguard.scene import Gripper, Scene
from arrays import Floats
from closed_loop.judge_model import element, hull
from gripping.judge import FINGERS, HELD, Judge, Pair
from gripping.pick_and_place import (
    Outcome,
    Picker,
    carries_clear,
    ends_of_way,
    figures_of,
    pick_and_place,
)
from gripping.plant import Plant
from gripping.workplace import PERIOD, STOPPING, Solid, Tool, Workplace, box, cluttered
from peers.mujoco_margin import GEOM, INERTIA, JOINTS, placed

# Where it is: its base is beside the table [m].
BASE = (-0.6, 0.0, 0.0)

# Links by what the judge calls them; all others by their own names.
HAND = "panda_hand"
PARTS = {HAND: "hand", "panda_leftfinger": "left", "panda_rightfinger": "right"}

# Joints of the arm; its last position is that of both fingers.
ARM = 7

# Joints that move as MuJoCo has them.
MOVES = {JointKind.REVOLUTE: JOINTS[1], JointKind.PRISMATIC: JOINTS[2]}

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
    """The arm, its hand and all that is round it, as a model of MuJoCo.

    Attributes:
        model: MuJoCo's model.
        data: Where everything is, after `put`.
        parts: What the judge calls the link of each geom of the arm, in order.
        solids: Number of the geom of each solid.
        limits: Least and greatest positions of the arm's joints, shape (2, 7) [rad].

    Args:
        model: The robot.
        solids: What is round it, by name.
    """

    def __init__(self, model: RobotModel, solids: dict[str, Solid]) -> None:
        self.model = model_of(model, solids)
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


def model_of(robot: RobotModel, solids: dict[str, Solid]) -> mujoco.MjModel:
    """The robot by its own files, and what is round it."""
    spec = mujoco.MjSpec()
    world = spec.worldbody
    for name, solid in solids.items():
        shape = {"type": GEOM.mjGEOM_BOX, "size": solid.half}
        if solid.radius:
            shape = element(Cylinder(solid.radius, 2.0 * float(solid.half[2])))
        world.add_geom(name=f"solid:{name}", pos=solid.at, **shape)
    base = placed(Pose(xyz=BASE).matrix())
    root = world.add_body(name=robot.root, **base, **INERTIA)
    add_link(spec, robot, robot.root, root)
    return spec.compile()


def add_link(spec: mujoco.MjSpec, robot: RobotModel, link: str, body: Any) -> None:
    """Add the shapes of a link as its files have them, and the links it carries."""
    for k, part in enumerate(robot.links[link].collisions):
        shape = (
            hull(
                spec,
                f"{link}{k}",
                np.unique(load_triangles(part.geometry).reshape(-1, 3), axis=0),
            )
            if isinstance(part.geometry, MeshFile)
            else element(part.geometry)
        )
        body.add_geom(**shape, **placed(part.T_link_geometry))
    for joint in robot.joints.values():
        if joint.parent == link:
            frame = placed(joint.T_parent_joint)
            child = body.add_body(name=joint.child, **frame, **INERTIA)
            if kind := MOVES.get(joint.kind):
                child.add_joint(type=kind, axis=joint.axis)
            add_link(spec, robot, joint.child, child)


# Distance up to which pairs are measured [m].
SIGHT = 0.03

# What is held touches the hand and its fingers, and that is no contact.
GRIPPER = ("hand", *FINGERS)

# How far what is held may reach beyond the upright solid it is, as the hand that
# carries it is not quite upright [m].
TILTED = 0.005


class PandaJudge(Judge):
    """Looks at true joint positions, one stretch of time after the other.

    Args:
        place: The workplace.
        arm: The Panda in it.
    """

    def __init__(self, place: Workplace, arm: PandaArm) -> None:
        super().__init__(place, PERIOD)
        self.arm = arm
        self._poses = {name: upright(solid) for name, solid in self.solids.items()}
        self._T_hand_held = np.eye(4)
        # Boxes round the solids, none of which turns but what is held, by little.
        self._half = np.array([half_of(solid) for solid in self.solids.values()])

    def grasp(self, q: Floats, name: str) -> None:
        """From now on something is carried."""
        self.held = name
        self._T_hand_held = np.linalg.inv(self.arm.hand(q)) @ self._poses[name]
        self._fingers = q[-1:]

    def release(self, q: Floats) -> None:
        """From now on it stays where it is."""
        if self.held is not None:
            T = self.arm.hand(q) @ self._T_hand_held
            self._poses[self.held] = T
            self.solids[self.held] = self.solids[self.held].moved_to(T[:3, 3])
            self.held = None

    def gap(self, q: Floats, part: str, other: str) -> float:
        """True distance of a part of the arm and something else [m]."""
        return self.near(q).get((part, other), SIGHT)

    def near(self, q: Floats) -> dict[Pair, float]:
        """Signed distances of all that is in sight at joint positions [m]."""
        self._put(q)
        arm, m, data = self.arm, self.arm.model, self.arm.data
        geoms, parts = list(arm.parts), list(arm.parts.values())
        if self.held is not None:
            geoms, parts = [*geoms, arm.solids[self.held]], [*parts, HELD]
        names = list(self.solids)
        others = [arm.solids[name] for name in names]
        apart = np.abs(data.geom_xpos[geoms][:, None] - data.geom_xpos[others])
        outside = np.maximum(apart - self._half, 0.0)
        bound = np.sqrt(np.einsum("ijk,ijk->ij", outside, outside))
        bound -= m.geom_rbound[geoms][:, None]
        found: dict[Pair, float] = {}
        for i, j in np.argwhere(bound < SIGHT + TILTED):
            pair = parts[i], names[j]
            if self._judged(*pair):
                a, b = geoms[i], others[j]
                distance = mujoco.mj_geomDistance(m, data, a, b, SIGHT, None)
                found[pair] = min(found.get(pair, SIGHT), distance)
        return found

    def _distances(self, q: Floats) -> Iterator[tuple[Pair, Floats]]:
        """See `Judge`."""
        parts = dict.fromkeys([*self.arm.parts.values(), *[HELD] * bool(self.held)])
        near = [self.near(row) for row in q]
        for pair in product(parts, self.solids):
            if self._judged(*pair):
                yield pair, np.array([found.get(pair, SIGHT) for found in near])

    def _judged(self, part: str, name: str) -> bool:
        """Whether a part of the arm and something else are two."""
        return name != self.held or part not in (*GRIPPER, HELD)

    def _put(self, q: Floats) -> None:
        """Put the arm, and what it carries, to where they are at joint positions."""
        hand = self.arm.hand(q)
        if self.held is not None:
            self._poses[self.held] = hand @ self._T_hand_held
        data = self.arm.data
        for name, T in self._poses.items():
            geom = self.arm.solids[name]
            data.geom_xpos[geom] = T[:3, 3]
            data.geom_xmat[geom] = T[:3, :3].ravel()


def half_of(solid: Solid) -> Floats:
    """Half of the sizes of the box round a solid, shape (3,) [m]."""
    return solid.half + np.array([solid.radius, solid.radius, 0.0])


def upright(solid: Solid) -> Floats:
    """Pose of a solid, shape (4, 4)."""
    T = np.eye(4)
    T[:3, 3] = solid.at
    return T


# The hand and its fingers, about the frame `panda_hand`.
PANDA = Tool(
    tips=0.113, palm=0.084, hand=(0.035, 0.106), finger=(0.011, 0.026), widest=0.04
)

# Joints stop, are late and miss their commands as those of the gantry; their top
# speeds are Franka's. Nothing swings, as the plant does not.
FIGURES = {key: value for key, value in STOPPING.items() if key != "velocity"} | {
    "velocity_error": 1e-3,
    "ramp": 0.0,
    "settle": 0.0,
    "settle_time": 0.0,
}

# The table ends beside the base; half of its sizes, and its middle [m].
TABLE = box((0.8, 1.0, 0.05), (0.35, 0.0, -0.05))

# How fast a way is gone that is looked at before, and how often it is [m/s, s].
SPEED, STEP = 0.3, 0.02

# Longest time for a straight piece of it [s], and how near its end counts [m].
LONGEST, NEAR = 4.0, 1e-3

# Longest time for which an operator pushes [s], and the gain that brings a hand back
# that slides meanwhile [1/s].
PUSHED, STIFF = 10.0, 25.0

# Share of the speed with which an operator tries again.
SLOWER = 0.6

# How far joints stay off their limits on such a way [rad], and the arm off everything:
# its elbow is elsewhere when the hand goes the same way at another speed [m].
OFF_LIMITS, CLEAR = 0.1, 0.025


@dataclass(frozen=True)
class PandaPlace(Workplace):
    """A workplace whose robot is a Panda.

    Attributes:
        posture: Joint positions it begins with, shape (8,).
    """

    posture: Floats

    def robot(self) -> tuple[Any, dict[str, Any]]:
        """See `Workplace`."""
        names = [f"panda_joint{k + 1}" for k in range(ARM)] + ["panda_finger_joint1"]
        fingers = "panda_leftfinger", "panda_rightfinger"
        return "panda", {
            "base": Pose(xyz=BASE),
            "stopping": FIGURES,
            "home": dict(zip(names, self.posture.tolist(), strict=True)),
            "gripper": Gripper(link=HAND, fingers=fingers, coarse=self.coarse),
        }


class PandaPlant(Plant):
    """A Panda that is late and misses its commands, led by its hand.

    Args:
        guard: The guard.
        rng: Draws delays and errors.
        arm: The Panda as MuJoCo sees it.
    """

    fingers = slice(ARM, ARM + 1)

    def __init__(self, guard: Guard, rng: np.random.Generator, arm: PandaArm) -> None:
        super().__init__(guard, rng)
        self.arm = arm

    @property
    def seen(self) -> Floats:
        """Where hand and fingers are as measured last: x, y, z, left, right [m]."""
        at = self.arm.hand(self.measured)[:3, 3]
        return np.array([*at, self.measured[ARM], self.measured[ARM]])

    def cycle(self, desired: Floats) -> Command:
        """One cycle with desired velocities of hand and fingers [m/s]."""
        if not desired.any():
            return self.drive(np.zeros(ARM + 1))
        joints = self.arm.lead(self.measured, desired[:3])
        return self.drive(np.array([*joints, 0.5 * (desired[3] + desired[4])]))


class PandaPicker(Picker):
    """An operator who brings a hand back that slides while pushing."""

    def push(self, desired: Floats, part_of: tuple[str, ...], other: str) -> bool:
        """Desire the same until all these parts are felt to touch; whether they do."""
        here = self.plant.seen[:3]
        for _ in range(int(PUSHED / PERIOD)):
            q = self.plant.q
            if all(self.judge.gap(q, part, other) <= 0.0 for part in part_of):
                return True
            held = desired.copy()
            back = STIFF * (here - self.plant.seen[:3])
            held[:3] = np.where(desired[:3] == 0.0, back, desired[:3])
            if self.plant.cycle(held).action >= Action.STOP:
                return False
        return False

    def again(self, *, fingers: bool) -> None:
        """Leave what is in the way, to try again without hurry, and more slowly."""
        super().again(fingers=fingers)
        self.fast *= SLOWER


def run_episode(seed: int) -> dict[str, Any]:
    """One episode: its outcome, and what the judge found."""
    begin = process_time()
    rng = np.random.default_rng([seed, 2])
    while True:
        place, name, goal = cluttered(rng, PANDA)
        place.fixtures["table"] = TABLE
        drawn = certified(place, name, goal)
        if drawn is not None:
            break
    guard, arm, place = drawn
    outcome = Outcome(seed, certified=True)
    judge = PandaJudge(place, arm)
    picker = PandaPicker(PandaPlant(guard, rng, arm), judge, PANDA, rng)
    pick_and_place(picker, place, name, goal, outcome)
    outcome.worked_s = process_time() - begin
    return figures_of(picker, place, outcome)


def certified(
    place: Workplace, name: str, goal: Floats
) -> tuple[Guard, PandaArm, PandaPlace] | None:
    """A guard of a place whose way is proven at rest, the Panda, and where it begins.

    Returns:
        None where the Panda does not get everywhere, or something is in the way.
    """
    model = scene_of_panda().robots["arm"].model
    arm = PandaArm(model, {**place.fixtures, **place.objects})
    ends = ends_of_way(place, name, goal, PANDA)
    begin = np.array([*POSTURE, ends[0, 3]])
    at_home = follow(arm, begin, ends[:1])
    rows = None if at_home is None else follow(arm, at_home[-1], ends[1:])
    if at_home is None or rows is None or not is_clear(place, arm, rows):
        return None
    if not carries_clear(place, name, ends):
        return None
    with_panda = PandaPlace(**vars(place), posture=at_home[-1])
    try:
        guard = Guard(with_panda.scene(), self_test=False)
    except ArmguardError:
        # Something is where the arm begins.
        return None
    target = place.objects[name]
    guard.remove(name)
    clear = guard.check_path(np.array([at_home[-1], *rows])).clear
    guard.place(name, Pose(xyz=tuple(target.at.tolist())))
    return (guard, arm, with_panda) if clear else None


def is_clear(place: Workplace, arm: PandaArm, rows: list[Floats]) -> bool:
    """Whether the arm, but for its gripper, is far from everything on a way."""
    judge = PandaJudge(place, arm)
    return all(
        distance >= CLEAR
        for q in rows
        for (part, _), distance in judge.near(q).items()
        if part not in GRIPPER
    )


@cache
def scene_of_panda() -> Scene:
    """A scene with nothing but a Panda."""
    scene = Scene(mode="path")
    scene.add_robot("panda", name="arm", base=Pose(xyz=BASE))
    return scene


def follow(arm: PandaArm, begin: Floats, ends: Floats) -> list[Floats] | None:
    """Joint positions on a way of the hand, by straight pieces.

    Args:
        arm: The Panda.
        begin: Joint positions it begins with, shape (8,).
        ends: Where hand and fingers are at the end of each piece, shape (k, 5) [m].

    Returns:
        None where the hand does not get to one of them.
    """
    q, rows = begin.copy(), []
    for end in ends:
        q[ARM] = end[3]
        for _ in range(int(LONGEST / STEP)):
            way = end[:3] - arm.hand(q)[:3, 3]
            left = sqrt(way @ way)
            if left <= NEAR:
                break
            q[:ARM] += STEP * arm.lead(q, way * min(SPEED / left, 0.5 / STEP))
            low, high = arm.limits + np.array([[OFF_LIMITS], [-OFF_LIMITS]])
            if not ((q[:ARM] >= low) & (q[:ARM] <= high)).all():
                return None
            rows.append(q.copy())
        else:
            return None
    return rows
