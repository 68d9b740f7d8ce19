"""How far a sensor is from its declared place, by its distances to known surfaces."""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.sense.frames import Frame
from armguard.sense.prediction import Mount, Prediction
from armguard.sense.ranging import linearise
from armguard.sense.view import SIGMAS, View
from armguard.sense.world import Placed

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]

# Points farther than this from what is predicted are of something else [m].
CAPTURE = 0.12

# Frames of a fit, points of each at most, least points of a fit, and time between two
# fits [s].
FRAMES, POINTS, LEAST, EVERY = 10, 64, 120, 0.2

# Steps of a fit at most, and the change that ends it [m or rad]. Of the points a share
# is left out, those with the largest residuals.
STEPS, CONVERGED, LEFT_OUT = 16, 1e-4, 0.1

# What is expected before any measurement: offset [m] and turn [rad].
EXPECTED_SHIFT, EXPECTED_TURN = 0.05, 0.1

# A fit shows an offset if it is beyond the declared error, by this many of its standard
# deviations, and leaves less than this share of the mean square residual.
CERTAINTY, LEFT = 5.0, 0.7


class Offset(NamedTuple):
    """Offset of a sensor from its declared place.

    Attributes:
        shift: Offset of its origin, in its declared frame, shape (3,) [m].
        turn: Rotation about the axes of that frame, shape (3,) [rad].
        certain: Whether it is beyond the declared error and beyond doubt.
    """

    shift: Floats
    turn: Floats
    certain: bool

    def __str__(self) -> str:
        """Its size in millimetres and degrees."""
        way = float(np.linalg.norm(self.shift)) * 1e3
        angle = np.degrees(float(np.linalg.norm(self.turn)))
        return f"{way:.0f} mm and {angle:.1f} degrees off"


class Look(NamedTuple):
    """Points of a frame on known surfaces, and where these are.

    Attributes:
        points: The points in the sensor, shape (n, 3) [m].
        weight: One over the variance of each, shape (n,) [1/m²].
        mount: Where the sensor was.
        placed: The primitives.
    """

    points: Floats
    weight: Floats
    mount: Mount
    placed: Placed


class Alignment:
    """Fits the place of a sensor to its last frames.

    Attributes:
        offset: The last fit; None before the first one.

    Args:
        view: The sensor.
        kinds: ShapeKind of each primitive, shape (p,).
        model_errors: How far the real surface of each may be inside, shape (p,) [m].
    """

    def __init__(self, view: View, kinds: Ints, model_errors: Floats) -> None:
        self._view, self._kinds, self._errors = view, kinds, model_errors
        self._looks: deque[Look] = deque(maxlen=FRAMES)
        self._due = -np.inf
        self.offset: Offset | None = None

    def add(
        self, frame: Frame, mount: Mount, placed: Placed, prediction: Prediction,
        now: float,
    ) -> bool:  # fmt: skip
        """Add a frame, and fit if it is time; whether a fit was made.

        Args:
            frame: The frame.
            mount: Where the sensor was.
            placed: The primitives.
            prediction: What it has to measure.
            now: The time [s].
        """
        depth = self._view.predicted(frame.depth)
        near, far = (
            np.where(prediction.primitive >= 0, part, 0.0)
            for part in (prediction.near, prediction.far)
        )
        known = (near > 0.0) & (far - near < CAPTURE) & self._view.predicted(frame.firm)
        # What encloses a surface with more room than that shows no offset.
        known &= prediction.overreach <= self._view.sensor.error
        chosen = np.flatnonzero(known & (np.abs(depth - near) < CAPTURE))
        chosen = chosen[:: max(len(chosen) // POINTS, 1)]
        if len(chosen):
            spread = (
                self._view.slack(depth[chosen]) - self._view.sensor.error
            ) / SIGMAS
            model = (
                self._errors[prediction.primitive[chosen]]
                + placed.shifts[prediction.primitive[chosen]]
            )
            points = self._view.points(chosen, depth[chosen])
            # The surface may be oblique, and its distance that of any part of a zone.
            tilt = 0.5 * (far - near)[chosen]
            weight = 1.0 / (spread**2 + model**2 + mount.shift**2 + tilt**2)
            self._looks.append(Look(points, weight, mount, placed))
        count = sum(len(look.points) for look in self._looks)
        if now < self._due or len(self._looks) < FRAMES or count < LEAST:
            return False
        self._due = now + EVERY
        self.offset = self._fit()
        return True

    def _fit(self) -> Offset:
        """The offset by weighted least squares, the worst points left out."""
        R, shift = np.eye(3), np.zeros(3)
        prior = np.array([EXPECTED_SHIFT] * 3 + [EXPECTED_TURN] * 3) ** -2.0
        before, change = np.nan, np.full(6, np.inf)
        weights = np.concatenate([look.weight for look in self._looks])
        kept = int((1.0 - LEFT_OUT) * (len(weights) - 1))
        out = np.full((len(weights), 8), -1.0)
        for step in range(STEPS + 1):
            self._linearised(R, shift, out)
            residual, rows = out[:, 0], out[:, 1:7]
            size = np.abs(residual) * np.sqrt(weights)
            worst = np.partition(size, kept)[kept]
            weight = np.where(size <= worst, weights, 0.0)
            cost = float((weight * residual**2).sum())
            before = cost if step == 0 else before
            if step == STEPS or np.abs(change).max() < CONVERGED:
                break
            total = np.concatenate([shift, rotation_vector(R)])
            H = (rows * weight[:, None]).T @ rows + np.diag(prior)
            change = np.linalg.solve(H, -rows.T @ (weight * residual) - prior * total)
            shift = shift + change[:3]
            R = rotation(change[3:]) @ R
        found = np.concatenate([shift, rotation_vector(R)])
        # Neighbouring zones have common errors, so the covariance is no smaller than
        # that of a tenth of the points.
        sigma = np.sqrt(10.0 * np.diag(np.linalg.inv(H)))
        away = np.linalg.norm(self._displaced(R, shift), axis=1).mean()
        doubt = CERTAINTY * sigma
        beyond = away > 1.5 * self._view.sensor.error
        sure = bool(beyond and (np.abs(found) > doubt).any() and cost < LEFT * before)
        return Offset(shift, found[3:], sure)

    def _displaced(self, R: Floats, shift: Floats) -> Floats:
        """Ways of all points by the offset, shape (n, 3) [m]."""
        points = np.concatenate([look.points for look in self._looks])
        return np.asarray(points @ R.T + shift - points)

    def _linearised(self, R: Floats, shift: Floats, out: Floats) -> None:
        """Residuals of all points, and their derivatives, see `linearise`."""
        # A frame has some tens of points, so one call for each is little.
        first, offset = 0, np.vstack([R, shift])
        for look in self._looks:
            last = first + len(look.points)
            linearise(
                look.points, offset, look.mount.R, look.mount.origin,
                self._kinds, look.placed.rows, look.placed.balls, out[first:last],
            )  # fmt: skip
            first = last


def rotation(vector: Floats) -> Floats:
    """Rotation about an axis by the length of a vector, shape (3, 3)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)


def rotation_vector(R: Floats) -> Floats:
    """Axis of a small rotation times its angle, shape (3,) [rad]."""
    skew = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.linalg.norm(skew))
    return skew if sine == 0.0 else np.asarray(skew * np.arcsin(min(sine, 1.0)) / sine)
