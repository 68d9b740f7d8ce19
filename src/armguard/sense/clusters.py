"""Clusters of cells that have appeared, followed from frame to frame."""

from collections import deque
from dataclasses import dataclass, field
from itertools import product
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.cells.cell_map import CellMap
from armguard.cells.grid import Bools
from armguard.cells.state import BLOCK_SIDE, MEMBERS
from armguard.cells.view import places_of
from armguard.errors import SceneError
from armguard.guard.clusters import CONFIRMED, FOLLOWED, MOST_CLUSTERS, Cluster
from armguard.record import Records, records

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Time for which cells that appeared where space was known free count as new [s].
NEW = 2.0

# Greatest counts: of new cells, of points of a frame, of tracks; least count of points
# of a part. With more new cells a frame has no clusters.
MOST_CELLS, MOST_POINTS, MOST_TRACKS, LEAST_POINTS = 4096, 20_000, 16, 3

# A body moves if its velocity follows from so many sightings over so much time [s], is
# at least this fast [m/s], and so many times as fast as its error [-]; a smaller
# multiple suffices once it is known to move.
SIGHTINGS, SPAN, SLOWEST, SURE, KNOWN = 4, 0.06, 0.03, 2.0, 1.0

# Share of the span of the sightings that two of them are apart for a slope [-].
APART = 0.4

# Standard deviations by which a velocity may be off, and of a normal distribution by
# its median absolute deviation [-].
SIGMAS, OF_MEDIAN = 3.0, 1.4826

# Least standard deviation of the middle of a body in a frame, and the greatest one of
# sightings that agree [m].
LEAST_ERROR, AGREE = 3e-3, 0.01

# Directions in which the outermost points of a part are kept: to the faces, edges and
# corners of a cube, shape (26, 3).
AROUND = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


class Part(NamedTuple):
    """Points of one body in a frame.

    Attributes:
        sensor: Number of the sensor.
        stamp: When they were measured [s].
        middle: Their mean, shape (3,) [m].
        low: Lower corner of the box around them, shape (3,) [m].
        high: Upper corner [m].
        ends: The outermost of them to all sides, shape (26, 3) [m].
        behind: Way from them to the other side of the body, if that is as deep as it
            looks wide, shape (3,) [m].
    """

    sensor: int
    stamp: float
    middle: Floats
    low: Floats
    high: Floats
    ends: Floats
    behind: Floats


class Velocity(NamedTuple):
    """Velocity of a body.

    Attributes:
        mean: The velocity, shape (3,) [m/s].
        error: How far off it may be, infinite before it is known [m/s].
    """

    mean: Floats
    error: float


UNKNOWN = Velocity(np.zeros(3), inf)


@dataclass(slots=True)
class Track:
    """A body that is followed.

    Attributes:
        number: Its number.
        parts: Its sightings, the newest last.
        velocity: What follows from them.
        moves: Whether it surely moves, and no faster than bodies do.
    """

    number: int
    parts: deque[Part] = field(default_factory=deque)
    velocity: Velocity = UNKNOWN
    moves: bool = False

    def add(self, part: Part, fastest: float) -> None:
        """Add a sighting, and fit the velocity.

        Args:
            part: The sighting.
            fastest: Greatest speed of a body [m/s].
        """
        self.parts.append(part)
        while self.parts[0].stamp < part.stamp - FOLLOWED:
            self.parts.popleft()
        self.velocity = velocity_of(self.parts, inf if self.moves else AGREE)
        speed, error = float(np.linalg.norm(self.velocity.mean)), self.velocity.error
        least = (KNOWN if self.moves else SURE) * error
        self.moves = max(SLOWEST, least) < speed <= fastest + error

    @property
    def stamp(self) -> float:
        """Time of the newest sighting [s]."""
        return max(part.stamp for part in self.parts)

    def box(self, stamp: float) -> tuple[Floats, Floats]:
        """Corners of the box around all sightings, each moved on to a time [m].

        One sensor sees one side: then the body reaches behind that.
        """
        low, high = np.full(3, inf), np.full(3, -inf)
        alone = len({part.sensor for part in self.parts}) == 1
        for part in self.parts:
            way = (stamp - part.stamp) * self.velocity.mean
            behind = part.behind if alone else np.zeros(3)
            low = np.minimum(low, part.low + way + np.minimum(behind, 0.0))
            high = np.maximum(high, part.high + way + np.maximum(behind, 0.0))
        return low, high

    def radius(self, stamp: float) -> float:
        """Radius of the ball around the middle of that box that holds all of them [m].

        None is known of a body that one sensor sees, and it is 0.
        """
        if len({part.sensor for part in self.parts}) == 1:
            return 0.0
        low, high = self.box(stamp)
        ways = np.array([stamp - part.stamp for part in self.parts])[:, None, None]
        ends = np.array([part.ends for part in self.parts]) + ways * self.velocity.mean
        return float(np.linalg.norm(ends - 0.5 * (low + high), axis=2).max())


class Clusters:
    """Follows bodies that have appeared, by the points of all sensors.

    A cluster is a component of new cells, in which two cells that share a corner are
    connected. Points of a frame in these cells place a body. It counts as moving once
    several frames agree on a velocity.

    Args:
        cells: The map, after each frame.
        fastest: Greatest speed of a body [m/s].

    Raises:
        SceneError: SciPy is missing.
    """

    def __init__(self, cells: CellMap, fastest: float) -> None:
        try:
            import scipy.sparse.csgraph
            import scipy.spatial
        except ImportError:
            raise SceneError(
                "evasion of what sensors see needs SciPy: pip install "
                "'armguard[meshes]', or set `evade: false`"
            ) from None
        self._tree = scipy.spatial.cKDTree
        self._graph = scipy.sparse.coo_array
        self._components = scipy.sparse.csgraph.connected_components
        self._cells, self._fastest = cells, fastest
        self._tracks: list[Track] = []
        self._begun = 0

    def look(self, points: Floats, origin: Floats, sensor: int, taken: float) -> None:
        """Follow the bodies into a frame that the map has taken.

        Args:
            points: Its measured points, world, shape (n, 3) [m].
            origin: Place of the sensor, world, shape (3,) [m].
            sensor: Number of the sensor.
            taken: When they were measured [s].
        """
        self._tracks = [t for t in self._tracks if t.stamp > taken - CONFIRMED]
        places = self._new_cells(taken)
        if len(places) == 0:
            return
        labels = self._labels(places)
        of_points = self._labels_of(points, places, labels)
        parts = [
            part_of(points[of_points == label], origin, sensor, taken)
            for label in np.flatnonzero(np.bincount(of_points + 1)[1:] >= LEAST_POINTS)
        ]
        self._follow([part for part in parts if self._is_whole(part)])

    def found(self) -> Records[Cluster]:
        """Bodies that surely move, the fastest first, for `Guard.update_clusters`."""
        moving = [t for t in self._tracks if t.moves]
        moving.sort(key=lambda track: -np.linalg.norm(track.velocity.mean))
        out: Any = records(min(len(moving), MOST_CLUSTERS), Cluster)
        for row, track in zip(out, moving, strict=False):
            row["stamp"], row["number"] = track.stamp, track.number
            row["low"], row["high"] = track.box(track.stamp)
            row["velocity"], row["error"] = track.velocity
            row["radius"] = track.radius(track.stamp)
        found: Records[Cluster] = out
        return found

    def _new_cells(self, now: float) -> Longs:
        """Places of occupied cells that have appeared of late, shape (k, 3).

        Without those that own links may touch; none at all if they are too many.
        """
        cells = self._cells
        words = np.flatnonzero(cells.evidence.appeared > now - NEW)
        bits = cells.claims.occupied.words[words] & cells.evidence.moving[words]
        own, touched = cells.masked()
        if len(own) > 0 and len(words) > 0:
            at = np.minimum(np.searchsorted(own, words), len(own) - 1)
            bits &= ~np.where(own[at] == words, touched[at], np.uint64(0))
        each = bits[:, None] >> np.arange(MEMBERS, dtype=np.uint64) & np.uint64(1)
        of_word, bit = np.nonzero(each)
        if len(bit) > MOST_CELLS:
            return np.zeros((0, 3), dtype=np.int64)
        return places_of(words[of_word], bit, cells.size // BLOCK_SIDE)

    def _labels(self, places: Longs) -> Longs:
        """Number of the component of each cell, shape (k,)."""
        pairs = self._tree(places).query_pairs(1.5, p=inf, output_type="ndarray")
        edges = np.ones(len(pairs), dtype=np.bool_), pairs.T
        graph = self._graph(edges, shape=(len(places), len(places)))
        return np.asarray(self._components(graph, directed=False)[1], dtype=np.int64)

    def _labels_of(self, points: Floats, places: Longs, labels: Longs) -> Longs:
        """Component in whose cells each point is, -1 for none, shape (n,)."""
        cells = self._cells
        low = cells.centre - 0.5 * cells.size * cells.cell
        at = np.floor((points - low) / cells.cell).astype(np.int64)
        inside = ((at >= 0) & (at < cells.size)).all(axis=1)
        radix = np.array([1, cells.size, cells.size**2])
        keys, known = at @ radix, places @ radix
        order = np.argsort(known)
        spot = np.minimum(np.searchsorted(known[order], keys), len(known) - 1)
        chosen = order[spot]
        return np.where(inside & (known[chosen] == keys), labels[chosen], -1)

    def _is_whole(self, part: Part) -> bool:
        """Whether a part is wholly in the region: else its middle is not the body's."""
        cells = self._cells
        half = (0.5 * cells.size - 1.0) * cells.cell
        low, high = part.low - cells.centre, part.high - cells.centre
        return bool((low > -half).all() and (high < half).all())

    def _follow(self, parts: list[Part]) -> None:
        """Give each part to the nearest track that it overlaps, or begin a track."""
        chances = []
        for k, part in enumerate(parts):
            for t, track in enumerate(self._tracks):
                distance = self._apart(track, part)
                if distance < inf:
                    chances.append((distance, k, t))
        chances.sort()
        of_part: dict[int, int] = {}
        for _, k, t in chances:
            if k not in of_part and t not in of_part.values():
                of_part[k] = t
        for k, part in enumerate(parts):
            if k in of_part:
                self._tracks[of_part[k]].add(part, self._fastest)
            elif len(self._tracks) < MOST_TRACKS:
                self._begun += 1
                self._tracks.append(Track(self._begun))
                self._tracks[-1].add(part, self._fastest)

    def _apart(self, track: Track, part: Part) -> float:
        """Distance of the middles of a track and a part, infinite if apart [m]."""
        low, high = track.box(part.stamp)
        time = abs(part.stamp - track.stamp)
        # Another sensor sees another side.
        room = self._cells.cell + min(track.velocity.error, self._fastest) * time
        first, last = part.low - room, part.high + room
        first += np.minimum(part.behind, 0.0)
        last += np.maximum(part.behind, 0.0)
        if (low > last).any() or (first > high).any():
            return inf
        return float(np.linalg.norm(0.5 * (low + high - part.low - part.high)))


def part_of(points: Floats, origin: Floats, sensor: int, stamp: float) -> Part:
    """The points of one body as a part, see `Part`.

    Args:
        points: The points, shape (n, 3) [m].
        origin: Place of the sensor, shape (3,) [m].
        sensor: Number of the sensor.
        stamp: When they were measured [s].
    """
    middle, low, high = points.mean(axis=0), points.min(axis=0), points.max(axis=0)
    away = middle - origin
    away /= max(float(np.linalg.norm(away)), 1e-9)
    behind = float(np.median(high - low)) * away
    ends = points[(points @ AROUND.T).argmax(axis=0)]
    return Part(sensor, stamp, middle, low, high, ends, behind)


def velocity_of(parts: deque[Part], agree: float) -> Velocity:
    """Velocity of a body by the median of slopes (Theil and Sen).

    Slopes are between sightings of the same sensor: another one sees another side.

    Args:
        parts: Its sightings.
        agree: Greatest standard deviation of sightings that agree [m].
    """
    stamps = np.array([part.stamp for part in parts])
    span = float(np.ptp(stamps))
    if len(parts) < SIGHTINGS or span < SPAN:
        return UNKNOWN
    middles = np.array([part.middle for part in parts])
    sensors = np.array([part.sensor for part in parts])
    i, j = np.triu_indices(len(parts), 1)
    times = stamps[j] - stamps[i]
    usable: Bools = (sensors[i] == sensors[j]) & (np.abs(times) >= APART * span)
    if usable.sum() < SIGHTINGS - 1:
        return UNKNOWN
    i, j, times = i[usable], j[usable], times[usable]
    mean = np.median((middles[j] - middles[i]) / times[:, None], axis=0)
    left = middles - stamps[:, None] * mean
    for sensor in np.unique(sensors):
        own = sensors == sensor
        left[own] -= np.median(left[own], axis=0)
    spread = OF_MEDIAN * float(np.linalg.norm(np.median(np.abs(left), axis=0)))
    if spread > agree:
        return UNKNOWN
    # Standard deviation of a slope by evenly spaced samples.
    error = max(spread, LEAST_ERROR) * np.sqrt(12.0 / len(parts)) / span
    return Velocity(mean, float(SIGMAS * error))
