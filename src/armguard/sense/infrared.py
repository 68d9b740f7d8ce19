"""Distances of an infrared sensor: its signal depends on the material it meets.

The signal is V = k ρ cos θ / (d + δ)²: k is the gain of the sensor, δ the depth of its
optical centre, ρ the reflectance of what it meets, θ the angle of incidence. As it
moves along its axis, 1/√V is linear in the way, and ρ cos θ cancels out.
"""

from collections import deque
from math import cos, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.scene.sensors import SceneSensor
from armguard.sense.view import SIGMAS

Floats = NDArray[np.float64]

# Signals by which a way is fitted: how many at most, since when [s], the least count
# and the least way along the axis [m].
MOST, AGE, LEAST, WAY = 400, 5.0, 12, 0.02

# Of a way that counts: the greatest turn [rad], and the greatest way across the axis,
# as a share of the way along it and beside that [m].
TURN, ACROSS, BESIDE = 0.02, 0.2, 0.001

# A fit holds if its mean square residual is below that of noise by so many standard
# deviations of it.
DOUBT = 3.0

# A signal that changes by more than this factor between two frames is of another body.
JUMP = 1.3


class Seen(NamedTuple):
    """What a signal says of the distance along the axis.

    Attributes:
        near: Least distance [m].
        far: Greatest distance, infinite if nothing is surely there [m].
        surely: Distance up to which no body of any material is [m].
        fitted: Whether they are by the way of the sensor or by a learned reflectance.
    """

    near: float
    far: float
    surely: float
    fitted: bool


class Sample(NamedTuple):
    """A signal and where it was measured.

    Attributes:
        taken: When [s].
        origin: Place of the sensor, shape (3,) [m].
        axis: Its axis, shape (3,).
        volts: The signal [V].
    """

    taken: float
    origin: Floats
    axis: Floats
    volts: float


class Fitted(NamedTuple):
    """A fit of the signals along a way.

    Attributes:
        distance: Distance at the newest signal [m].
        sigma: Its standard deviation [m].
        strength: ρ cos θ of the body [-].
        spread: Its standard deviation [-].
    """

    distance: float
    sigma: float
    strength: float
    spread: float


class Infrared:
    """Signals of an infrared sensor as distances.

    Attributes:
        learned: ρ cos θ of the body before the sensor and its standard deviation; None
            before a fit.

    Args:
        sensor: The sensor.
    """

    def __init__(self, sensor: SceneSensor) -> None:
        self.sensor = sensor
        self._samples: deque[Sample] = deque(maxlen=MOST)
        self.learned: tuple[float, float] | None = None

    @property
    def floor(self) -> float:
        """Signal below which nothing is surely there [V]."""
        return SIGMAS * self.sensor.noise[0]

    def noise(self, volts: float) -> float:
        """Standard deviation of a signal [V]."""
        a, b, c = self.sensor.noise
        return a + b * volts + c * volts * volts

    def distance(self, volts: float, strength: float) -> float:
        """Distance of a body of a strength ρ cos θ by its signal [m]."""
        if volts <= 0.0:
            return inf
        way = sqrt(self.sensor.gain * strength / volts) - self.sensor.offset
        return max(way, 0.0)

    def signal(self, distance: float, strength: float) -> float:
        """Signal of a body at a distance [V]."""
        way = max(distance, 0.0) + self.sensor.offset
        return self.sensor.gain * strength / (way * way)

    def take(self, volts: float, taken: float, origin: Floats, axis: Floats) -> Seen:
        """Take a signal.

        Args:
            volts: The signal [V].
            taken: When it was measured [s].
            origin: Place of the sensor, world, shape (3,) [m].
            axis: Its axis, a unit vector, shape (3,).
        """
        sensor, high = self.sensor, volts + SIGMAS * self.noise(max(volts, 0.0))
        dark, bright = sensor.reflectance
        oblique = cos(sensor.tilt)
        # Less than the whole cone may be filled.
        surely = self.distance(max(high, self.floor), sensor.fill * dark * oblique)
        if volts < self.floor:
            self._forget()
            return Seen(inf, inf, surely, False)
        low = max(volts - SIGMAS * self.noise(volts), 1e-12)
        near, far = self.distance(high, dark * oblique), self.distance(low, bright)
        last = self._samples[-1].volts if self._samples else volts
        if not 1.0 / JUMP < volts / last < JUMP:
            self._forget()
        self._samples.append(Sample(taken, origin, axis, volts))
        fit = self._fit(taken)
        if fit is not None and self._is_possible(fit):
            self.learned = fit.strength, fit.spread
            least = fit.distance - SIGMAS * fit.sigma
            most = fit.distance + SIGMAS * fit.sigma
        elif self.learned is not None:
            strength, spread = self.learned
            least = self.distance(high, max(strength - SIGMAS * spread, 0.0))
            most = self.distance(low, strength + SIGMAS * spread)
        else:
            return Seen(near, far, min(surely, near), False)
        near, far = min(max(least, near), far), max(min(most, far), near)
        return Seen(near, far, min(surely, near), True)

    def _forget(self) -> None:
        """Forget the body: the signal is of another one."""
        self._samples.clear()
        self.learned = None

    def _is_possible(self, fit: Fitted) -> bool:
        """Whether a body that does not move can have such a reflectance."""
        dark, bright = self.sensor.reflectance
        slack = SIGMAS * fit.spread
        low = dark * cos(self.sensor.tilt)
        return low - slack <= fit.strength <= bright + slack

    def _fit(self, now: float) -> Fitted | None:
        """Fit 1/√V over the way along the axis; None if it does not hold."""
        while self._samples and now - self._samples[0].taken > AGE:
            self._samples.popleft()
        newest = self._samples[-1]
        origins = np.array([one.origin for one in self._samples]) - newest.origin
        axes = np.array([one.axis for one in self._samples])
        along = origins @ newest.axis
        across = np.linalg.norm(origins - along[:, None] * newest.axis, axis=1)
        good = (axes @ newest.axis > cos(TURN)) & (
            across <= ACROSS * np.abs(along) + BESIDE
        )
        volts = np.array([one.volts for one in self._samples])[good]
        along = along[good]
        if len(along) < LEAST or np.ptp(along) < WAY:
            return None
        noise = np.array([self.noise(v) for v in volts])
        y, sigma = volts**-0.5, 0.5 * volts**-1.5 * noise
        A = np.stack([np.ones(len(along)), -along], axis=1) / sigma[:, None]
        covariance = np.linalg.inv(A.T @ A)
        alpha, beta = covariance @ (A.T @ (y / sigma))
        left = y / sigma - A @ (alpha, beta)
        free = len(along) - 2
        doubt = 1.0 + DOUBT * sqrt(2.0 / free)
        if beta <= 0.0 or float(left @ left) / free > doubt:
            return None
        slope = np.array([1.0 / beta, -alpha / beta**2])
        spread = sqrt(float(slope @ covariance @ slope))
        strength = 1.0 / (self.sensor.gain * beta**2)
        return Fitted(
            alpha / beta - self.sensor.offset, spread, strength,
            2.0 * strength * sqrt(covariance[1, 1]) / beta,
        )  # fmt: skip
