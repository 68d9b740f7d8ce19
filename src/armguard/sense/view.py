"""The view of a sensor: its zones in space, and how far it surely sees."""

from math import atan, atan2, ceil, cos, inf, pi, sin, sqrt, tan
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armguard.scene.sensors import PARTS, SceneSensor
from armguard.sense.frames import Frame
from armguard.sense.reading import split_depths

Scalar = TypeVar("Scalar", bound=np.generic)

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Bools = NDArray[np.bool_]

# Standard deviations of the noise that are taken for its greatest.
SIGMAS = 3.0

# Rays along each edge of a zone, with which its distance is predicted.
RAYS = 3

# Radius of the middle part of a beam that is freed, as a share of that of the beam: two
# of its parts along each edge, from corner to corner [-].
INNER = 2.0 * sqrt(2.0) / PARTS

# Pixels along each edge of a part of a beam, by which space is freed.
FINER = 4

# Pixels along each edge of an image of which distances are predicted.
LOOKS = 24


class View:
    """Zones or pixels of a sensor.

    Attributes:
        sensor: The sensor.
        slopes: Length of the ray of each zone at depth 1, shape (rows, columns).
        cone: Which zones are in the view, shape (rows, columns): all but the parts of
            a beam outside its cone.
        reach: Depth up to which the sensor surely sees what has the least size [m].
        span: Distance beyond which its frames neither hit nor free, infinite for points
            [m].
        figures: Error, standard deviations of the noise that are taken for its
            greatest, its coefficients, and the depth beyond which it no more grows;
            focal lengths, principal point, and depth within which surfaces merge;
            shape (11,).
        places: Rows and columns of the zones that are predicted, each of shape (z,).
        ways: Unit vectors of the rays of these, in the sensor, shape (z, rays, 3).
        along: Their parts along the axis of the sensor, shape (z · rays,).

    Args:
        sensor: The sensor.
        size: Least diameter of what has to be seen [m].
        cell: Edge of a cell of the map [m].
    """

    def __init__(self, sensor: SceneSensor, size: float, cell: float = inf) -> None:
        self.sensor = sensor
        columns, rows = sensor.zones
        x = (np.arange(columns) - sensor.middle[0]) / sensor.focal[0]
        y = (np.arange(rows) - sensor.middle[1]) / sensor.focal[1]
        self._x, self._y = np.meshgrid(x, y)
        self.slopes = np.sqrt(1.0 + self._x**2 + self._y**2)
        self.cone = np.ones((rows, columns), dtype=np.bool_)
        if sensor.narrow or sensor.form == "capacitive":
            self.cone = self._corners(-0.5) < tan(0.5 * sensor.view[0])
        self.reach = min(sure_reach(sensor, size, cell), sensor.range[1])
        widest = float(self._corners(0.5).max()) if sensor.form != "points" else inf
        self._widest = atan(widest)
        self.span = self.reach * sqrt(1.0 + widest * widest)
        a, b, c = sensor.noise if sensor.form != "infrared" else (0.0, 0.0, 0.0)
        deepest = 2.0 * sensor.range[1]
        self.figures = np.array(
            [
                *(sensor.error, SIGMAS, a, b, c, deepest),
                *(*sensor.focal, *sensor.middle, sensor.merge),
            ]
        )
        picked = (
            np.unique(np.linspace(0, n - 1, min(n, LOOKS)).round().astype(np.int64))
            if sensor.image
            else np.arange(n)
            for n in (rows, columns)
        )
        i, j = np.meshgrid(*picked, indexing="ij")
        self.places = i.ravel(), j.ravel()
        parts = (
            np.zeros(1)
            if sensor.form != "zones"
            else (np.arange(RAYS) + 0.5) / RAYS - 0.5
        )
        u, v = (part.ravel() for part in np.meshgrid(parts, parts))
        ways = np.stack(
            [
                self._x[self.places][:, None] + u / sensor.focal[0],
                self._y[self.places][:, None] + v / sensor.focal[1],
                np.ones((len(self.places[0]), len(u))),
            ],
            axis=2,
        )
        self.ways = ways / np.linalg.norm(ways, axis=2, keepdims=True)
        self.along = np.ascontiguousarray(self.ways[..., 2].reshape(-1))

    def _corners(self, ways: float) -> Floats:
        """Distances of corners of zones from the axis, at depth 1, (rows, columns).

        Args:
            ways: Way from the middle of a zone to the corner, away from the axis:
                0.5 for the farthest one, -0.5 for the nearest one [zones].
        """
        aside = np.abs(self._x) + ways / self.sensor.focal[0]
        along = np.abs(self._y) + ways / self.sensor.focal[1]
        return np.asarray(np.hypot(np.maximum(aside, 0.0), np.maximum(along, 0.0)))

    def slack(self, depth: Floats) -> Floats:
        """How far off a distance may be by the sensor's error and its noise [m]."""
        if self.sensor.form == "infrared":
            # Its noise is that of the signal, and is in its distances.
            return np.full_like(depth, self.sensor.error)
        a, b, c = self.sensor.noise
        depth = np.minimum(depth, 2.0 * self.sensor.range[1])
        noise = a + b * depth + c * depth * depth
        return np.asarray(self.sensor.error + SIGMAS * noise)

    def points(self, zones: NDArray[np.int64], depth: Floats) -> Floats:
        """Points of predicted zones at depths, in the sensor, shape (n, 3) [m]."""
        i, j = (part[zones] for part in self.places)
        return np.stack([self._x[i, j] * depth, self._y[i, j] * depth, depth], axis=1)

    def zones_at(self, points: Floats) -> NDArray[np.int64]:
        """The zone of each point in the sensor, -1 outside the view, shape (n,).

        Args:
            points: The points, shape (n, 3) [m].
        """
        x, y, z = points.T
        columns, rows = self.sensor.zones
        with np.errstate(divide="ignore", invalid="ignore"):
            j = np.rint(x / z * self.sensor.focal[0] + self.sensor.middle[0])
            i = np.rint(y / z * self.sensor.focal[1] + self.sensor.middle[1])
        inside = (z > 0.0) & (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        return np.where(inside, i * columns + j, -1).astype(np.int64)

    def predicted(self, values: NDArray[Scalar]) -> NDArray[Scalar]:
        """Values of the predicted zones, of those of all zones, shape (z,)."""
        if self.ways.shape[0] == values.size:
            return values.reshape(-1)
        return values[self.places]

    def beside(self, middles: Floats, radii: Floats) -> Bools:
        """Which balls are outside a cone about the whole view, shape (n,).

        Args:
            middles: Their middles, in the sensor, shape (n, 3) [m].
            radii: Their radii, shape (n,) [m].
        """
        if self._widest >= 0.5 * pi:
            return np.zeros(len(middles), dtype=np.bool_)
        across = np.hypot(middles[:, 0], middles[:, 1])
        away = across * cos(self._widest) - middles[:, 2] * sin(self._widest)
        return np.asarray(away > radii)

    def measured(self, depth: Singles, most: int) -> Floats:
        """Points of zones or pixels with a depth, in the sensor, shape (n, 3) [m].

        Args:
            depth: Their depths, shape (rows, columns), NaN for none [m].
            most: Zones or pixels that are looked at, about; in even steps.
        """
        step = ceil(sqrt(depth.size / most))
        part = slice(None, None, step), slice(None, None, step)
        found = np.stack([self._x[part], self._y[part], np.ones_like(self._x[part])], 2)
        points = (found * depth[part][..., None]).reshape(-1, 3)
        return np.asarray(points[np.isfinite(points[:, 2])])

    def split(self, frame: Frame, cell: float) -> tuple[Singles, Singles]:
        """Depths of a frame that hit, and those up to which zones are looked through.

        One hits if it is so near that a later frame can free its cells again. What is
        looked through is less than what was measured, by the error and the noise.

        Args:
            frame: The frame.
            cell: Edge of a cell [m].

        Returns:
            Both of shape (rows, columns), NaN for none [m].
        """
        out = np.empty((2, *frame.depth.shape), dtype=np.float32)
        split_depths(
            frame.depth.reshape(-1), frame.firm.reshape(-1), frame.nothing.reshape(-1),
            self.figures, 2.0 * cell, self.reach, out.reshape(2, -1),
        )  # fmt: skip
        hits, through = out
        if frame.surely is not None:
            through[:] = frame.surely
        return hits, through

    def through(self, frame: Frame) -> Singles:
        """Depths up to which the zones of a frame are looked through, see `split`."""
        return self.split(frame, 0.0)[1]

    def freeing(self, depth: Singles) -> Singles:
        """Depths up to which space is surely free, NaN where it is not.

        A zone is not seen to be filled by an object that fills less of it than its
        share. Such an object has its middle in another zone, and reaches less than half
        a zone into this one. So the half of a zone beside another one is free only as
        far as that one is, and the half at the border of the view is not free at all.

        Args:
            depth: Result of `through`.
        """
        if self.sensor.image:
            return depth
        if self.sensor.narrow:
            inner = 1.001 * INNER * tan(0.5 * self.sensor.view[0])
            depth = np.where(self._corners(0.5) <= inner, depth, np.nan)
            # A cell is compared with several pixels on each side of it.
            return depth.repeat(FINER, axis=0).repeat(FINER, axis=1)
        rows, columns = depth.shape
        halves = np.full((2 * rows + 2, 2 * columns + 2), np.nan, dtype=depth.dtype)
        for i in (1, 2):
            for j in (1, 2):
                halves[i : i + 2 * rows : 2, j : j + 2 * columns : 2] = depth
        tall = np.minimum(np.minimum(halves[:-2], halves[1:-1]), halves[2:])
        return np.minimum(np.minimum(tall[:, :-2], tall[:, 1:-1]), tall[:, 2:])


def sure_reach(sensor: SceneSensor, size: float, cell: float = inf) -> float:
    """Depth up to which what has a least diameter is surely measured [m].

    It fills its share of a zone: in the worst case its middle is at the corner of four
    zones, and a quarter of its disc is in each. Of points one is on it, and their rays
    are as dense as cells.

    Args:
        sensor: The sensor.
        size: The diameter [m].
        cell: Edge of a cell of the map [m].
    """
    if sensor.form == "points":
        return min(size / sqrt(2.0), cell) / sensor.spacing
    if sensor.narrow:
        reach = beam_reach(0.5 * size, sensor.fill) / tan(0.5 * sensor.view[0])
        return min(reach, signal_reach(sensor)) if sensor.form == "infrared" else reach
    widest = 1.0 / min(sensor.focal)
    filled = size * sqrt(pi / (16.0 * sensor.fill))
    return filled / widest if widest > 0.0 else inf


def signal_reach(sensor: SceneSensor) -> float:
    """Distance at which the darkest body that fills its share gives a signal [m]."""
    strength = sensor.fill * sensor.reflectance[0] * cos(sensor.tilt)
    least = SIGMAS * sensor.noise[0]
    return sqrt(sensor.gain * strength / least) - sensor.offset if least > 0.0 else inf


def beam_reach(radius: float, fill: float) -> float:
    """Radius of a beam up to which a disc that reaches its middle part fills its share.

    Args:
        radius: Radius of the disc [m].
        fill: The share [-].

    Returns:
        The radius, 0 if no disc beside the middle part fills so much [m].
    """
    widths = np.linspace(0.0, 4.0 * radius, 4001)[1:]
    seen = [shared(w, radius, INNER * w + radius) >= fill * pi * w * w for w in widths]
    count = len(seen) if all(seen) else int(np.argmin(seen))
    return float(widths[count - 1]) if count else 0.0


def shared(a: float, b: float, apart: float) -> float:
    """Area that two discs have in common [m²].

    Args:
        a: Radius of one [m].
        b: Radius of the other one [m].
        apart: Distance of their middles [m].
    """
    if apart >= a + b:
        return 0.0
    if apart <= abs(a - b):
        return pi * min(a, b) ** 2
    x = (apart * apart + a * a - b * b) / (2.0 * apart)
    y = sqrt(max(a * a - x * x, 0.0))
    return float(a * a * atan2(y, x) + b * b * atan2(y, apart - x) - apart * y)
