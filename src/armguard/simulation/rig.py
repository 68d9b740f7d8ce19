"""`python -m armguard.simulation.rig`: simulated sensors beside a service.

They see what the robots of the service do and boxes of which no scene knows, and send
their frames over sockets as real ones would. SIGUSR1 takes all boxes away, SIGUSR2 puts
them back.
"""

import argparse
import heapq
import logging
import signal
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.entry import run_program
from armguard.geometry.pose import Pose
from armguard.processes import end_with
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.sense.history import JointHistory
from armguard.sense.world import World, sensed_space
from armguard.service.client import SensorClient
from armguard.service.mapping.joints import JointStream
from armguard.service.server.scenes import open_scene
from armguard.simulation.rig_link import RigEnd
from armguard.simulation.sensors import Reading, Rig

Floats = NDArray[np.float64]

log = logging.getLogger("armguard.simulation")

# How long the service gets to answer at first [s].
PATIENCE = 30.0

# Time from the stamp of a frame until it is sent [s].
TRANSPORT = 0.005

# Time between two looks at joint positions [s].
TURN = 0.002

# Least and greatest edges of a box [m], and its least distance to the origins of links
# and to other boxes [m].
LEAST, GREATEST, APART = (0.08, 0.08, 0.1), (0.18, 0.18, 0.28), 0.3

# How far stamps are off, by fault [s].
SHIFTS = {"ahead": 1.0, "back": -10.0}

# Places that are tried for each box.
TRIES = 400


class SimulatedSensors:
    """The sensors of a scene, by MuJoCo's rays.

    Args:
        client: Sends their frames; connected.
        scene: The scene of the service.
        boxes: How many boxes are put in view of a camera.
        seed: Seed of noise and boxes.
    """

    def __init__(
        self, client: SensorClient, scene: Scene, boxes: int = 3, seed: int = 0
    ) -> None:
        self._client, self._scene = client, scene
        self._boxes = places_in_view(scene, boxes, np.random.default_rng(seed))
        self._rig = Rig(scene, [size for size, _ in self._boxes], seed)
        self._history = JointHistory(*World(scene).joint_figures())
        self.show(True)
        state = [{"size": size, "xyz": xyz} for size, xyz in self._boxes]
        self._end = RigEnd(client.port, {"boxes": state})

    def show(self, there: bool) -> None:
        """Put all boxes into the world, or take them out of it."""
        for k, (_, xyz) in enumerate(self._boxes):
            self._rig.place(k, Pose(xyz=xyz) if there else None)

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Send frames until something is true, each sensor at its own times."""
        client, sensors = self._client, self._scene.sensors
        joints = JointStream(Path(client.welcome.ring), client.welcome.parts)
        queue: list[tuple[float, str]] = []
        waiting: list[tuple[float, str, Reading]] = []
        for k, (name, sensor) in enumerate(sensors.items()):
            first = client.clock() + sensor.period * (0.3 + 0.61 * k % 1.0)
            heapq.heappush(queue, (first, name))
        while not until():
            time.sleep(TURN)
            self._end.hear([*sensors])
            for q, stamp in joints.unread():
                self._history.add(q, stamp)
            while queue[0][0] <= self._history.newest:
                measured, name = heapq.heappop(queue)
                sensor = sensors[name]
                # A frame for which there was no time is left out.
                late = max(self._history.newest - measured, 0.0) // sensor.period
                heapq.heappush(queue, (measured + (1 + late) * sensor.period, name))
                found = self._history.at(measured)
                if found is not None:
                    reading = self._read(name, found.q)
                    heapq.heappush(waiting, (measured + sensor.delay, name, reading))
            while waiting and waiting[0][0] + TRANSPORT <= client.clock():
                self._send(*heapq.heappop(waiting))
        joints.close()

    def close(self) -> None:
        """Release its port."""
        self._end.close()

    def _read(self, name: str, q: Floats) -> Reading:
        """A frame; of a blindfolded sensor one without distances."""
        reading, sensor = self._rig.read(name, q), self._scene.sensors[name]
        if self._end.faults.get(name) != "blind":
            return reading
        if sensor.image:
            return reading._replace(distance=np.zeros_like(reading.distance))
        known = (*sensor.codes.valid, *sensor.codes.doubtful, *sensor.codes.nothing)
        invalid = next(code for code in range(256) if code not in known)
        return reading._replace(status=np.full_like(reading.status, invalid))

    def _send(self, stamp: float, name: str, reading: Reading) -> None:
        distance, status = reading
        fault = self._end.faults.get(name)
        if fault == "lost":
            return
        stamp += SHIFTS.get(fault or "", 0.0)
        if self._scene.sensors[name].image:
            self._client.depth(name, np.round(distance * 1e3).astype(int), stamp)
        else:
            self._client.zones(name, distance, status, stamp)


def places_in_view(
    scene: Scene, count: int, rng: np.random.Generator
) -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Boxes that stand on what a camera of the world sees, apart from the robots.

    Args:
        scene: The scene, whose robots are at home.
        count: How many; fewer where there is no room.
        rng: Draws them.

    Returns:
        Edges and middle of each [m].
    """
    cameras = [one for one in scene.sensors.values() if one.image and one.on is None]
    if not cameras:
        return []
    world = World(scene)
    tables = compile_scene(scene)
    links = world.poses(scene.home)[:, [3, 7, 11]]
    rig, found = Rig(scene), list[tuple[tuple[float, ...], tuple[float, ...]]]()
    for _ in range(count * TRIES):
        if len(found) == count:
            break
        camera = cameras[rng.integers(len(cameras))]
        way = np.append(rng.uniform(-0.45, 0.45, 2) * np.tan(camera.view), 1.0)
        length = np.linalg.norm(way)
        depth = float(rig.look(camera.name, tables.home, way[None] / length)[0])
        if not np.isfinite(depth):
            continue
        T = camera.pose.matrix()
        foot = T[:3, :3] @ (depth * way) + T[:3, 3]
        size = tuple(rng.uniform(LEAST, GREATEST).round(3).tolist())
        middle = foot + np.array([0.0, 0.0, 0.5 * size[2]])
        near = [*links, *(np.array(xyz) for _, xyz in found)]
        away = min(float(np.linalg.norm(middle - one)) for one in near)
        if away > APART:
            found.append((size, tuple(middle.round(3).tolist())))
    return found  # type: ignore[return-value]


def main() -> None:
    """Run until it is ended."""
    words = argparse.ArgumentParser(
        prog="python -m armguard.simulation.rig",
        description=(__doc__ or "").splitlines()[0],
    )
    words.add_argument("scene", help="scene file or bundled scene; the service's")
    words.add_argument("--port", type=int, required=True, help="of the service")
    words.add_argument("--key-file", type=Path, help="the service's keys")
    words.add_argument("--boxes", type=int, default=3, help="that no scene knows")
    words.add_argument("--seed", type=int, default=0, help="of noise and boxes")
    words.add_argument("--parent", type=int, help="ends with that process")
    asked = words.parse_args()
    if asked.parent is not None:
        end_with(asked.parent)
    ending: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda got, _: ending.append(got))
    with SensorClient(asked.port, keys=asked.key_file, name="rig") as client:
        welcome = client.connect(PATIENCE)
        late = float(welcome.text["late"])
        scene, _ = open_scene(asked.scene, period=welcome.period, late=late)
        sensed_space(scene)
        sensors = SimulatedSensors(client, scene, asked.boxes, asked.seed)
        for number in (signal.SIGUSR1, signal.SIGUSR2):
            signal.signal(number, lambda got, _: sensors.show(got == signal.SIGUSR2))
        try:
            sensors.run(lambda: bool(ending))
        finally:
            sensors.close()


if __name__ == "__main__":
    run_program(main, "simulated sensors:")
