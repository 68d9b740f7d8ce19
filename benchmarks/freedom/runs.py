"""Runs of one world: known by the scene, by sensors, or by OctoMap and a distance."""

from collections import deque
from time import process_time
from typing import Any, Protocol

import numpy as np

import armguard as ag
from armguard.guard.verdict import Verdict
from armguard.scene.compile import compile_scene
from armguard.simulation.sensed import TRANSPORT
from armguard.simulation.sensors import Rig
from arrays import Floats
from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT
from evading.episode import Plant
from freedom.losses import Losses
from freedom.sight import Frame
from freedom.tally import Tally
from freedom.worlds import PERIOD, SECONDS, World, modelled, sensing_bay


class Commanding(Protocol):
    """What makes commands of desired velocities: the guard, or a peer of it."""

    tables: Any

    def filter(
        self, q: Floats, v_desired: Floats, stamp: float, *, velocity: Floats,
        now: float,
    ) -> Any:  # fmt: skip
        """A command; it has `velocity`, `actions`, `blocked` and a `verdict`."""

    def engage(self, robot: str) -> None:
        """Give a robot back to its operator."""


class Frames:
    """Frames of simulated sensors that come when they are due.

    Attributes:
        taken: Those that came.

    Args:
        scene: The scene with the sensors.
        world: The foreign objects that they see.
        seed: Seed of the noise.
    """

    def __init__(self, scene: ag.Scene, world: World, seed: int) -> None:
        self._scene = scene
        self._rig = Rig(scene, [tuple(edges) for edges in world.edges], seed)
        for k, pose in enumerate(world.poses):
            self._rig.place(k, pose)
        self._due = {
            name: sensor.period * (0.3 + 0.61 * k) % sensor.period
            for k, (name, sensor) in enumerate(scene.sensors.items())
        }
        self._past: deque[tuple[float, Floats]] = deque(maxlen=100)
        self.taken: list[Frame] = []

    def look(self, q: Floats, stamp: float, now: float) -> list[tuple[Any, ...]]:
        """Names, distances, status and stamps of the frames that are there now.

        Args:
            q: Joint positions, shape (n,) [rad or m].
            stamp: Their time [s].
            now: Time of the cycle [s].
        """
        self._past.append((stamp, q))
        found = []
        for name, measured in self._due.items():
            sensor = self._scene.sensors[name]
            if measured + sensor.delay + TRANSPORT > now:
                continue
            self._due[name] += sensor.period
            _, then = min(self._past, key=lambda past: abs(past[0] - measured))
            reading = self._rig.read(name, then)
            found.append((name, *reading, measured + sensor.delay))
            self.taken.append(Frame(name, then))
        return found


class Sensing:
    """A guard that knows foreign objects by sensors alone.

    Attributes:
        losses: Causes of what it loses.

    Args:
        world: The world.
        cell: Edge of a cell [m].
        speed: Declared speed of an intruder [m/s].
        seed: Seed of the noise.
    """

    def __init__(self, world: World, cell: float, speed: float, seed: int) -> None:
        scene = sensing_bay(cell, speed)
        self._guard = ag.Guard(scene, self_test=False)
        self._sense = ag.Sense(scene, self._guard)
        self._frames = Frames(scene, world, seed)
        self.tables, self.engage = self._guard.tables, self._guard.engage
        self.losses = Losses(
            scene, modelled(world), self._sense.cells, self._frames.taken
        )

    def filter(
        self, q: Floats, v_desired: Floats, stamp: float, *, velocity: Floats,
        now: float,
    ) -> Any:  # fmt: skip
        """See `Commanding`."""
        self._sense.joints(q, stamp)
        for name, distance, status, at in self._frames.look(q, stamp, now):
            self._sense.frame(name, distance, status, at)
        return self._guard.filter(q, v_desired, stamp, velocity=velocity, now=now)


def known(world: World) -> ag.Guard:
    """A guard of a scene that has the foreign objects."""
    return ag.Guard(modelled(world), self_test=False)


def run(world: World, guard: Commanding, seed: int) -> dict[str, Any]:
    """A run of a world; what came of it.

    Args:
        world: The world.
        guard: What makes the commands; with a `verdict`, causes are counted.
        seed: Draws delays and errors of the plant.

    Returns:
        Desired way and the part of it that was done, summed over joints [rad]; least
        distance of a foreign object to an arm that moves, at most `SIGHT` [m]; figures
        of `Tally`.
    """
    begin = process_time()
    scene = modelled(world)
    judge = Judge(scene, compile_scene(scene))
    plant = Plant(guard, scene.home, np.random.default_rng(seed))
    tally = Tally(plant, guard.losses if isinstance(guard, Sensing) else None)
    wanted = done = 0.0
    least = SIGHT
    while plant.time < SECONDS:
        desired = world.desired(plant.time)
        command = plant.drive(desired)
        kept = np.clip(command.velocity * np.sign(desired), 0.0, np.abs(desired))
        wanted += PERIOD * float(np.abs(desired).sum())
        done += PERIOD * float(kept.sum())
        if (plant.v != 0.0).any():
            least = min(least, foreign_gap(judge, plant.q))
        if isinstance(command.verdict, Verdict):
            tally.count(command.verdict, np.abs(desired), kept)
    return {
        "wanted": wanted, "done": done, "least": least, **tally.figures(),
        "worked_s": process_time() - begin,
    }  # fmt: skip


def foreign_gap(judge: Judge, q: Floats) -> float:
    """Least distance of an arm to a foreign object, at most `SIGHT` [m]."""
    distances, geoms = judge.measure(q)
    own = [
        any(judge.owners[g].startswith("foreign") for g in pair)
        for pair in geoms.tolist()
    ]
    return float(distances[own].min(initial=SIGHT)) if len(geoms) else SIGHT
