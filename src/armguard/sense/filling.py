"""Frames fill the map: what links and models explain is left out."""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.cells.cell_map import CellMap
from armguard.cells.given import Shot
from armguard.guard.monitor import Monitor
from armguard.sense.capacitive import Capacitive
from armguard.sense.clusters import MOST_POINTS, Clusters
from armguard.sense.frames import BadFrameError, Frame, Intake, Points, Signal
from armguard.sense.history import JointHistory
from armguard.sense.masking import Masks
from armguard.sense.missing import MissingObjects
from armguard.sense.prediction import Mount, explained, mount_of, predict
from armguard.sense.station import Station
from armguard.sense.view import SIGMAS, View
from armguard.sense.world import Placed, World

Floats = NDArray[np.float64]

# Distance of a point that is in no map: its ray passes cells, and it hits none [m].
IN_NO_MAP = 1e3


class Moment(NamedTuple):
    """Where a sensor and all primitives were when a frame was measured.

    Attributes:
        taken: When that was [s].
        placed: The primitives.
        mount: The sensor.
    """

    taken: float
    placed: Placed
    mount: Mount


class Filling:
    """Puts frames into a map.

    Attributes:
        stamp: Time of the newest measurement in the map, minus infinity without any
            [s].
        missing: Modelled objects through which sensors look.
        clusters: Bodies that move; None unless a robot evades what may move.

    Args:
        world: The scene.
        cells: The map.
        guard: Has the places of objects; None for those of the scene.
        fastest: Greatest speed of an intruder [m/s].

    Raises:
        SceneError: A robot evades, and SciPy is missing.
    """

    def __init__(
        self, world: World, cells: CellMap, guard: Monitor | None, fastest: float
    ) -> None:
        self._world, self._cells, self._guard = world, cells, guard
        self._masks, self.missing = Masks(world, cells), MissingObjects(world)
        self.stamp = -inf
        evades = any(part.response.evade for part in world.tables.robots)
        self._follows = False
        self.clusters = Clusters(cells, fastest) if evades and fastest > 0.0 else None

    def moved(self, name: str) -> None:
        """A sensor has another place, so static objects are masked again for it."""
        self._masks.forget(name)

    def take(
        self, station: Station, found: Frame | Points | Signal, taken: float,
        history: JointHistory, since: float,
    ) -> Intake:  # fmt: skip
        """Let the map take a frame.

        Args:
            station: Its sensor.
            found: The frame.
            taken: When it was measured [s].
            history: The joint positions.
            since: Claims of free space have to be newer, without moving intruders [s].

        Raises:
            BadFrameError: The joint positions of its time are not known.
        """
        if self._guard is not None and self._world.follow(self._guard):
            self._masks.forget()
        sensor = station.view.sensor
        placed = self._world.at(history, taken, sensor.jitter)
        if placed is None:
            raise BadFrameError(Intake.NO_POSITIONS)
        now = Moment(taken, placed, mount_of(sensor, self._world, placed))
        claimed = taken - sensor.jitter
        fresh = self._cells.intruder_speed is not None or claimed >= since
        if isinstance(found, Signal) and station.pad is not None:
            self._take_pad(station.pad, station.view, found, now)
            return Intake.TAKEN
        if isinstance(found, Signal):
            found = self._distances(station, found, now)
        if isinstance(found, Points):
            trusted = self._take_points(station, found, now, fresh)
        else:
            trusted = self._take_frame(station, found, now, fresh)
        self.stamp = max(self.stamp, claimed)
        if trusted:
            station.freed = claimed
        if self._cells.intruder_speed is not None:
            self._cells.expire(self.stamp)
        return Intake.TAKEN if trusted else Intake.HITS_ONLY

    def clear(self, distance: float, history: JointHistory) -> None:
        """Pass the cells within a distance of all links: nothing is there.

        Args:
            distance: The distance [m].
            history: The joint positions; links are at the newest ones.
        """
        now = history.newest
        placed = self._world.at(history, now, 0.0)
        if placed is not None:
            self._masks.pass_about_links(placed, now, distance)

    def withdraw(self, station: Station, history: JointHistory) -> None:
        """Make space unknown that a sensor has freed, but for what touches a link.

        Args:
            station: The sensor.
            history: The joint positions; links are at the newest ones.
        """
        sensor = station.view.sensor
        placed = self._world.at(history, history.newest, sensor.jitter)
        if placed is None:
            self._cells.mask(())
        else:
            mount = mount_of(sensor, self._world, placed)
            self._masks.set(station.view, mount, placed, all_links=True)
        self._cells.withdraw(station.number, all_frames=station.health.misled)
        station.freed = -inf

    def _take_frame(
        self, station: Station, frame: Frame, now: Moment, fresh: bool
    ) -> bool:
        """Take zones, an image or a beam; whether it frees space."""
        view, health, (taken, placed, mount) = station.view, station.health, now
        prediction = predict(view, mount, placed, self._world)
        beam = view.sensor.narrow
        # A beam has one distance, whose bits may well be those of the last one.
        repeated = not beam and station.tests.repeats(frame.depth, taken)
        hits, through = view.split(frame, self._cells.cell)
        if not view.sensor.image:
            kinds = self._world.kinds
            known = explained(view, mount, placed, kinds, frame, prediction)
            # A beam has one distance: what explains a part of it explains all.
            hits[known.any() if beam else known] = np.nan
        station.tests.test(frame, hits, mount, prediction, taken)
        if not beam:
            station.align(frame, mount, placed, prediction, taken)
        trusted = health.trusted and not repeated and fresh
        if trusted and not beam:
            self.missing.look(view, frame, prediction, taken)
        self._mask(view, now)
        if not trusted:
            through[:] = np.nan
        sensor = view.sensor
        shot = Shot(
            mount.R, mount.origin, sensor.focal, sensor.middle, view.reach, hits,
            view.freeing(through), through,
        )  # fmt: skip
        self._cells.take(
            shot, taken - sensor.jitter, single=not sensor.image,
            error=self._error(view, mount), source=station.number,
        )  # fmt: skip
        if not beam and self.clusters is not None:
            self._follow(station, view.measured(hits, MOST_POINTS), now)
        return trusted

    def _distances(self, station: Station, found: Signal, now: Moment) -> Frame:
        """The signal of an infrared sensor as a frame of distances."""
        view, (taken, placed, mount) = station.view, now
        sensor, finder = view.sensor, station.infrared
        assert finder is not None
        seen = finder.take(found.value, taken, mount.origin, mount.R[:, 2])
        # What the brightest surface at the place of the model explains, is the model.
        prediction = predict(view, mount, placed, self._world)
        cone = view.cone[view.places]
        way = (prediction.near / view.ways[:, 0, 2])[cone].min()
        way -= sensor.error + mount.shift + mount.turn * min(way, sensor.range[1])
        known = finder.signal(way, sensor.reflectance[1])
        known += SIGMAS * finder.noise(known)
        foreign = seen.near <= sensor.range[1] and found.value > known
        hit = np.where(view.cone & foreign, seen.near / view.slopes, np.nan)
        surely = max(seen.surely - sensor.error, 0.0) / view.slopes
        none = np.zeros(view.slopes.shape, dtype=np.bool_)
        negative = view.cone & (found.value < -SIGMAS * finder.noise(0.0))
        return Frame(
            hit, none, view.cone & (not foreign), negative,
            np.where(view.cone, surely, np.nan),
        )  # fmt: skip

    def _take_pad(
        self, pad: Capacitive, view: View, found: Signal, now: Moment
    ) -> None:
        """Take the signal of a pad: it only takes knowledge away."""
        taken, placed, mount = now
        prediction = predict(view, mount, placed, self._world)
        shift = float(placed.shifts.max(initial=0.0))
        known = pad.known(mount, prediction, view.sensor.error + shift)
        radius = pad.take(found.value, taken, known)
        if radius > 0.0:
            error = view.sensor.error + mount.shift
            self._cells.forget(mount.origin, radius + error, taken)

    def _take_points(
        self, station: Station, found: Points, now: Moment, fresh: bool
    ) -> bool:
        """Take points; whether they free space."""
        view, mount = station.view, now.mount
        repeated = station.tests.repeats(found.xyz, now.taken)
        station.tests.test_points(found, now.taken)
        trusted = station.health.trusted and not repeated and fresh
        self._mask(view, now)
        way = np.linalg.norm(found.xyz, axis=1)
        past = np.where(found.beyond, view.sensor.range[1], way - view.slack(way))
        past = np.maximum(past, 0.0) if trusted else np.full(len(way), np.nan)
        scale = np.where(found.beyond, IN_NO_MAP / way, 1.0)
        # A body may reach beyond the ray that it meets, but not to the next one along
        # the diagonal.
        beside = sqrt(2.0) * view.sensor.spacing * view.reach
        self._cells.points(
            scale[:, None] * found.xyz @ mount.R.T + mount.origin,
            mount.origin, now.taken - view.sensor.jitter,
            reach=np.minimum(past, view.reach), clearing=past,
            error=self._error(view, mount) + beside, source=station.number,
        )  # fmt: skip
        if self.clusters is not None:
            near = found.xyz[~found.beyond]
            self._follow(station, near[:: len(near) // MOST_POINTS + 1], now)
        return trusted

    def _follow(self, station: Station, points: Floats, now: Moment) -> None:
        """Follow bodies into a frame, by its points in the sensor, shape (n, 3) [m]."""
        mount, clusters = now.mount, self.clusters
        assert clusters is not None
        world = points @ mount.R.T + mount.origin
        clusters.look(world, mount.origin, station.number, now.taken)
        found = clusters.found()
        if self._guard is not None and (len(found) or self._follows):
            self._guard.update_clusters(found)
        self._follows = len(found) > 0

    def _mask(self, view: View, now: Moment) -> None:
        """Mask links and modelled objects for a frame."""
        self._masks.pass_links(now.placed, now.taken)
        self._masks.set(view, now.mount, now.placed)

    @staticmethod
    def _error(view: View, mount: Mount) -> float:
        """How far off the claims of a frame may be [m]."""
        return view.sensor.error + mount.shift + mount.turn * view.reach
