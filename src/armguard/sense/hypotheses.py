"""Frames that fit another place or time of the sensor, and not the declared one."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.sense.frames import Frame
from armguard.sense.health import Fault
from armguard.sense.prediction import Mount, Prediction
from armguard.sense.view import View

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Votes from which on a hypothesis is accepted, and how many are kept at most: what was
# accepted is soon refuted.
ACCEPTED, MOST = 30.0, 100.0

# Votes against a hypothesis of each zone that it does not explain.
REFUTES = 3.0

# Change of a prediction after which a zone votes again, in parts of its slack [-].
ANEW = 0.5

# Zones that the declared place has to leave unexplained before others are looked at.
FEW = 2

# By how many frames distances may be late.
LAGS = 4

# Share of the range up to which a surface is surely seen [-].
SEEN = 0.8

# Images of a grid of zones: quarter turns, whether the columns are reversed then, and
# whether the image of an oblong grid has the size of the grid.
IMAGES = {
    "columns reversed": (0, True, True),
    "rows reversed": (2, True, True),
    "turned by 180 degrees": (2, False, True),
    "turned by 90 degrees": (1, False, False),
    "turned by -90 degrees": (3, False, False),
    "rows and columns exchanged": (3, True, False),
    "rows and columns exchanged and reversed": (1, True, False),
}


class Accepted(NamedTuple):
    """A hypothesis that is accepted.

    Attributes:
        fault: The fault that it is.
        detail: Its size, or which.
    """

    fault: Fault
    detail: str


class Known(NamedTuple):
    """What a hypothesis says about a frame, arrays of shape (..., z).

    Attributes:
        fits: Zones whose distance it explains.
        counts: Zones of which it says something: its surface is not too near.
    """

    fits: Bools
    counts: Bools


class Hypotheses:
    """A sequential test of other places and times of a sensor against the declared one.

    A zone votes for a hypothesis if that explains its distance and the declared place
    does not, and against it if it differs from the declared place and does not explain
    the distance. Votes are summed up and do not fall below zero, as in Page's CUSUM
    test. Hypotheses are the images of the grid of zones, the predictions of the last
    frames, and those of other sensors of the same kind.

    A zone votes again only after a prediction of it has changed: at rest a wrong model
    and an unknown body are the same in every frame. For the place of another sensor
    the first vote does not count: an unknown body may have the distance that is
    predicted there.

    An image has the same depths as the grid in other zones, so some zones are too near
    and as many too far. So are distances that are late, where surfaces come and go. An
    unknown body is too near, and what is less than its model too far. So votes of both
    are summed up on their own, and both sums have to be large.

    Args:
        view: The sensor.
        others: Names of the other sensors of its kind.
    """

    def __init__(self, view: View, others: Sequence[str]) -> None:
        self._view, sensor = view, view.sensor
        self._shape = tuple(len(np.unique(part)) for part in view.places)
        square = sensor.zones[0] == sensor.zones[1]
        self._images = [n for n, (_, _, fits) in IMAGES.items() if fits or square]
        count = len(self._images)
        self._late = slice(count, count + LAGS)
        self._elsewhere = slice(count + LAGS, None)
        self._others = others
        self._past: deque[tuple[float, Floats]] = deque(maxlen=LAGS + 1)
        # Where a hypothesis is nearer than the declared place, and where it is farther.
        self._votes = np.zeros((2, count + LAGS + len(others)))
        # Least depths of the hypotheses and of the declared place when each zone has
        # voted last: for a hypothesis, and against it.
        shape = 2, 2, self._votes.shape[1], len(view.places[0])
        self._last = np.full(shape, -np.inf)
        self._last[0, :, self._elsewhere] = np.nan

    def test(
        self, frame: Frame, mount: Mount, prediction: Prediction,
        others: Sequence[Prediction | None], now: float,
    ) -> Accepted | None:  # fmt: skip
        """Count the votes of a frame; the hypothesis that is accepted.

        Args:
            frame: The frame.
            mount: Where the sensor was.
            prediction: What it has to measure.
            others: What the other sensors had to measure last; None for none.
            now: The time of it [s].
        """
        own, depth = prediction.zones, self._view.predicted(frame.depth)
        nothing = self._view.predicted(frame.nothing)
        slack = self._view.slack(np.nan_to_num(depth))
        slack = slack + mount.shift + mount.turn * np.nan_to_num(depth)
        here = self._known(own, depth, nothing, slack)
        counts = here.counts & (nothing | ~np.isnan(depth))
        if np.count_nonzero(counts & ~here.fits) < FEW:
            self._votes = np.maximum(self._votes - REFUTES, 0.0)
            self._past.appendleft((now, own))
            return None
        zones = self._predicted(own, others, now)
        there = self._known(zones, depth, nothing, slack)
        counts = counts & there.counts
        # A zone that sees nothing is no evidence of a place: many see nothing.
        agree = counts & there.fits & ~here.fits & ~nothing
        with np.errstate(invalid="ignore"):
            differ = (np.abs(zones - own)[..., :2] > slack[:, None]).any(axis=2)
        refuted = counts & differ & ~there.fits
        near = np.stack([zones[..., 0], np.broadcast_to(own[:, 0], agree.shape)])
        votes, against = self._anew(np.stack([agree, refuted]), near, slack)
        sides = 2.0 * (votes & np.stack([near[0] < near[1], near[0] >= near[1]]))
        # In another place a sensor may see nothing but what is nearer, or farther.
        sides[:, self._elsewhere] = votes[self._elsewhere]
        change = (sides - REFUTES * against).sum(axis=2)
        self._votes = np.clip(self._votes + change, 0.0, MOST)
        self._past.appendleft((now, own))
        # A fault lasts as long as frames are evidence of it.
        total = np.where(agree.any(axis=1), self._votes.min(axis=0), 0.0)
        best = int(total.argmax())
        return self._accepted(best, now) if total[best] >= ACCEPTED else None

    def _predicted(
        self, own: Floats, others: Sequence[Prediction | None], now: float
    ) -> Floats:
        """Predictions of all hypotheses; the declared one of those that say nothing."""
        grid = own.reshape(*self._shape, 4)
        images = [
            np.rot90(grid, IMAGES[n][0])[:, :: -1 if IMAGES[n][1] else 1]
            for n in self._images
        ]
        sensor = self._view.sensor
        late = [
            zones if now - taken > 2.0 * sensor.jitter else own
            for taken, zones in list(self._past)[:LAGS]
        ]
        late += [own] * (LAGS - len(late))
        elsewhere = [own if one is None else one.zones for one in others]
        images = [one.reshape(own.shape) for one in images]
        return np.stack([*images, *late, *elsewhere])

    def _known(
        self, zones: Floats, depth: Floats, nothing: Bools, slack: Floats
    ) -> Known:
        """Compare predictions with depths that may be off by their slack [m]."""
        least, greatest = self._view.sensor.range
        near, far, overreach = zones[..., 0], zones[..., 1], zones[..., 3]
        within = (near - slack <= depth) & (depth <= far + overreach + slack)
        fits = np.where(nothing, far > SEEN * greatest, within)
        return Known(fits, near >= least)

    def _anew(self, voting: Bools, near: Floats, slack: Floats) -> Bools:
        """Zones that vote with another prediction than last time.

        Args:
            voting: Those that vote for a hypothesis, and against it, shape (2, h, z).
            near: Least depths of the hypotheses and of the declared place, (2, h, z).
            slack: How far off distances may be, shape (z,) [m].
        """
        with np.errstate(invalid="ignore"):
            anew = (np.abs(near - self._last) > ANEW * slack).any(axis=1)
        noted = voting & (anew | np.isnan(self._last[:, 0]))
        self._last = np.where(noted[:, None], near, self._last)
        return np.asarray(voting & anew)

    def _accepted(self, best: int, now: float) -> Accepted:
        """A hypothesis by its number, at the time of the last frame [s]."""
        count = self._late.start
        if best < count:
            return Accepted(Fault.MOVED, self._images[best])
        if best < self._late.stop:
            # The past has begun with the present frame.
            taken = self._past[best - count + 1][0]
            return Accepted(Fault.DELAYED, f"{1e3 * (now - taken):.0f} ms")
        other = self._others[best - self._late.stop]
        return Accepted(Fault.MOVED, f"its distances are those of {other}")
