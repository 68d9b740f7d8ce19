"""Health of a sensor: tests of its frames, each fault with its time and its words."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.errors import WithSentence
from armguard.scene.sensors import SceneSensor
from armguard.sense.frames import Frame, Intake, Points
from armguard.sense.prediction import Mount, Prediction
from armguard.sense.view import View

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Bools = NDArray[np.bool_]

# A fault is over after this time without a sign of it [s]: of faults that motion shows,
# and of others, which each frame shows.
HEALS, HEALS_SOON = 1.0, 0.5

# Faults that are over and kept.
PAST = 64

# Periods without a frame after which a sensor is silent [-].
SILENT_PERIODS = 2.0

# Frames in a row with too few valid distances, and the share that is too small [-].
BLIND_FRAMES, LEAST_VALID = 3, 0.5

# Distances that a frame and the one before have to share to be a repetition; those of a
# frame that count at most, and repeated ones of frames in a row that are a fault.
LEAST_REPEATED, MOST_REPEATED, REPEATED = 2, 8, 16

# Frames in a row in which a zone has the same distance to the bit though another one is
# predicted; and zones that have it in so many frames though the sensor moves.
STUCK_FRAMES, STUCK_ZONES = 5, 3

# A window of frames in which zones see the same near distance while the sensor moves:
# its length [s], the distances [m], the way of the sensor [m] and its turn [-].
DIRTY_TIME, DIRTY_NEAR, DIRTY_WAY, DIRTY_TURN = 0.6, 0.3, 0.08, 0.2
DIRTY_ZONES, DIRTY_FRAMES = 3, 6

# Points of what they see past which other zones look, and their share, so it is no body
# at rest; and the share of the near zones that stay the same, so it is no moving one.
PAST_POINTS, PAST_SHARE, SAME_SHARE = 6, 0.5, 0.75


class Fault(WithSentence):
    """A fault of a sensor.

    Attributes:
        sentence: The meaning in words.
    """

    SILENT = 0, "it sends no frames; check it and its cable"
    LATE = 1, "its frames come later than declared; check its delay"
    STAMP_BACK = 2, "its stamps go back, or stay; check its clock"
    STAMP_AHEAD = 3, "its stamps are in the future; check its clock"
    UNUSABLE = 4, "its frames cannot be used; check its driver"
    REPEATED = 5, "it repeats its distances to the bit; start it again"
    BLIND = 6, "most of its distances are invalid; clean it, or shade it"
    STUCK = 7, "zones keep their distance though another one is predicted"
    DIRTY = 8, "zones see the same near distance wherever it is; clean it"
    MOVED = 9, "it is mounted elsewhere than the scene says"
    DELAYED = 10, "its distances are older than its stamps say; check its delay"


# Faults that only show while a sensor, or what it sees, moves.
BY_MOTION = frozenset((Fault.STUCK, Fault.DIRTY, Fault.MOVED, Fault.DELAYED))

# Of these, those in which a sensor may have looked past a body. A dirty zone sees too
# near a distance, and frees no space beyond it.
MISLEADING = BY_MOTION - {Fault.DIRTY}

# Intakes that are signs of a fault.
SIGNS = {
    Intake.WRONG_KIND: Fault.UNUSABLE,
    Intake.WRONG_TYPE: Fault.UNUSABLE,
    Intake.WRONG_SIZE: Fault.UNUSABLE,
    Intake.NO_STAMP: Fault.UNUSABLE,
    Intake.STAMP_BACK: Fault.STAMP_BACK,
    Intake.STAMP_AHEAD: Fault.STAMP_AHEAD,
}


@dataclass(slots=True)
class FoundFault:
    """A fault that was found.

    Attributes:
        fault: The fault.
        since: When it was found first [s].
        seen: When a sign of it was seen last [s].
        detail: Further words, such as numbers of zones.
    """

    fault: Fault
    since: float
    seen: float
    detail: str = ""

    def __str__(self) -> str:
        """Name, sentence and detail."""
        more = f" ({self.detail})" if self.detail else ""
        return f"{self.fault.name}: {self.fault.sentence}{more}"


@dataclass(slots=True)
class SensorHealth:
    """Health of a sensor.

    Attributes:
        sensor: The sensor.
        faults: Its present faults.
        past: The last faults that are over.
        intakes: How many of its frames became what.
        stamp: Stamp of its last usable frame, minus infinity without any [s].
        silent: Whether frames are missing; the fault lasts longer.
    """

    sensor: SceneSensor
    faults: dict[Fault, FoundFault] = field(default_factory=dict)
    past: deque[FoundFault] = field(default_factory=lambda: deque(maxlen=PAST))
    intakes: Counter[Intake] = field(default_factory=Counter)
    stamp: float = -np.inf
    silent: bool = False

    def __str__(self) -> str:
        """Its state in words."""
        if self.stamp == -np.inf and not self.faults:
            return "no frame yet"
        return "; ".join(map(str, self.faults.values())) or "in order"

    @property
    def trusted(self) -> bool:
        """Whether its frames free space: none of its faults concerns distances."""
        return not set(self.faults) - {Fault.LATE, Fault.SILENT}

    @property
    def misled(self) -> bool:
        """Whether frames may have freed space wrongly before a fault was found.

        Frames of other faults free nothing. These are found in motion alone.
        """
        return not MISLEADING.isdisjoint(self.faults)

    def sign(self, fault: Fault, now: float, detail: str = "") -> None:
        """A sign of a fault.

        Args:
            fault: The fault.
            now: The time [s].
            detail: Further words.
        """
        found = self.faults.setdefault(fault, FoundFault(fault, now, now))
        found.seen, found.detail = now, detail

    def heal(self, now: float) -> None:
        """End the faults without a sign for some time."""
        for fault, found in list(self.faults.items()):
            if now - found.seen > (HEALS if fault in BY_MOTION else HEALS_SOON):
                self.past.append(self.faults.pop(fault))

    def listen(self, now: float, start: float) -> None:
        """Whether the sensor is silent.

        Args:
            now: The time [s].
            start: Since when frames are expected [s].
        """
        sensor = self.sensor
        wait = SILENT_PERIODS * sensor.period + sensor.delay + sensor.jitter
        self.silent = now - max(self.stamp, start) > wait
        if self.silent:
            self.sign(Fault.SILENT, now)
        self.heal(now)


class Near(NamedTuple):
    """Near foreign distances of a frame.

    Attributes:
        taken: When they were measured [s].
        depth: The distance of each predicted zone; infinite where it is another one,
            NaN where there is none, shape (z,) [m].
        zones: Zones with a near one.
        mount: Where the sensor was.
    """

    taken: float
    depth: Floats
    zones: int
    mount: Mount


class FrameTests:
    """Tests of the frames of a sensor, beside each other and beside the prediction.

    Args:
        view: The sensor.
        health: Receives what is found.
    """

    def __init__(self, view: View, health: SensorHealth) -> None:
        self._view, self._health = view, health
        self._cone = view.predicted(view.cone)
        self._last, self._repeated, self._blind = np.zeros(0), 0, 0
        zones = len(view.places[0])
        self._values, self._run = np.full(zones, np.nan), np.zeros(zones, np.int64)
        self._least, self._most = np.full(zones, np.inf), np.full(zones, -np.inf)
        self._from = np.zeros((zones, 3))
        self._window: deque[Near] = deque()

    def repeats(self, values: Floats, now: float) -> bool:
        """Whether a frame has the values of the one before; soon that is a fault."""
        count = int(np.count_nonzero(np.isfinite(values)))
        same = (
            values.shape == self._last.shape
            # Of most frames the first row already differs.
            and values[:1].tobytes() == self._last[:1].tobytes()
            and np.array_equal(values.view(np.int64), self._last.view(np.int64))
            and count >= LEAST_REPEATED
        )
        self._last = values
        self._repeated = self._repeated + min(count, MOST_REPEATED) if same else 0
        if self._repeated >= REPEATED:
            self._health.sign(Fault.REPEATED, now)
        return bool(same)

    def test(
        self, frame: Frame, hits: Singles, mount: Mount, prediction: Prediction,
        now: float,
    ) -> None:  # fmt: skip
        """Test a frame.

        Args:
            frame: The frame.
            hits: Depths of it that nothing explains, NaN elsewhere [m].
            mount: Where the sensor was.
            prediction: What it has to measure.
            now: The time of it [s].
        """
        depth = self._view.predicted(frame.depth)
        self._test_blind(self._valid(frame, depth, prediction), now)
        if frame.impossible.any():
            self._health.sign(Fault.UNUSABLE, now, "values that cannot be")
        if self._view.sensor.narrow:
            # Its one distance is the least within the cone, and has no zones.
            return
        self._test_stuck(depth, prediction, mount, now)
        foreign = np.isfinite(self._view.predicted(hits))
        reading = np.where(self._view.predicted(frame.nothing), np.inf, depth)
        self._test_dirty(reading, foreign, mount, now)

    def test_points(self, found: Points, now: float) -> None:
        """Test points: without any the sensor is blind.

        Args:
            found: The points.
            now: The time of them [s].
        """
        self._test_blind(1.0 if len(found.xyz) else 0.0, now)

    def _valid(self, frame: Frame, depth: Floats, prediction: Prediction) -> float:
        """Share of the zones that see a known surface and are valid; of all else."""
        least, greatest = self._view.sensor.range
        near, far = prediction.near, prediction.far
        sees = self._cone & (near > least) & (far < 0.8 * greatest)
        if (count := np.count_nonzero(sees)) >= max(4, 0.05 * len(depth)):
            return np.count_nonzero(sees & ~np.isnan(depth)) / count
        if self._view.sensor.image:
            return 1.0
        says = (~np.isnan(frame.depth) | frame.nothing) & self._view.cone
        return np.count_nonzero(says) / np.count_nonzero(self._view.cone)

    def _test_blind(self, valid: float, now: float) -> None:
        self._blind = 0 if valid >= LEAST_VALID else self._blind + 1
        if self._blind >= BLIND_FRAMES:
            self._health.sign(Fault.BLIND, now, f"{valid:.0%} valid")

    def _test_stuck(
        self, depth: Floats, prediction: Prediction, mount: Mount, now: float
    ) -> None:
        same = depth == self._values
        self._values = depth
        if not same.any():
            self._run[:], self._least[:], self._most[:] = 0, np.inf, -np.inf
            return
        known = same & (prediction.far < np.inf)
        self._least = np.where(known, np.minimum(self._least, prediction.near), np.inf)
        self._most = np.where(known, np.maximum(self._most, prediction.near), -np.inf)
        self._from[self._run == 0] = mount.origin
        self._run = np.where(same, self._run + 1, 0)
        stays = self._run >= STUCK_FRAMES
        enough = 2.0 * self._view.slack(np.nan_to_num(depth))
        stuck = stays & known
        stuck[stuck] = (self._most - self._least)[stuck] > enough[stuck]
        # Distances of images may have coarse steps.
        way = np.linalg.norm(mount.origin - self._from, axis=1)
        carried = stays & (way > enough) & (not self._view.sensor.image)
        if np.count_nonzero(carried) >= STUCK_ZONES:
            stuck |= carried
        if stuck.any():
            self._health.sign(Fault.STUCK, now, zones_in_words(stuck))

    def _test_dirty(
        self, depth: Floats, foreign: Bools, mount: Mount, now: float
    ) -> None:
        nearer = foreign & (depth < DIRTY_NEAR)
        seen = np.where(nearer | np.isnan(depth), depth, np.inf)
        self._window.append(Near(now, seen, int(np.count_nonzero(nearer)), mount))
        while now - self._window[0].taken > DIRTY_TIME:
            self._window.popleft()
        # Each zone that is dirty is near in most frames.
        least = DIRTY_ZONES * LEAST_VALID * len(self._window)
        few = sum(one.zones for one in self._window) <= least
        if few or len(self._window) < DIRTY_FRAMES:
            return
        slack = self._view.slack(np.nan_to_num(depth))
        all_seen = np.array([one.depth for one in self._window])
        valid = np.isfinite(all_seen).mean(axis=0) > LEAST_VALID
        low, high = np.fmin.reduce(all_seen), np.fmax.reduce(all_seen)
        dirty = valid & (high < DIRTY_NEAR) & (high < low + slack)
        near = np.isfinite(all_seen).any(axis=0)
        same = dirty.sum() >= SAME_SHARE * near.sum()
        if not (same and self._looks_past(dirty, depth, mount)):
            first = self._window[0].mount
            way = float(np.linalg.norm(mount.origin - first.origin))
            turn = float(np.linalg.norm(mount.R - first.R))
            if way < DIRTY_WAY and turn < DIRTY_TURN:
                return
            # A body beside which a sensor moves keeps its distance as well.
            origins = np.array([one.mount.origin for one in self._window])
            dirty &= np.ptp(origins @ mount.R[:, 2]) > 2.0 * slack
        if dirty.sum() >= DIRTY_ZONES:
            self._health.sign(Fault.DIRTY, now, zones_in_words(dirty))

    def _looks_past(self, dirty: Bools, depth: Floats, mount: Mount) -> bool:
        """Whether other zones look past most of what dirty ones saw before.

        Args:
            dirty: The dirty zones, shape (z,).
            depth: Depths, infinite where there is nothing, shape (z,) [m].
            mount: Where the sensor is.
        """
        zones = np.flatnonzero(dirty)
        if self._view.sensor.image or len(zones) < DIRTY_ZONES:
            return False
        points = np.concatenate(
            [
                self._view.points(zones, one.depth[zones]) @ one.mount.R.T
                + one.mount.origin
                for one in self._window
            ]
        )
        there = (points[np.isfinite(points[:, 2])] - mount.origin) @ mount.R
        zone = self._view.zones_at(there)
        there, zone = there[zone >= 0], zone[zone >= 0]
        seen = depth[zone]
        looks = ~dirty[zone] & ~np.isnan(seen)
        past = looks & (seen > there[:, 2] + 2.0 * self._view.slack(there[:, 2]))
        count = np.count_nonzero(past)
        return bool(count >= max(PAST_POINTS, PAST_SHARE * np.count_nonzero(looks)))


def zones_in_words(chosen: Bools) -> str:
    """Numbers of zones, the first ones."""
    numbers = np.flatnonzero(chosen)
    more = f" and {len(numbers) - 4} more" if len(numbers) > 4 else ""
    return f"zones {', '.join(map(str, numbers[:4]))}{more}"
