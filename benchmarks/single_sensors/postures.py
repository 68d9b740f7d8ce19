"""Pose and delay of a sensor that is mounted elsewhere, from postures of the bay."""

from typing import Any

import numpy as np

from armguard.sense.alignment import rotation
from armguard.sense.calibration import calibrated, sensors_of
from armguard.sense.postures import calibration_postures
from armguard.simulation.sensed import events_of, sensed_bay, through
from armguard.simulation.sensors import Rig

# How far the sensor is from its declared place [m], turned [rad] and late [s], and the
# share of distances of zones that are invalid [-].
WAY, TURN, LATE, INVALID = 0.03, np.radians(5.0), 0.02, 0.15


def calibration(entry: str, seed: int) -> dict[str, Any]:
    """What is left of the errors after a calibration.

    Args:
        entry: Name of a sensor, or of a ring of sensors.
        seed: Seed of the errors, of the noise and of the postures.
    """
    scene, rng = sensed_bay(), np.random.default_rng(seed)
    rig = Rig(scene, seed=seed)
    rig.invalid = INVALID
    way, turn = rng.normal(size=(2, 3))
    X = np.eye(4)
    X[:3, :3] = rotation(TURN * turn / np.linalg.norm(turn))
    X[:3, 3] = WAY * way / np.linalg.norm(way)
    sensors = sensors_of(scene, entry)
    first = next(iter(sensors.values()))
    truth = first.mount.matrix() @ X
    for name, one in sensors.items():
        inner = np.linalg.inv(one.mount.matrix()) @ one.pose.matrix()
        rig.truth[name] = truth @ inner
    course = through(calibration_postures(scene, entry, seed=seed))
    events = events_of(rig, scene, course, entry, LATE, seed)
    found = calibrated(scene, entry, events)
    left = np.linalg.inv(found.pose.matrix()) @ truth
    cosine = 0.5 * (np.trace(left[:3, :3]) - 1.0)
    late = None if found.delay is None else found.delay - first.delay - LATE
    return {
        "sensor": entry, "seed": seed, "seconds": course.seconds,
        "way": float(np.linalg.norm(left[:3, 3])),
        "turn": float(np.arccos(min(cosine, 1.0))), "late": late,
        "sigma": found.sigma.tolist(), "used": found.used,
    }  # fmt: skip
