"""Scenes in which sensors alone know foreign bodies, and how these move."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import armguard as ag
from armguard.scene.compile import compile_scene
from arrays import Floats
from closed_loop.judge import Judge
from evading.sensed import CAMERAS, CENTRES, looking_at_middle
from freedom.worlds import (
    PLACES,
    ROD,
    World,
    drawn_middle,
    drawn_world,
    modelled,
    sensing_bay,
)

# Edge of a cell [m], and cells along an edge of the region.
CELL, SIZE = 0.025, 128

# Cameras above the table of two Pandas, which look at the middle of the region [m].
ABOVE = ((0.1, 1.3, 1.1), (-0.1, -1.3, 1.1), (0.0, 0.1, 1.7))

# Pixels and focal length of cameras on all sides [pixels], and of those above; the
# smallest body that is declared, see `ROD` for bodies at rest [m].
AROUND, FROM_ABOVE, SMALLEST = ((112, 84), 76.0), ((160, 120), 100.0), 0.08

# Time from image to image [s], and space about the links at home that is known free at
# the start where cameras are on all sides or above the Pandas [m].
EVERY, START = 1.0 / 15.0, 0.12

# The body that moves, and how many there are then, at most. Range of its speeds, the
# greatest is declared [m/s]; how long its way keeps off all that is fixed [s] and how
# far [m], at so many places; and how many directions are tried.
MOVER, BODIES, SPEEDS = "foreign0", 2, (0.15, 0.3)
LASTS, OFF, STEPS, TRIED = 2.0, 0.02, 20, 20

# Settings of all sensors where one of them is large, in truth and as declared; and the
# thickness of rods that are thinner than the smallest body that is declared [m].
LARGE: dict[str, dict[str, Any]] = {
    "": {},
    "error": {"error": 0.08},
    "noise": {"noise": (0.03, 0.0, 0.0)},
    "delay": {"delay": 0.4},
}
THIN = 0.004


@dataclass(frozen=True)
class Setting:
    """A kind of episodes.

    Attributes:
        place: Where, a key of `freedom.worlds.PLACES`.
        moves: Whether one of the foreign bodies moves.
        large: What is large, in truth and as declared, a key of `LARGE`.
        left_out: What the guard does not know, see `LEFT_OUT`; empty if it knows all.
    """

    place: str = "bay"
    moves: bool = False
    large: str = ""
    left_out: str = ""

    @property
    def speed(self) -> float:
        """Declared speed of an intruder [m/s]."""
        return SPEEDS[1] if self.moves and self.left_out != "speed" else 0.0


LEFT_OUT = {
    "error": "errors of sensors are not added to cells",
    "noise": "noise of sensors is not declared",
    "age": "cells count as new",
    "speed": "no intruder's speed is declared",
    "cell": "cells count as their middles",
    "shell": "cells within 80 mm of links are taken for free",
    "size": f"rods are {1e3 * THIN:g} mm thick",
}


def sensing_scene(setting: Setting, *, true: bool) -> ag.Scene:
    """A scene with sensors; space that they have not seen is an obstacle.

    Args:
        setting: The kind of episodes.
        true: Whether it is true; else it is what the guard knows.
    """
    settings = LARGE[setting.large]
    if setting.left_out == "noise" and not true:
        settings = {}
    if setting.place == "bay" and not setting.moves:
        return sensing_bay(CELL, **settings)
    scene, middle = PLACES[setting.place](), np.array(CENTRES[setting.place])
    smallest = SMALLEST if setting.moves else ROD[0]
    scene.set_sensing(
        region={"centre": middle.tolist(), "size": SIZE}, cell=CELL, unknown="still",
        intruder={"speed": setting.speed, "size": smallest},
        start={"clear": START, "reason": "the operator has looked"},
    )  # fmt: skip
    pixels, focal = AROUND if setting.moves else FROM_ABOVE
    for k, place in enumerate(CAMERAS if setting.moves else ABOVE):
        pose = looking_at_middle(np.array(place)).matrix()
        pose[:3, 3] += middle
        scene.add_sensor(
            f"camera{k}", kind="depth", size=pixels, focal=focal, range=(0.3, 6.0),
            period=EVERY, pose=ag.Pose.from_matrix(pose), **settings,
        )  # fmt: skip
    return scene


def world_of(setting: Setting, seed: int) -> World:
    """The foreign bodies of a seed, and what an operator desires."""
    world = drawn_world(seed, setting.place)
    if setting.left_out == "size":
        thin = [(THIN, THIN, longest) for longest in world.edges.max(axis=1)]
        return replace(world, edges=np.array(thin))
    if not setting.moves:
        return world
    few = slice(BODIES)
    world = replace(
        world,
        edges=np.maximum(world.edges[few], SMALLEST),
        poses=world.poses[few],
        velocities=world.velocities[few].copy(),
    )
    rng = np.random.default_rng([seed, 11])
    world.velocities[0] = drawn_velocity(rng, world, setting.place)
    return world


def drawn_velocity(rng: np.random.Generator, world: World, place: str) -> Floats:
    """Velocity of the first body towards a link on its way, or none, shape (3,) [m/s].

    Its way keeps off all that is fixed.
    """
    scene = modelled(world, place)
    judge, start = Judge(scene, compile_scene(scene)), np.array(world.poses[0].xyz)
    judge.place(scene.home)
    own = judge.owners.index(MOVER)
    fixed = [
        (min(g, own), max(g, own))
        for g, owner in enumerate(judge.owners)
        if judge.arm_of[g] < 0 and not owner.startswith("foreign")
    ]
    for _ in range(TRIED):
        way = drawn_middle(rng, world, place) - start
        velocity = rng.uniform(*SPEEDS) * way / np.linalg.norm(way)
        for time in np.linspace(0.0, LASTS, STEPS):
            judge.stand_at(MOVER, time * velocity)
            judge.place(scene.home)
            if any(judge.gap(pair, OFF) < OFF for pair in fixed):
                break
        else:
            return np.asarray(velocity)
    return np.zeros(3)
