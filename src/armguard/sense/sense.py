"""Sensors of a scene fill its map of cells: frames in, changes of the map out."""

from collections import Counter
from collections.abc import Mapping
from io import BufferedIOBase
from math import inf, isfinite, nan
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.cell_map import CellMap
from armguard.cells.deltas import Delta
from armguard.guard.monitor import Monitor
from armguard.record import Records
from armguard.scene.scene import Scene
from armguard.sense.alignment import Alignment
from armguard.sense.frames import BadFrameError, Frame, Intake, frame_of
from armguard.sense.frames_file import (
    DEPTH,
    JOINTS,
    ZONES,
    read_events,
    write_event,
)
from armguard.sense.health import SIGNS, Fault, FrameTests, SensorHealth
from armguard.sense.history import JointHistory
from armguard.sense.masking import Masks
from armguard.sense.missing import MissingObjects
from armguard.sense.prediction import Mount, Prediction, explained, mount_of, predict
from armguard.sense.view import View
from armguard.sense.world import Placed, World, sensed_space

Floats = NDArray[np.float64]

# A frame may be this much newer than the newest joint positions [s].
AHEAD = 0.02

# Fits in a row that have to show that a sensor is mounted elsewhere.
CERTAIN_FITS = 2

# Most changes of the map that a guard is given at once.
MOST_DELTAS = 512


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
        guard: A guard of it, which gets the changes of the map; objects are then where
            it has them.
        record: A binary file, which gets all joint positions and frames, to be played
            by `play` or `armguard sense --play`.

    Raises:
        SceneError: The scene has no sensors, or no sensed space.

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
        self._record = record
        self._world, self._guard = World(scene, guard), guard
        region, intruder = space.region, space.intruder
        self.cells = CellMap(
            region.centre, space.cell, region.size,
            intruder_speed=intruder.speed if space.unknown == "moving" else None,
        )  # fmt: skip
        self._history = JointHistory(*self._world.joint_figures())
        self._masks = Masks(self._world, self.cells)
        self._missing = MissingObjects(self._world)
        self._stations = {
            name: Station(View(sensor, intruder.size), self._world)
            for name, sensor in scene.sensors.items()
        }
        self.intakes: Counter[Intake] = Counter()
        self._start, self._stamp, self._sent = inf, -inf, -inf

    @property
    def health(self) -> Mapping[str, SensorHealth]:
        """Health of each sensor by its name; as text, its state in words."""
        return MappingProxyType({n: one.health for n, one in self._stations.items()})

    @property
    def missing(self) -> Mapping[str, float]:
        """Modelled objects through which sensors look, and since when [s]."""
        return MappingProxyType(self._missing.since)

    @property
    def stamp(self) -> float:
        """Time of the newest measurement in the map, minus infinity without any [s]."""
        return self._stamp

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
        for station in self._stations.values():
            station.health.listen(now, self._start)
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
        return self._take(name, True, image, None, stamp)

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
        return self._take(name, False, distance, status, stamp)

    @property
    def sent(self) -> float:
        """When all claims held, with the changes taken so far [s]."""
        return self._sent

    def changes(self, most: int = MOST_DELTAS) -> Records[Delta]:
        """Changes of the map since they were last taken, see `CellMap.take_deltas`.

        With moving intruders the map forgets what they may have reached, so all of its
        claims hold at the newest frame. Else they hold since the oldest of the newest
        frames of all sensors that have freed space. Changes that wait keep `sent` back.

        Args:
            most: Greatest count of changes.
        """
        freed = [one.freed for one in self._stations.values() if one.freed > -inf]
        changes = self.cells.take_deltas(most)
        if freed and len(changes) < most:
            holds = min(freed) if self.cells.intruder_speed is None else self._stamp
            self._sent = max(self._sent, holds)
        return changes

    def _take(
        self, name: str, image: bool, values: ArrayLike, status: ArrayLike | None,
        stamp: float,
    ) -> Intake:  # fmt: skip
        station = self._stations.get(name) if isinstance(name, str) else None
        if station is None:
            return self._counted(Intake.UNKNOWN_SENSOR)
        health, now = station.health, self._history.newest
        try:
            self._write(DEPTH if image else ZONES, name, stamp, values, status)
            if station.view.sensor.image is not image:
                raise BadFrameError(Intake.WRONG_KIND)
            taken = self._time_of(station, stamp)
            view = station.view
            frame = frame_of(view.sensor, view.slopes, values, status)
            intake = self._fill(station, frame, taken)
        except BadFrameError as error:
            intake = error.intake
            if intake in SIGNS and isfinite(now):
                health.sign(SIGNS[intake], now)
        health.intakes[intake] += 1
        return self._counted(intake)

    def play(self, path: Path) -> int:
        """Take all joint positions and frames of a file; how many there are.

        The same file fills the same map to the bit.

        Args:
            path: The file.

        Raises:
            RecordingError: It cannot be read, or is no file of frames.
        """
        count = 0
        for event, name, stamp, arrays in read_events(path):
            values: Any = arrays[0] if arrays else None
            status = arrays[1] if len(arrays) > 1 else None
            count += 1
            if event == JOINTS:
                self.joints(values, stamp)
            elif event == ZONES:
                self.zones(name, values, status, stamp)
            else:
                self.depth(name, values, stamp)
        return count

    def _write(
        self, event: int, name: str, stamp: float, values: ArrayLike | None,
        status: ArrayLike | None,
    ) -> None:  # fmt: skip
        """Write a frame into the record; a stamp that is no number is NaN in it."""
        if self._record is not None:
            write_event(self._record, event, name, number_of(stamp), values, status)

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
        health.stamp = given
        if now - given > sensor.period + sensor.jitter:
            health.sign(Fault.LATE, now, f"{(now - given) * 1e3:.0f} ms")
        return given - sensor.delay

    def _fill(self, station: "Station", frame: Frame, taken: float) -> Intake:
        """Let the map take a frame.

        Raises:
            BadFrameError: The joint positions of its time are not known.
        """
        view, health = station.view, station.health
        self._update_world()
        placed = self._world.at(self._history, taken, view.sensor.jitter)
        if placed is None:
            raise BadFrameError(Intake.NO_POSITIONS)
        mount = mount_of(view.sensor, self._world, placed)
        prediction = predict(view, mount, placed, self._world)
        repeated = station.tests.repeats(frame, taken)
        hits = self._hits(view, mount, placed, frame, prediction)
        station.tests.test(frame, hits, mount, prediction, taken)
        station.align(frame, mount, placed, prediction, taken)
        claimed = taken - view.sensor.jitter
        trusted = health.trusted and not repeated
        if self.cells.intruder_speed is None:
            # Space that a sensor frees first must not be older than the guard assumes.
            trusted = trusted and claimed >= self._sent
        if trusted:
            self._missing.look(view, frame, prediction, taken)
        self._masks.pass_links(placed, taken)
        self._masks.set(view, mount, placed)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = mount.R, mount.origin
        through = view.through(frame)
        if not trusted:
            through[:] = np.nan
        self.cells.depth(
            hits, T, view.sensor.focal, view.sensor.middle, claimed,
            reach=view.reach, single=not view.sensor.image,
            freeing=view.freeing(through), clearing=through,
            error=view.sensor.error + mount.shift + mount.turn * view.reach,
        )  # fmt: skip
        self._stamp = max(self._stamp, claimed)
        if trusted:
            station.freed = claimed
        if self.cells.intruder_speed is not None:
            self.cells.expire(self._stamp)
        self._update_guard()
        return Intake.TAKEN if trusted else Intake.HITS_ONLY

    def _hits(
        self, view: View, mount: Mount, placed: Placed, frame: Frame,
        prediction: Prediction,
    ) -> Floats:  # fmt: skip
        """Depths of a frame that links and modelled objects do not explain [m].

        What is too far to be freed again would stay in the map.
        """
        counts = view.clearable(frame.depth, self.cells.cell)
        if not view.sensor.image:
            kinds = self._world.kinds
            counts &= ~explained(view, mount, placed, kinds, frame, prediction)
        return np.where(counts, frame.depth, np.nan)

    def _update_world(self) -> None:
        """Take over where the guard has static objects."""
        if self._guard is not None and self._world.follow(self._guard):
            self._masks.forget()

    def _update_guard(self) -> None:
        """Let the guard take a bounded number of changes."""
        freed = any(one.freed > -inf for one in self._stations.values())
        if self._guard is not None and freed:
            changes = self.changes()
            self._guard.update_cells(changes, self._sent)

    def _counted(self, intake: Intake) -> Intake:
        self.intakes[intake] += 1
        return intake


class Station:
    """A sensor with its health and its tests.

    Attributes:
        view: Its view.
        health: Its health.
        tests: Tests of its frames.
        freed: Time of the newest of its frames that has freed space, minus infinity
            without any [s].

    Args:
        view: Its view.
        world: The scene.
    """

    def __init__(self, view: View, world: World) -> None:
        self.view, self.health = view, SensorHealth(view.sensor)
        self.tests = FrameTests(view, self.health)
        self._alignment = Alignment(view, world.kinds, world.model_errors)
        self._certain, self.freed = 0, -inf

    def align(
        self, frame: Frame, mount: Mount, placed: Placed, prediction: Prediction,
        now: float,
    ) -> None:  # fmt: skip
        """Compare the place of the sensor with its frames; see `Alignment.add`."""
        made = self._alignment.add(frame, mount, placed, prediction, now)
        offset = self._alignment.offset
        if made and offset is not None:
            self._certain = self._certain + 1 if offset.certain else 0
        if self._certain >= CERTAIN_FITS:
            self.health.sign(Fault.MOVED, now, str(offset))


def number_of(stamp: object) -> float:
    """A stamp as a number, NaN if it is none [s]."""
    try:
        return float(stamp)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return nan
