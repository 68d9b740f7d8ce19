"""Sensors of a scene fill its map of cells: frames in, changes of the map out."""

from collections import Counter
from collections.abc import Iterable, Mapping
from io import BufferedIOBase
from math import inf, isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armguard.cells.cell_map import CellMap
from armguard.cells.deltas import Delta
from armguard.errors import PoseError
from armguard.geometry.pose import Pose
from armguard.guard.clusters import Cluster
from armguard.guard.monitor import Monitor
from armguard.record import Records, records
from armguard.scene.scene import Scene
from armguard.scene.sensor_kinds import Form
from armguard.sense.filling import Filling
from armguard.sense.frames import BadFrameError, Intake, number_of
from armguard.sense.frames_file import (
    CAPACITIVE,
    DEPTH,
    INFRARED,
    JOINTS,
    POINTS,
    POSE,
    RANGE,
    ZONES,
    Event,
    read_events,
    write_event,
)
from armguard.sense.health import SIGNS, Fault, SensorHealth
from armguard.sense.history import JointHistory
from armguard.sense.station import Station, stations_of
from armguard.sense.world import World, sensed_space

# A frame may be this much newer than the newest joint positions [s].
AHEAD = 0.02

# Most changes of the map that a guard is given at once.
MOST_DELTAS = 512

# The event of a frame of each form.
EVENTS: dict[Form, int] = {
    "zones": ZONES,
    "image": DEPTH,
    "points": POINTS,
    "beam": RANGE,
    "infrared": INFRARED,
    "capacitive": CAPACITIVE,
}


class Sense:
    """Sensors of a scene, and the map of cells that they fill.

    Joint positions and frames come in with their stamps, on one clock. A bad one never
    raises: an `Intake` that names the cause is returned and counted. Links, held
    objects and modelled objects are not taken for foreign ones. A sensor at fault frees
    no more space, and what it hits still counts.

    Attributes:
        cells: The map.
        intakes: How many frames and joint positions became what.

    Args:
        scene: A scene with `sensors` and `sensing`.
        guard: A guard of it, which gets the changes of the map and places objects.
        record: A binary file, which gets all joint positions and frames, to be played
            by `play` or `armguard sense --play`.

    Raises:
        SceneError: The scene has no sensors, or no sensed space; or a robot evades and
            SciPy is missing.

    Example:
        >>> import numpy as np
        >>> import armguard as ag
        >>> scene = ag.bay_scene("path")
        >>> scene.set_sensing(
        ...     region={"centre": (-0.4, 0, 1.1), "size": 128}, cell=0.025,
        ...     unknown="still", intruder={"speed": 1.6, "size": 0.05},
        ... )
        >>> made = scene.add_sensor(
        ...     "top", kind="depth", size=(64, 48), focal=60, range=(0.2, 2.5),
        ...     pose=ag.Pose(xyz=(-0.2, 0, 2.3), rpy=(np.pi, 0, 0)),
        ... )
        >>> sense = ag.Sense(scene)
        >>> sense.joints(scene.home, 0.0).name, sense.joints(scene.home, 0.05).name
        ('TAKEN', 'TAKEN')
        >>> sense.depth("top", np.full((48, 64), 2.25), 0.05).name
        'TAKEN'
    """

    def __init__(
        self, scene: Scene, guard: Monitor | None = None,
        record: BufferedIOBase | None = None,
    ) -> None:  # fmt: skip
        space = sensed_space(scene)
        self._record, self._space = record, space
        self._world, self._guard = World(scene, guard), guard
        region, intruder = space.region, space.intruder
        self.cells = CellMap(
            region.centre, space.cell, region.size,
            intruder_speed=intruder.speed if space.unknown == "moving" else None,
        )  # fmt: skip
        self._history = JointHistory(*self._world.joint_figures())
        self._filling = Filling(self._world, self.cells, guard, intruder.speed)
        self._stations = stations_of(scene, space, self._world)
        self.intakes: Counter[Intake] = Counter()
        self._start, self._sent = inf, -inf

    @property
    def health(self) -> Mapping[str, SensorHealth]:
        """Health of each sensor by its name; as text, its state in words."""
        return MappingProxyType({n: one.health for n, one in self._stations.items()})

    @property
    def missing(self) -> Mapping[str, float]:
        """Modelled objects through which sensors look, and since when [s]."""
        return MappingProxyType(self._filling.missing.since)

    @property
    def clusters(self) -> Records[Cluster]:
        """Bodies that move, if a robot evades; see `Guard.update_clusters`."""
        followed = self._filling.clusters
        return records(0, Cluster) if followed is None else followed.found()

    @property
    def stamp(self) -> float:
        """Time of the newest measurement in the map, minus infinity without any [s]."""
        return self._filling.stamp

    def joints(self, q: ArrayLike, stamp: float) -> Intake:
        """Take joint positions, in every cycle.

        Args:
            q: Joint positions in the order of the scene's `q_names` [rad or m].
            stamp: When they were measured [s].
        """
        if not self._history.add(q, stamp):
            return self._counted(Intake.NO_JOINTS)
        if self._record is not None:
            write_event(self._record, JOINTS, "", stamp, q)
        now = self._history.newest
        if self._start == inf:
            # No claim is older than the first joint positions.
            self._start, self._sent = now, now - 1.0
            if self._space.start is not None:
                self._filling.clear(self._space.start.clear, self._history)
        for station in self._stations.values():
            station.health.listen(now, self._start)
            self._check_trust(station)
        self._update_guard()
        return self._counted(Intake.TAKEN)

    def depth(self, name: str, image: ArrayLike, stamp: float) -> Intake:
        """Take an image of a depth camera.

        Args:
            name: Name of the sensor.
            image: Depths, shape (rows, columns): floats [m] or integers [mm]; NaN,
                infinity or 0 where nothing was measured.
            stamp: Its stamp [s].
        """
        return self._take(name, "image", image, None, stamp)

    def zones(
        self, name: str, distance: ArrayLike, status: ArrayLike | None, stamp: float
    ) -> Intake:
        """Take a frame of an array of zones.

        Args:
            name: Name of the sensor.
            distance: Distances, shape (rows, columns) or flat: floats [m] or integers
                [mm].
            status: Status of each by the codes of the kind of sensor; None if every
                positive finite distance was measured.
            stamp: Its stamp [s].
        """
        return self._take(name, "zones", distance, status, stamp)

    def points(self, name: str, xyz: ArrayLike, stamp: float) -> Intake:
        """Take the points of a lidar, or of another sensor that gives points.

        Args:
            name: Name of the sensor.
            xyz: The points in its frame, shape (..., 3): floats [m]. Not finite ones
                are left out; those beyond its range only free space.
            stamp: Its stamp [s].
        """
        return self._take(name, "points", xyz, None, stamp)

    def range(self, name: str, metres: ArrayLike, stamp: float) -> Intake:
        """Take the distance of a sensor that measures one within a cone.

        Args:
            name: Name of the sensor.
            metres: The distance: a float [m] or an integer [mm]. Minus infinity is a
                body that is too near, plus infinity none within range, NaN no
                measurement.
            stamp: Its stamp [s].
        """
        return self._take(name, "beam", metres, None, stamp)

    def infrared(self, name: str, volts: ArrayLike, stamp: float) -> Intake:
        """Take the signal of an infrared sensor.

        Args:
            name: Name of the sensor.
            volts: The signal, without that of other light [V].
            stamp: Its stamp [s].
        """
        return self._take(name, "infrared", volts, None, stamp)

    def capacitive(self, name: str, signal: ArrayLike, stamp: float) -> Intake:
        """Take the signal of a capacitive pad.

        Args:
            name: Name of the pad.
            signal: The signal, in units of its gain.
            stamp: Its stamp [s].
        """
        return self._take(name, "capacitive", signal, None, stamp)

    @property
    def noticed(self) -> Mapping[str, float]:
        """Pads that notice something, and the radius of the ball in which it is [m]."""
        pads = {n: one.pad for n, one in self._stations.items() if one.pad is not None}
        return MappingProxyType({n: p.radius for n, p in pads.items() if p.radius > 0})

    def frame(
        self, name: str, values: ArrayLike, status: ArrayLike | None, stamp: float
    ) -> Intake:
        """Take a frame of any sensor, as the method of its kind does.

        Args:
            name: Name of the sensor.
            values: Its values.
            status: Status of zones; None for other kinds.
            stamp: Its stamp [s].
        """
        station = self._stations.get(name) if isinstance(name, str) else None
        form: Form = "zones" if station is None else station.view.sensor.form
        return self._take(name, form, values, status, stamp)

    def move_sensor(self, name: str, pose: ArrayLike, stamp: float) -> Intake:
        """Take another pose of a sensor in the world, before its frame of that pose.

        Args:
            name: Name of a sensor that no link carries.
            pose: Its frame in the world, shape (4, 4).
            stamp: Its stamp [s].
        """
        station = self._stations.get(name) if isinstance(name, str) else None
        if station is None:
            return self._counted(Intake.UNKNOWN_SENSOR)
        try:
            made = Pose.from_matrix(np.asarray(pose, dtype=np.float64))
        except (PoseError, TypeError, ValueError):
            return self._counted(Intake.WRONG_TYPE)
        if station.view.sensor.on is not None:
            return self._counted(Intake.WRONG_KIND)
        if self._record is not None:
            write_event(self._record, POSE, name, number_of(stamp), pose)
        station.move(made)
        self._filling.moved(name)
        return self._counted(Intake.TAKEN)

    @property
    def sent(self) -> float:
        """When all claims held, with the changes taken so far [s]."""
        return self._sent

    def changes(self, most: int = MOST_DELTAS) -> Records[Delta]:
        """Changes of the map since they were last taken, see `CellMap.take_deltas`.

        With moving intruders the map forgets what they may have reached, so all of its
        claims hold at the newest frame. Else they hold since the oldest of the newest
        frames of the sensors that have freed space which was not withdrawn. Changes
        that wait keep `sent` back.

        Args:
            most: Greatest count of changes.
        """
        changes = self.cells.take_deltas(most)
        holds = [one.freed for one in self._stations.values() if one.freed > -inf]
        if self.cells.intruder_speed is not None:
            holds = [self.stamp]
        if holds and len(changes) < most:
            self._sent = max(self._sent, min(holds))
        return changes

    def _take(
        self, name: str, form: Form, values: ArrayLike, status: ArrayLike | None,
        stamp: float,
    ) -> Intake:  # fmt: skip
        station = self._stations.get(name) if isinstance(name, str) else None
        if station is None:
            return self._counted(Intake.UNKNOWN_SENSOR)
        health, now = station.health, self._history.newest
        if self._record is not None:
            # A stamp that is no number is NaN in the file.
            stamped = number_of(stamp)
            write_event(self._record, EVENTS[form], name, stamped, values, status)
        try:
            if station.view.sensor.form != form:
                raise BadFrameError(Intake.WRONG_KIND)
            taken = self._time_of(station, stamp)
            found = station.read(values, status)
            intake = self._filling.take(
                station, found, taken, self._history, self._sent
            )
            self._check_trust(station)
            self._update_guard()
        except BadFrameError as error:
            intake = error.intake
            if intake in SIGNS and isfinite(now):
                health.sign(SIGNS[intake], now)
        health.intakes[intake] += 1
        return self._counted(intake)

    def play(self, events: Path | Iterable[Event]) -> int:
        """Take joint positions and frames again; how many there are.

        The same events fill the same map to the bit.

        Args:
            events: Events, or a file of them.

        Raises:
            RecordingError: It cannot be read, or is no file of frames.
        """
        count = 0
        forms = {event: form for form, event in EVENTS.items()}
        found = read_events(events) if isinstance(events, Path) else events
        for event, name, stamp, arrays in found:
            values: Any = arrays[0] if arrays else None
            status = arrays[1] if len(arrays) > 1 else None
            count += 1
            if event == JOINTS:
                self.joints(values, stamp)
            elif event == POSE:
                self.move_sensor(name, values, stamp)
            else:
                self._take(name, forms[event], values, status, stamp)
        return count

    def _time_of(self, station: "Station", stamp: float) -> float:
        """When a frame was measured [s].

        Raises:
            BadFrameError: Its stamp cannot be.
        """
        given = number_of(stamp)
        if not isfinite(given):
            raise BadFrameError(Intake.NO_STAMP)
        health, sensor, now = station.health, station.view.sensor, self._history.newest
        if given <= health.stamp:
            raise BadFrameError(Intake.STAMP_BACK)
        if given > now + AHEAD and isfinite(now):
            raise BadFrameError(Intake.STAMP_AHEAD)
        health.stamp, health.silent = given, False
        if now - given > sensor.period + sensor.jitter:
            health.sign(Fault.LATE, now, f"{(now - given) * 1e3:.0f} ms")
        return given - sensor.delay

    def _check_trust(self, station: "Station") -> None:
        """Withdraw the space that a sensor has freed if it is at fault.

        Of a silent one too, unless moving intruders close it in time. Where unknown
        space counts as free, that is no answer: then the whole map grows old.
        """
        health = station.health
        waits = health.silent and self.cells.intruder_speed is None
        distrusted = station.freed > -inf and (waits or not health.trusted)
        if distrusted and not self._space.may_be_free:
            self._filling.withdraw(station, self._history)

    def _update_guard(self) -> None:
        """Let the guard take a bounded number of changes."""
        freed = any(one.freed > -inf for one in self._stations.values())
        if self._guard is not None and (freed or self._sent >= self._start):
            changes = self.changes()
            self._guard.update_cells(changes, self._sent)

    def _counted(self, intake: Intake) -> Intake:
        self.intakes[intake] += 1
        return intake
