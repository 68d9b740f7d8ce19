"""A sensor with its health and its tests."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.geometry.pose import Pose
from armguard.scene.scene import Scene
from armguard.scene.sensing import SceneSensing
from armguard.sense.alignment import Alignment
from armguard.sense.capacitive import Capacitive
from armguard.sense.frames import (
    Frame,
    Points,
    Signal,
    beam_of,
    frame_of,
    points_of,
    signal_of,
)
from armguard.sense.health import Fault, FrameTests, SensorHealth
from armguard.sense.hypotheses import Hypotheses
from armguard.sense.infrared import Infrared
from armguard.sense.prediction import Mount, Prediction
from armguard.sense.view import View
from armguard.sense.world import Placed, World

Floats = NDArray[np.float64]

# Fits in a row that have to show that a sensor is mounted elsewhere.
CERTAIN_FITS = 2


class Station:
    """A sensor with its health and its tests.

    Attributes:
        view: Its view.
        health: Its health.
        tests: Tests of its frames.
        infrared: Its signals as distances; None for other kinds.
        pad: Its signals beside known bodies; None for other kinds.
        number: Its number in the claims of the map, from 1 on.
        freed: Time of the newest of its frames that has freed space which was not
            withdrawn since, minus infinity without any [s].

    Args:
        number: See above.
        view: Its view.
        world: The scene.
    """

    def __init__(self, number: int, view: View, world: World) -> None:
        self.number = number
        self.view, self.health = view, SensorHealth(view.sensor)
        self.tests = FrameTests(view, self.health)
        self._world, self.freed = world, -inf
        self._prediction: Prediction | None = None
        self._alike: dict[str, Station] = {}
        form = view.sensor.form
        self.infrared = Infrared(view.sensor) if form == "infrared" else None
        self.pad = Capacitive(view) if form == "capacitive" else None
        self._begin_tests()

    def _begin_tests(self) -> None:
        self._certain = 0
        self._alignment = Alignment(
            self.view, self._world.kinds, self._world.model_errors
        )
        self._hypotheses = Hypotheses(self.view, list(self._alike))

    def meet(self, stations: Mapping[str, "Station"]) -> None:
        """Take all stations: the sensor may be in the place of another of its kind."""
        rays = self.view.ways
        self._alike = {
            name: one
            for name, one in stations.items()
            if one is not self and np.array_equal(one.view.ways, rays)
        }
        self._begin_tests()

    def move(self, pose: Pose) -> None:
        """Take another pose of the sensor, in its link or in the world."""
        self.view.sensor = replace(self.view.sensor, pose=pose)
        self._begin_tests()

    def read(
        self, values: ArrayLike, status: ArrayLike | None
    ) -> Frame | Points | Signal:
        """A frame of the sensor.

        Args:
            values: Its values, by the form of the sensor's frames.
            status: Status of zones; None for other forms.

        Raises:
            BadFrameError: It cannot be used.
        """
        view = self.view
        if view.sensor.form == "points":
            return points_of(view.sensor, values)
        if view.sensor.form in ("infrared", "capacitive"):
            return signal_of(values)
        if view.sensor.form == "beam":
            return beam_of(view.sensor, view.slopes, view.cone, values)
        return frame_of(view.sensor, view.slopes, values, status)

    def align(
        self, frame: Frame, mount: Mount, placed: Placed, prediction: Prediction,
        now: float,
    ) -> None:  # fmt: skip
        """Compare the place and the time of the sensor with its frames.

        See `Alignment.add` and `Hypotheses.test`.
        """
        self._prediction = prediction
        others = [one._prediction for one in self._alike.values()]
        found = self._hypotheses.test(frame, mount, prediction, others, now)
        made = self._alignment.add(frame, mount, placed, prediction, now)
        offset = self._alignment.offset
        if made and offset is not None:
            self._certain = self._certain + 1 if offset.certain else 0
        if found is not None:
            # A fit to surfaces of another place, or of another time, has no meaning.
            self.health.sign(found.fault, now, found.detail)
        elif self._certain >= CERTAIN_FITS:
            self.health.sign(Fault.MOVED, now, str(offset))


def stations_of(scene: Scene, space: SceneSensing, world: World) -> dict[str, Station]:
    """Stations of the sensors of a scene by their names, numbered from 1 on.

    Args:
        scene: The scene.
        space: Its sensed space.
        world: Its links and objects.
    """
    found = {
        name: Station(k, View(sensor, space.intruder.size, space.cell), world)
        for k, (name, sensor) in enumerate(scene.sensors.items(), start=1)
    }
    for one in found.values():
        one.meet(found)
    return found
