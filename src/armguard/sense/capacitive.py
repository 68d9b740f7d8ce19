"""Capacitive pads: something within a ball, at no known place.

The signal is C₀ + k Σ wᵢ h(dᵢ), the sum over rays of the half space before the pad,
with h(d) = (a / (a + d))², a the radius of the pad, and weights wᵢ of the cosine to its
axis. Conductors on the ground have the full signal, insulators less: so a signal gives
the greatest distance at which something can be, and no point.
"""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.scene.sensors import SceneSensor
from armguard.sense.prediction import Mount, Prediction
from armguard.sense.view import View

Floats = NDArray[np.float64]

# Standard deviations of the noise that no signal exceeds in hours.
SURE = 6.0

# Share of the signal of known bodies by which the sum over few rays may be off [-].
COARSE = 0.03


class Capacitive:
    """Signals of a capacitive pad beside those of known bodies.

    Attributes:
        radius: Radius of the ball in which something is, 0 if nothing is noticed [m].

    Args:
        view: The pad.
    """

    def __init__(self, view: View) -> None:
        self._view, self.sensor = view, view.sensor
        self.radius = 0.0
        self._own, self._taken = inf, -inf
        ways = view.ways[:, 0]
        cone = view.cone[view.places]
        # Rays of a plane before the pad are denser to its sides.
        weight = np.where(cone, ways[:, 2] ** 4, 0.0)
        self._weight = weight / weight.sum()

    def known(self, mount: Mount, prediction: Prediction, error: float) -> Floats:
        """Signal of links and modelled objects, and how far off it may be, shape (2,).

        Args:
            mount: Where the pad is.
            prediction: Depths that its rays have to meet.
            error: How far known bodies may be from where they are expected [m].
        """
        ways = self._view.ways[:, 0]
        way = prediction.near / ways[:, 2]
        off = error + prediction.overreach + mount.shift + mount.turn * 0.2
        here = float(self._weight @ response(self.sensor, way))
        nearer = float(self._weight @ response(self.sensor, np.maximum(way - off, 0.0)))
        farther = float(self._weight @ response(self.sensor, way + off))
        return np.array([here, max(nearer - here, here - farther) + COARSE * here])

    def take(self, signal: float, taken: float, known: Floats) -> float:
        """Take a signal; radius of the ball in which something unknown is, or 0 [m].

        Args:
            signal: The signal, in units of the gain.
            taken: When it was measured [s].
            known: Result of `known`.
        """
        sensor = self.sensor
        excess = signal - sensor.gain * known[0]
        slack = SURE * sensor.noise[0] + sensor.gain * known[1]
        # Foreign bodies only add to the signal, so its own part is at most the least
        # that is left, and rises no faster than it may drift.
        drifted = self._own + sensor.drift * sensor.gain * (taken - self._taken)
        self._own = (
            min(drifted, excess + slack) if self._taken > -inf else excess + slack
        )
        self._taken = taken
        foreign = excess - slack - self._own
        self.radius = reach_of(sensor, foreign) if foreign > 0.0 else 0.0
        return self.radius


def response(sensor: SceneSensor, way: Floats) -> Floats:
    """Signal of what fills the whole half space at a distance, in units of the gain."""
    return np.asarray((sensor.offset / (sensor.offset + way)) ** 2)


def reach_of(sensor: SceneSensor, signal: float) -> float:
    """Greatest distance of a body that gives at least a signal, up to the range [m]."""
    if signal >= sensor.gain:
        return sensor.range[0]
    way = sensor.offset * (sqrt(sensor.gain / signal) - 1.0)
    return min(max(way, sensor.range[0]), sensor.range[1])
