"""The pose and the delay of a sensor, by its distances to links and objects."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.scene.scene import Scene
from armguard.scene.sensors import SceneSensor
from armguard.sense.alignment import rotation, rotation_vector
from armguard.sense.frames import BadFrameError, frame_of
from armguard.sense.frames_file import DEPTH, JOINTS, POINTS, ZONES, Event
from armguard.sense.surfaces import Expected, Surfaces, expected
from armguard.sense.view import SIGMAS, View

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Postures that a calibration needs, and by how much two of them differ [rad or m].
POSTURES, APART = 24, 0.1

# Frames that are used at most, distances of each, and rays along each edge of a zone.
MOST, MOST_RAYS, RAYS = 200, 100, 4

# Of each round: residuals that count [m], and how many of their standard deviations
# count in full [-].
ROUNDS = (
    *((0.4, 20.0),) * 4, *((0.3, 10.0),) * 3, *((0.2, 5.0),) * 3, *((0.1, 2.0),) * 3,
    *((0.05, 2.0),) * 5,
)  # fmt: skip

# Error of the distance of an oblique surface, as a share of its depth within a zone.
TILTED = 0.1

# Least distances of a fit.
LEAST = 150

# What is expected before any measurement: shift [m], turn [rad] and delay [s].
EXPECTED = np.array([0.05] * 3 + [0.15] * 3 + [0.05])

# Neighbouring distances have common errors, so of so many only one counts.
COMMON = 4.0

# Greatest error of a result, at 3 standard deviations: shift [m], turn [rad], delay
# [s].
GREATEST = (0.003, np.radians(0.5), 0.005)

# Step of the time by which the change of distances is found [s].
TIME_STEP = 0.004

# Motion in two such steps that counts as none [rad or m], and change of a distance
# beyond which another surface is met [m/s].
STILL, FASTEST = 1e-6, 5.0


class Measured(NamedTuple):
    """Distances of a frame.

    Attributes:
        sensor: The sensor.
        stamp: Declared time of the measurement [s].
        rays: Rays of each zone, unit vectors in the sensor, shape (z, r, 3).
        way: Distances along the first axis of the sensor, or along the ray of points,
            shape (z,) [m].
        sigma: Standard deviation of their noise, shape (z,) [m].
    """

    sensor: SceneSensor
    stamp: float
    rays: Floats
    way: Floats
    sigma: Floats


class Calibrated(NamedTuple):
    """Pose and delay of a sensor, or of a ring of sensors.

    Attributes:
        pose: Corrected frame of the entry.
        delay: Corrected delay, None if the motion does not determine it [s].
        shift: How far its origin is from the declared one [m].
        turn: By what angle it is turned [rad].
        sigma: Standard deviations of shift and turn by the axes of the entry, and of
            the delay, shape (7,) [m, rad, s].
        used: Distances that were used.
    """

    pose: Pose
    delay: float | None
    shift: float
    turn: float
    sigma: Floats
    used: int


class Track:
    """Joint positions and distances of one entry, from events.

    Attributes:
        frames: Its frames.

    Args:
        scene: The scene.
        entry: Name of a sensor or of a ring.
        events: Joint positions and frames.

    Raises:
        SceneError: There is no such entry, or it measures no several distances.
    """

    def __init__(self, scene: Scene, entry: str, events: Iterable[Event]) -> None:
        self.sensors = sensors_of(scene, entry)
        self.frames: list[Measured] = []
        views = {n: View(one, 0.05) for n, one in self.sensors.items()}
        q, stamps = [], []
        for event, name, stamp, arrays in events:
            if event == JOINTS and arrays and arrays[0].shape == scene.home.shape:
                q.append(arrays[0])
                stamps.append(stamp)
            elif name in views and event in (ZONES, DEPTH, POINTS) and arrays:
                found = measured(views[name], stamp, arrays)
                self.frames += [found] if found is not None else []
        self._stamps, self._q = np.array(stamps), np.array(q)
        if q:
            early, late = self._stamps[0] + 0.1, self._stamps[-1] - 0.1
            self.frames = [f for f in self.frames if early < f.stamp < late]

    def q(self, stamp: float) -> Floats:
        """Joint positions at a time [rad or m]."""
        stamps = self._stamps
        k = min(max(int(np.searchsorted(stamps, stamp)), 1), len(stamps) - 1)
        share = (stamp - stamps[k - 1]) / (stamps[k] - stamps[k - 1])
        return np.asarray(self._q[k - 1] + share * (self._q[k] - self._q[k - 1]))

    def postures(self) -> int:
        """How many postures the arms had that differ."""
        kept: list[Floats] = []
        for frame in self.frames:
            q = self.q(frame.stamp)
            if all(np.abs(q - one).max() > APART for one in kept):
                kept.append(q)
        return len(kept)


def sensors_of(scene: Scene, entry: str) -> dict[str, SceneSensor]:
    """The sensors of an entry by their names.

    Raises:
        SceneError: There is no such entry, or its sensors measure one distance.
    """
    found = {n: one for n, one in scene.sensors.items() if one.entry == entry}
    if not found:
        known = sorted({one.entry for one in scene.sensors.values()})
        raise SceneError(f"no sensor is named '{entry}'; there are {', '.join(known)}")
    form = next(iter(found.values())).form
    if form not in ("zones", "image", "points"):
        raise SceneError(
            f"sensor '{entry}' measures one distance; a pose needs zones, an image or "
            "points"
        )
    return found


def measured(view: View, stamp: float, arrays: list[NDArray[Any]]) -> Measured | None:
    """Distances of a frame that are beyond doubt; None without any."""
    sensor = view.sensor
    try:
        if sensor.form == "points":
            xyz = arrays[0].reshape(-1, 3)
            way = np.linalg.norm(xyz, axis=1)
            good = np.flatnonzero((way >= sensor.range[0]) & (way <= sensor.range[1]))
            good = good[:: max(len(good) // MOST_RAYS, 1)]
            rays, way = (xyz[good] / way[good, None])[:, None], way[good]
        else:
            status = arrays[1] if len(arrays) > 1 else None
            frame = frame_of(sensor, view.slopes, arrays[0], status)
            firm, way = frame.firm[view.places], frame.depth[view.places]
            good = np.flatnonzero(firm & np.isfinite(way))
            good = good[:: max(len(good) // MOST_RAYS, 1)]
            way, rays = way[good], rays_of(view)[good]
    except (BadFrameError, ValueError):
        return None
    sigma = (view.slack(way) - sensor.error) / SIGMAS
    return Measured(sensor, stamp - sensor.delay, rays, way, sigma)


def rays_of(view: View) -> Floats:
    """Unit vectors of the rays of the predicted zones, shape (z, rays, 3)."""
    if view.sensor.image:
        return np.asarray(view.ways)
    i, j = view.places
    parts = (np.arange(RAYS) + 0.5) / RAYS - 0.5
    u, v = (part.ravel() for part in np.meshgrid(parts, parts))
    sensor = view.sensor
    x = (j[:, None] + u - sensor.middle[0]) / sensor.focal[0]
    y = (i[:, None] + v - sensor.middle[1]) / sensor.focal[1]
    ways = np.stack([x, y, np.ones_like(x)], axis=2)
    return np.asarray(ways / np.linalg.norm(ways, axis=2, keepdims=True))


class Fit:
    """Distances as a function of the pose and the delay.

    Args:
        surfaces: What the sensor sees.
        track: Joint positions and distances.
    """

    def __init__(self, surfaces: Surfaces, track: Track) -> None:
        self._surfaces, self._track = surfaces, track
        picked = np.linspace(0, len(track.frames) - 1, MOST).round().astype(int)
        self._frames = [track.frames[k] for k in np.unique(picked)]

    def expected(self, frame: Measured, x: Floats, later: float = 0.0) -> Expected:
        """Distances of a frame at a pose and a delay, see `Fit.solve`."""
        sensor = frame.sensor
        q = self._track.q(frame.stamp - x[6] + later)
        return expected(self._surfaces, sensor, frame.rays, q, x)

    def solve(self) -> Calibrated:
        """Fit shift and turn of the entry, and the delay, beyond the declared ones.

        Raises:
            SceneError: The postures do not determine them.
        """
        from scipy.optimize import least_squares

        x = np.zeros(7)
        for capture, soft in ROUNDS:
            residual, rows = self._residuals(x, capture)
            if len(residual) < LEAST:
                raise SceneError(
                    "too few distances are of known surfaces: bring links and "
                    "modelled objects into the view"
                )
            # Each round finds the surfaces anew, and is linear between.
            step = least_squares(
                lambda d, r=residual, J=rows: r + J @ d, np.zeros(7),
                jac=lambda d, J=rows: J, loss="soft_l1", f_scale=soft,
                x_scale=EXPECTED,
            )  # fmt: skip
            x = x + step.x
        residual, rows = self._residuals(x, capture)
        return self._result(x, residual[:-7], rows[:-7])

    def _residuals(self, x: Floats, capture: float) -> tuple[Floats, Floats]:
        """Residuals by their standard deviations, and their derivatives.

        Args:
            x: Shift, turn and delay.
            capture: Greatest residual of a distance that counts [m].
        """
        residuals, rows = [], []
        for frame in self._frames:
            now = self.expected(frame, x)
            with np.errstate(invalid="ignore"):
                off = frame.way - now.way
                at = now.whole & (np.abs(off) < capture)
            if not at.any():
                continue
            # The distance of an oblique surface is that of any part of a zone.
            sigma = np.hypot(frame.sigma[at], TILTED * np.minimum(now.spread[at], 1.0))
            slope = self._slope(frame, x)[at]
            line = np.hstack([now.rows[at], -slope[:, None]])
            residuals.append(off[at] / sigma)
            rows.append(-line / sigma[:, None])
        residuals.append(x / EXPECTED)
        rows.append(np.diag(1.0 / EXPECTED))
        return np.concatenate(residuals), np.concatenate(rows)

    def _slope(self, frame: Measured, x: Floats) -> Floats:
        """Change of the distances of a frame with time, 0 at an edge [m/s]."""
        times = (-TIME_STEP, TIME_STEP)
        first, last = (self._track.q(frame.stamp - x[6] + later) for later in times)
        if np.abs(last - first).max() < STILL:
            return np.zeros(len(frame.way))
        ends = [self.expected(frame, x, later).way for later in times]
        with np.errstate(invalid="ignore"):
            slope = (ends[1] - ends[0]) / (times[1] - times[0])
        return np.where(np.abs(slope) < FASTEST, slope, 0.0)

    def _result(self, x: Floats, residual: Floats, rows: Floats) -> Calibrated:
        """The result, if the postures determine it.

        Raises:
            SceneError: They do not.
        """
        spread = max(1.4826 * float(np.median(np.abs(residual))), 1.0)
        H = rows.T @ rows + np.diag(EXPECTED**-2.0)
        covariance = COMMON * spread**2 * np.linalg.inv(H)
        for part, unit, name in ((0, 1e3, "mm along"), (3, 180 / np.pi, "° about")):
            values, axes = np.linalg.eigh(covariance[part : part + 3, part : part + 3])
            worst = SIGMAS * float(np.sqrt(values[-1]))
            if worst > GREATEST[part // 3]:
                axis = ", ".join(f"{c:.1f}" for c in axes[:, -1])
                raise SceneError(
                    "the postures do not determine the pose: it may be "
                    f"{worst * unit:.1f} {name} ({axis}) of its frame off; add "
                    "postures in which it sees other surfaces"
                )
        sigma = np.sqrt(np.diag(covariance))
        first = next(iter(self._track.sensors.values()))
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = rotation(x[3:6]), x[:3]
        timed = SIGMAS * float(sigma[6]) <= GREATEST[2]
        return Calibrated(
            Pose.from_matrix(first.mount.matrix() @ X),
            max(first.delay + float(x[6]), 0.0) if timed else None,
            float(np.linalg.norm(x[:3])),
            float(np.linalg.norm(rotation_vector(X[:3, :3]))),
            sigma,
            len(residual),
        )


def calibrated(scene: Scene, entry: str, events: Iterable[Event]) -> Calibrated:
    """Pose and delay of a sensor, or of a ring, from frames at several postures.

    Args:
        scene: The scene; its links and objects are the surfaces.
        entry: Name of a sensor or of a ring of sensors.
        events: Joint positions and frames, at rest and in motion.

    Raises:
        SceneError: The postures do not determine the pose.
    """
    track = Track(scene, entry, events)
    count = track.postures()
    if count < POSTURES:
        raise SceneError(
            f"the frames of '{entry}' are of {count} postures; {POSTURES} are needed, "
            f"each {APART:g} rad from the others in a joint"
        )
    return Fit(Surfaces(scene), track).solve()
