"""Worlds: arms with boxes and rods near their ways, and an operator."""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

import armguard as ag
from armguard.scene.compile import compile_scene
from armguard.simulation.sensed import sensed_bay
from arrays import Floats
from closed_loop.judge import Judge
from evading.places import room_of

# Time of a cycle [s], time before the operator begins, and of an episode [s].
PERIOD, SETTLED, SECONDS = 0.004, 0.8, 4.0

# Range of speeds of the joints' swings [rad/s], of their angular frequencies [rad/s].
SPEEDS, FREQUENCIES = (0.6, 1.2), (0.5, 1.2)

# Objects of a world; edges of boxes, thickness and length of rods [m]; share of rods,
# and places that are tried at once.
COUNTS, EDGES, ROD = (3, 6), (0.06, 0.25), (0.05, 0.4)
RODS, CANDIDATES = 0.4, 24

# The least distance of an object to all links at home, which the operator has looked
# at, and to the ways of the arms without objects; and its greatest distance to a link
# on its way [m].
AT_HOME, BESIDE = 0.16, 0.35

# Space about the links at home that is known free at the start [m].
CLEAR = 0.15

# Cells along an edge of the region, by the edge of a cell [m].
SIZES = {0.025: 128, 0.02: 256, 0.015: 256, 0.01: 512}


@dataclass(frozen=True)
class World:
    """Foreign objects, and what an operator desires.

    Attributes:
        edges: Edges of the objects, shape (k, 3) [m].
        poses: Their poses at the start.
        velocities: Their velocities from then on, shape (k, 3) [m/s].
        speeds: Greatest desired speeds of the joints, shape (n,) [rad/s].
        frequencies: Angular frequencies of their swings, shape (n,) [rad/s].
    """

    edges: Floats
    poses: tuple[ag.Pose, ...]
    velocities: Floats
    speeds: Floats
    frequencies: Floats

    def desired(self, time: float) -> Floats:
        """Desired velocities at a time, shape (n,) [rad/s]."""
        now = max(time - SETTLED, 0.0)
        wanted: Floats = self.speeds * np.cos(self.frequencies * now)
        return wanted * (time > SETTLED)

    def way(self, time: float) -> Floats:
        """Way of the joints that is desired until a time, shape (n,) [rad]."""
        now = max(time - SETTLED, 0.0)
        reached: Floats = (
            self.speeds / self.frequencies * np.sin(self.frequencies * now)
        )
        return reached


def bay() -> ag.Scene:
    """The bay with a floor, in which stops are predicted."""
    scene = ag.bay_scene("path")
    scene.period = PERIOD
    scene.add(ag.Box(size=(4, 4, 0.2)), "floor", pose=ag.Pose(xyz=(0, 0, -0.1)))
    return scene


def pandas() -> ag.Scene:
    """Two Pandas face to face at a table, in which stops are predicted."""
    return room_of("pandas", evade=False)


# Arms without foreign objects, by name.
PLACES = {"bay": bay, "pandas": pandas}


def sensing_bay(
    cell: float, speed: float = 0.0, zones: bool = True, rate: float = 15.0,
    **settings: Any,
) -> ag.Scene:  # fmt: skip
    """The same with two cameras and eight zone sensors; unknown space is an obstacle.

    Args:
        cell: Edge of a cell [m].
        speed: Declared speed of an intruder; the objects of a world do not move [m/s].
        zones: Whether it has the zone sensors.
        rate: Rate of the cameras [Hz].
        settings: Settings of all sensors, see `SensorSettings`.
    """
    scene = sensed_bay(zones=zones, camera=False, **settings)
    scene.period = PERIOD
    scene.set_sensing(
        region={"centre": (-0.4, 0, 1.1), "size": SIZES[cell]}, cell=cell,
        unknown="still", intruder={"speed": speed, "size": 0.05},
        start={"clear": CLEAR, "reason": "the operator has looked"},
    )  # fmt: skip
    for name, y in (("over_left", 0.7), ("over_right", -0.7)):
        scene.add_sensor(
            name, kind="depth", size=(160, 120), focal=100, range=(0.3, 3.0),
            period=1.0 / rate, pose=ag.Pose(xyz=(-0.4, y, 2.3), rpy=(np.pi, 0, 0)),
            **settings,
        )  # fmt: skip
    return scene


def modelled(world: World, place: str = "bay") -> ag.Scene:
    """A scene that has the foreign objects."""
    scene = PLACES[place]()
    for k, (edges, pose) in enumerate(zip(world.edges, world.poses, strict=True)):
        scene.add(ag.Box(size=tuple(edges.tolist())), f"foreign{k}", pose=pose)
    return scene


@cache
def empty(place: str) -> tuple[ag.Scene, Judge]:
    """A place without foreign objects, and its judge."""
    scene = PLACES[place]()
    return scene, Judge(scene, compile_scene(scene))


def drawn_world(seed: int, place: str = "bay") -> World:
    """The world of a seed, in which objects are at rest."""
    rng = np.random.default_rng([seed, 7])
    scene, _ = empty(place)
    n = len(scene.home)
    speeds = rng.uniform(*SPEEDS) * rng.uniform(-1.0, 1.0, n)
    none = np.zeros((0, 3))
    world = World(none, (), none, speeds, rng.uniform(*FREQUENCIES, n))
    wanted = int(rng.integers(*COUNTS))
    found = world
    while len(found.poses) < wanted:
        edges = np.array([drawn_edges(rng) for _ in range(CANDIDATES)])
        poses = tuple(drawn_pose(rng, world, place) for _ in edges)
        chosen = fitting(replace(world, edges=edges, poses=poses), place)
        found = replace(
            found,
            edges=np.concatenate([found.edges, edges[chosen]])[:wanted],
            poses=(*found.poses, *(poses[k] for k in chosen))[:wanted],
        )
    return replace(found, velocities=np.zeros((wanted, 3)))


def drawn_edges(rng: np.random.Generator) -> Floats:
    """Edges of a box or of a rod, shape (3,) [m]."""
    if rng.random() < RODS:
        return np.array([ROD[0], ROD[0], ROD[1]])
    return np.asarray(rng.uniform(*EDGES, 3))


def drawn_pose(rng: np.random.Generator, world: World, place: str) -> ag.Pose:
    """A pose beside a link at a random time of the desired motion."""
    middle = drawn_middle(rng, world, place)
    way = rng.normal(size=3)
    way *= rng.uniform(0.0, BESIDE) / np.linalg.norm(way)
    turn = rng.uniform(-np.pi, np.pi, 3)
    return ag.Pose(xyz=(middle + way).tolist(), rpy=turn.tolist())


def drawn_middle(rng: np.random.Generator, world: World, place: str) -> Floats:
    """Middle of a link at a random time of the desired motion, shape (3,) [m]."""
    scene, judge = empty(place)
    judge.place(scene.home + world.way(rng.uniform(SETTLED, SECONDS)))
    links = np.flatnonzero(judge.arm_of >= 0)
    return np.array(judge.data.geom_xpos[rng.choice(links)])


def fitting(world: World, place: str) -> list[int]:
    """Objects that are off the links at home and off all that is fixed in a place."""
    scene = modelled(world, place)
    judge = Judge(scene, compile_scene(scene))
    judge.place(scene.home)
    found = []
    for k in range(len(world.poses)):
        own = judge.owners.index(f"foreign{k}")
        gaps = {
            g: judge.gap((min(g, own), max(g, own)), AT_HOME)
            for g, owner in enumerate(judge.owners)
            if not owner.startswith("foreign")
        }
        needs = {g: AT_HOME if judge.arm_of[g] >= 0 else 0.0 for g in gaps}
        if all(gaps[g] >= needs[g] for g in gaps):
            found.append(k)
    return found
