"""Where things are thrown at arms: the bay and two Pandas, and one thing that comes."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from armguard.geometry import Box, Pose, Sphere
from armguard.robot.stopping import StoppingFigures
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from armguard.scene.settings import ResponseSettings
from armguard.scene.tables import SceneTables
from arrays import Floats
from closed_loop.scenes import bare_scene, filled
from closed_loop.truth import joined
from evading.judge import Judge

# Time from one cycle to the next [s], and the distance that is asked for [m].
PERIOD, BUFFER = 0.004, 0.005

# What comes, by name, and where it is while it is not there [m].
MOVER = "mover"
AWAY = (0.0, 0.0, 50.0)

# Half of its sizes; a ball's radius [m].
SIZES = (0.03, 0.08)


@dataclass(frozen=True)
class Thing:
    """What comes; it does not turn.

    Attributes:
        half: Half of a box's sizes, shape (3,); all of them the radius of a ball [m].
        turn: Roll, pitch and yaw [rad].
        is_box: Whether it is a box.
        top_speed: The speed it is declared to have at most [m/s].
    """

    half: tuple[float, float, float]
    turn: tuple[float, float, float]
    is_box: bool
    top_speed: float

    def at(self, xyz: Floats) -> Pose:
        """Its frame where it is in a place [m]."""
        return Pose(xyz=tuple(xyz.tolist()), rpy=self.turn)


class Place:
    """A scene with a thing that may come, its figures and its judge.

    Attributes:
        scene: The scene; the thing is not there.
        tables: Its tables.
        judge: The judge.
        robots: Names of the arms.
        own: Places of each arm's joints in q.
        figures: Declared figures of each arm.
        limits: Least and greatest positions of the joints, shape (2, n) [rad or m].

    Args:
        name: Which of the scenes, "bay" or "pandas".
        thing: What may come.
        evade: Whether the arms get out of its way.
    """

    def __init__(self, name: str, thing: Thing, *, evade: bool) -> None:
        self.scene = built(name, thing, evade)
        self.tables: SceneTables = compile_scene(self.scene)
        self.judge = Judge(self.scene, self.tables, MOVER, np.array(AWAY))
        parts = self.tables.robots
        self.robots = tuple(part.name for part in parts)
        self.own = {
            part.name: slice(part.first_joint, part.first_joint + part.joint_count)
            for part in parts
        }
        self.figures: Mapping[str, StoppingFigures] = {
            part.name: part.stopping for part in parts
        }
        low = np.maximum(self.tables.lower, -pi)
        self.limits = np.array([low, np.minimum(self.tables.upper, pi)])

    def joined(self, figure: str) -> Floats:
        """A figure of all joints, shape (n,)."""
        return joined(self.figures.values(), figure)


def built(name: str, thing: Thing, evade: bool) -> Scene:
    """The scene of the guard."""
    bare = bare_scene(name)
    scene = Scene(mode="path", period=PERIOD, index=bare.index, buffer=BUFFER)
    evades = ResponseSettings(evade=evade)
    filled(
        scene,
        bare,
        lambda name: {"stopping": bare.robots[name].stopping, "response": evades},
    )
    shape = (
        Box(half_extents=thing.half) if thing.is_box else Sphere(radius=thing.half[0])
    )
    scene.add(
        shape,
        name=MOVER,
        pose=thing.at(np.array(AWAY)),
        present=False,
        top_speed=thing.top_speed,
    )
    return scene
