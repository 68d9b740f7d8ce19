"""Sensors that see what comes: a guard that knows it by its cells alone."""

from collections import deque
from typing import Any

import numpy as np

import armguard as ag
from armguard.geometry.shapes import Shape
from armguard.scene import Scene
from armguard.simulation.sensed import TRANSPORT
from armguard.simulation.sensors import Rig
from arrays import Floats
from episodes.follower import Follower
from evading.places import PERIOD, room_of
from evading.throws import Throw

# Middle of the cells, and of the room around them [m].
CENTRES = {"bay": (-0.4, 0.0, 1.1), "pandas": (0.0, 0.0, 0.6)}

# Edge of a cell [m], and cells along an edge of the region.
CELL, SIZE = 0.025, 128

# Half of the room's edge, and thickness of its walls [m].
ROOM, WALL = 2.2, 0.2

# Where the cameras are: from the middle of the room, which all of them look at [m].
CAMERAS = (
    *((1.5, 1.5, 1.2), (-1.5, -1.5, 1.2), (1.5, -1.5, 0.9), (-1.5, 1.5, 0.9)),
    (1.6, 0.0, -1.0),
    *((0.9, 0.3, 1.6), (-0.9, -0.3, 1.6)),
)

# Pixels of an image, focal length [pixels], and time between images [s].
PIXELS, FOCAL, EVERY = (144, 108), 98.0, 1.0 / 20.0

# Diameter of the smallest body that is declared [m], and space about the arms that is
# known free at the start [m].
SMALLEST, CLEAR = 0.06, 0.15

# The cameras look at the arms at rest for so long before an episode begins [s].
WARM_UP = 0.2


def looking_at_middle(place: Floats) -> ag.Pose:
    """Pose of a camera, in the middle of the room, that looks there."""
    z = -place / np.linalg.norm(place)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = place
    return ag.Pose.from_matrix(T)


def sensing_scene(name: str, speed: float, evade: bool) -> Scene:
    """The scene of a place with cameras, and without what comes.

    Args:
        name: Which, "bay" or "pandas".
        speed: Declared speed of an intruder [m/s].
        evade: Whether the arms get out of its way.
    """
    scene = room_of(name, evade)
    middle = np.array(CENTRES[name])
    scene.set_sensing(
        region={"centre": CENTRES[name], "size": SIZE}, cell=CELL, unknown="still",
        intruder={"speed": speed, "size": SMALLEST},
        start={"clear": CLEAR, "reason": "the operator has looked"},
    )  # fmt: skip
    for k, place in enumerate(CAMERAS):
        pose = looking_at_middle(np.array(place)).matrix()
        pose[:3, 3] += middle
        scene.add_sensor(
            f"camera{k}", kind="depth", size=PIXELS, focal=FOCAL, range=(0.3, 6.0),
            period=EVERY, pose=ag.Pose.from_matrix(pose),
        )  # fmt: skip
    return scene


def walls(middle: Floats) -> list[tuple[Shape, ag.Pose]]:
    """The room, from which a camera measures a distance where nothing else is."""
    found: list[tuple[Shape, ag.Pose]] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            size = np.full(3, 2.0 * (ROOM + WALL))
            size[axis] = WALL
            at = middle.copy()
            at[axis] += side * (ROOM + 0.5 * WALL)
            found.append((ag.Box(size=tuple(size)), ag.Pose(xyz=tuple(at))))
    return found


class Watcher:
    """Cameras that see what comes, and a guard that knows it from them.

    Attributes:
        guard: The guard.
        tables: Its tables.

    Args:
        name: Where, "bay" or "pandas".
        throw: What comes.
        seed: Seed of the noise.
        evade: Whether the arms get out of its way.
    """

    def __init__(self, name: str, throw: Throw, seed: int, *, evade: bool) -> None:
        projectile = throw.projectile
        self._throw = throw
        scene = sensing_scene(name, projectile.top_speed, evade)
        self.guard = ag.Guard(scene, self_test=False)
        self.tables, self.engage = self.guard.tables, self.guard.engage
        self.sense = ag.Sense(scene, self.guard)
        room = walls(np.array(CENTRES[name]))
        self._rig = Rig(scene, [projectile.shape, *(s for s, _ in room)], seed)
        for k, (_, pose) in enumerate(room, start=1):
            self._rig.place(k, pose)
        self._due = {
            name: k * EVERY / len(scene.sensors) - WARM_UP
            for k, name in enumerate(scene.sensors)
        }
        self._delay = next(iter(scene.sensors.values())).delay
        self._past: deque[tuple[float, Floats]] = deque(maxlen=40)
        self._warm_up()

    def _warm_up(self) -> None:
        """Look at the arms at rest."""
        for time in np.arange(-WARM_UP, 0.0, PERIOD).tolist():
            self.sense.joints(self._throw.q, time)
            self._look(time, self._throw.q, time)

    def report(self, plant: Follower) -> None:
        """Take the images that are there before a cycle of the arms."""
        self._look(plant.time, plant.q, plant.clock(plant.time))

    def _look(self, time: float, q: Floats, clock: float) -> None:
        """Take the images that are there now.

        Args:
            time: Time [s].
            q: True joint positions, shape (n,) [rad or m].
            clock: The same time on the clock of the guard [s].
        """
        self._past.append((time, q))
        for name, measured in self._due.items():
            if measured + self._delay + TRANSPORT > time:
                continue
            self._due[name] += EVERY
            at = self._throw.mover(measured)
            pose = None if at is None else self._throw.projectile.at(at)
            self._rig.place(0, pose)
            _, then = min(self._past, key=lambda past: abs(past[0] - measured))
            distance, status = self._rig.read(name, then)
            stamp = measured + self._delay + clock - time
            self.sense.frame(name, distance, status, stamp)

    def filter(
        self, q: Floats, v_desired: Floats, stamp: float, *, velocity: Floats,
        now: float,
    ) -> Any:  # fmt: skip
        """See `Guard.filter`."""
        self.sense.joints(q, stamp)
        return self.guard.filter(q, v_desired, stamp, velocity=velocity, now=now)
