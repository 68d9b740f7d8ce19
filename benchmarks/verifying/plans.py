"""Random plans of each kind, and the worlds that they are proven in."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

import armguard as ag
from armguard.batch.checker import Checker
from armguard.plans.plan import Plan
from armguard.prove.paving import Paver
from armguard.prove.tube import Tube
from armguard.scene import Scene, Trajectory, load_scene
from arrays import Floats
from batch_planning import PUBLIC, primitives_of
from verifying.oracle import Oracle

# Wires and plates are this thin [m].
THIN = 0.002

# Rows of a plan, and time from one to the next [s].
ROWS, STEP = 9, 0.5

# What joints and clocks of the plans with errors are off [rad, s].
FOLLOWING, SKEW = 0.004, 0.02

# Paths of the public data set, and how long each takes [s].
FOLDERS = ("bookshelf_small_panda", "table_pick_panda")
PATHS = 10
DURATION = 5.0


@dataclass(frozen=True, slots=True)
class World:
    """A scene, what proves in it, and what judges that.

    Attributes:
        scene: The scene.
        paver: Proves.
        oracle: Judges.
    """

    scene: Scene
    paver: Paver
    oracle: Oracle

    @classmethod
    def of(cls, scene: Scene) -> "World":
        """The world of a scene, links by their primitives."""
        tables = primitives_of(scene)
        return cls(scene, Paver(Checker(tables)), Oracle(tables))


@dataclass(frozen=True, slots=True)
class Case:
    """A plan in a world.

    Attributes:
        world: The world.
        curves: What is planned.
        following: How far each joint may be off [rad].
        skew: How far each robot's clock may be off [s], by robot.
        tube: What holds all of that.
        without: Tubes that leave something out, by what it is.
    """

    world: World
    curves: Tube
    following: float
    skew: Mapping[str, float]
    tube: Tube
    without: Mapping[str, Tube] = field(default_factory=dict)


@cache
def bay() -> World:
    """Both arms of the bay."""
    return World.of(ag.bay_scene())


@cache
def thin(number: int) -> World:
    """One arm with a needle, among wires and plates; one of twenty such worlds."""
    rng = np.random.default_rng([number, 71])
    scene = Scene(mode="fixed", buffer=0.005 * (number % 2))
    model = ag.bay_scene().robots["left"].model
    scene.add_robot(model, name="arm", home={"joint2": -0.35, "joint4": 1.7})
    needle = ag.Capsule(start=(0, 0, 0.13), end=(0, 0, 0.3), radius=0.5 * THIN)
    scene.add(needle, name="needle", attached_to="arm/link7")
    for link in ("arm/link6", "arm/link7"):
        scene.allow("needle", link, reason="it is held there")
    for k in range(10):
        half = rng.uniform(0.1, 0.4)
        rod = ag.Capsule(start=(0, 0, -half), end=(0, 0, half), radius=0.5 * THIN)
        plate = ag.Box(size=(half, THIN, half))
        way = rng.normal(size=3)
        xyz = (0.0, 0.0, 0.35) + rng.uniform(0.45, 0.9) * way / np.linalg.norm(way)
        rpy = Rotation.random(rng=rng).as_euler("xyz")
        pose = ag.Pose(xyz=tuple(xyz), rpy=tuple(rpy))
        scene.add(rod if k % 2 else plate, name=f"body{k}", pose=pose)
    return World.of(scene)


def case_of(
    world: World,
    motion: Trajectory,
    following: float = 0.0,
    skew: Mapping[str, float] | None = None,
) -> Case:
    """A plan with its errors, and tubes that leave each of them out."""
    plan, late = Plan.of(motion, world.scene), skew or {}
    tube = plan.widened(world.scene, following, late)
    without = {}
    if plan.tube.degree > 1:
        chords = np.ascontiguousarray(plan.tube.control[:, [0, -1]])
        without["bow"] = Tube(tube.times, chords, tube.wide)
    if following:
        without["following error"] = plan.widened(world.scene, 0.0, late)
    if late:
        without["skew"] = plan.widened(world.scene, following)
    return Case(world, plan.tube, following, late, tube, without)


def rows_near(scene: Scene, rng: np.random.Generator, size: float) -> Floats:
    """Rows that wander about home, each joint by up to `size`, (ROWS, n) [rad]."""
    n = len(scene.q_names)
    return scene.home + rng.uniform(-size, size, (ROWS, n))


def straight(seed: int) -> Case:
    """Lines of both arms of the bay."""
    world, rng = bay(), np.random.default_rng([seed, 72])
    rows = rows_near(world.scene, rng, 0.6)
    times = STEP * np.arange(ROWS)
    return case_of(world, Trajectory(world.scene.q_names, rows, times, "straight"))


def among_thin(seed: int) -> Case:
    """Lines of an arm with a needle, among wires and plates."""
    world, rng = thin(seed % 20), np.random.default_rng([seed, 73])
    rows = rows_near(world.scene, rng, 0.8)
    times = STEP * np.arange(ROWS)
    return case_of(world, Trajectory(world.scene.q_names, rows, times, "thin"))


def cubic(seed: int) -> Case:
    """Cubics of the same arm, by the velocities of their rows."""
    world, rng = thin(seed % 20), np.random.default_rng([seed, 74])
    rows = rows_near(world.scene, rng, 0.8)
    speeds = rng.uniform(-1.5, 1.5, rows.shape)
    times = STEP * np.arange(ROWS)
    names = world.scene.q_names
    return case_of(world, Trajectory(names, rows, times, "cubic", velocities=speeds))


def skewed(seed: int) -> Case:
    """Cubics of both arms of the bay, whose joints and clocks are off."""
    world, rng = bay(), np.random.default_rng([seed, 75])
    rows = rows_near(world.scene, rng, 0.6)
    speeds = rng.uniform(-0.8, 0.8, rows.shape)
    times = STEP * np.arange(ROWS)
    names = world.scene.q_names
    motion = Trajectory(names, rows, times, "skewed", velocities=speeds)
    return case_of(world, motion, FOLLOWING, {"right": SKEW})


def public(seed: int) -> Case:
    """A path of the public data set, along straight lines at an even pace."""
    folder, number = FOLDERS[seed % 2], 1 + seed // 2 % PATHS
    scene = load_scene(PUBLIC / folder / f"scene{number:04}.yaml")
    scene.buffer = 0.005
    motion = ag.load_trajectory(PUBLIC / folder / f"path{number:04}.csv")
    fill = dict(zip(scene.q_names, scene.home.tolist(), strict=True))
    q = motion.for_scene(scene, fill)
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1))))
    times = DURATION * way / way[-1]
    return case_of(World.of(scene), Trajectory(scene.q_names, q, times, folder))


KINDS = {
    "straight": straight,
    "thin": among_thin,
    "cubic": cubic,
    "skewed": skewed,
    "public": public,
}
