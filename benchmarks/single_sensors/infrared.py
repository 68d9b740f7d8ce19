"""An infrared sensor before bodies of given and of unknown materials."""

from math import log
from typing import Any

import numpy as np

from armguard.scene import Scene
from armguard.sense.infrared import Infrared

# Distances [m], angles of incidence [rad], and speed [m/s] and way [m] of an approach.
DISTANCES, ANGLE, SPEED, APPROACH = (0.03, 0.3), 0.5, 0.05, 0.04

# Distance at which an approach begins [m].
START = 0.15

AXIS = np.array([0.0, 0.0, 1.0])


def sensor(**settings: Any) -> Any:
    """An infrared sensor of the default figures."""
    scene = Scene(mode="fixed")
    return scene.add_sensor("eye", kind="infrared", **settings)[0]


def signal(
    finder: Infrared, distance: float, strength: float, rng: np.random.Generator
) -> float:
    """A signal with its noise [V]."""
    one = finder.sensor
    volts = one.gain * strength / (distance + one.offset) ** 2
    a, b, _ = one.noise
    return float(volts + (a + b * volts) * rng.standard_normal())


def given(trials: int, seed: int = 0) -> dict[str, Any]:
    """Error of the distance where the material is given."""
    rng, errors = np.random.default_rng(seed), []
    for _ in range(trials):
        material = np.exp(rng.uniform(log(0.04), log(0.88)))
        finder = Infrared(sensor(reflectance=(material, material), tilt=0.3))
        distance = rng.uniform(*DISTANCES)
        strength = material * np.cos(rng.uniform(0.0, 0.3))
        found = finder.distance(signal(finder, distance, strength, rng), material)
        errors.append(abs(found - distance) / distance)
    return {
        "trials": trials,
        "median": float(np.median(errors)),
        "worst_of_997": float(np.quantile(errors, 0.997)),
        "within_5": float(np.mean(np.array(errors) <= 0.05)),
    }


def unknown(trials: int, seed: int = 1) -> dict[str, Any]:
    """How often the near end is farther than the truth, by one signal."""
    rng, farther, worst = np.random.default_rng(seed), 0, -np.inf
    one = sensor()
    for _ in range(trials):
        finder = Infrared(one)
        strength = np.exp(rng.uniform(log(0.04), log(0.88)))
        strength *= np.cos(rng.uniform(0.0, ANGLE))
        distance = rng.uniform(*DISTANCES)
        volts = signal(finder, distance, strength, rng)
        seen = finder.take(volts, 0.0, np.zeros(3), AXIS)
        if seen.near == np.inf:
            continue
        # Standard deviation of a distance by that of the signal.
        exact = finder.signal(distance, strength)
        sigma = 0.5 * (distance + one.offset) * finder.noise(exact) / exact
        farther += seen.near - distance > 3.0 * sigma
        worst = max(worst, (seen.near - distance) / sigma)
    return {"trials": trials, "farther": int(farther), "worst_sigmas": float(worst)}


def approaches(count: int, seed: int = 2) -> dict[str, Any]:
    """Error of the distance after a known way towards bodies of unknown material."""
    rng, one = np.random.default_rng(seed), sensor()
    errors, farther, signals, dark = [], 0, 0, []
    for _ in range(count):
        finder = Infrared(one)
        material = np.exp(rng.uniform(log(0.04), log(0.88)))
        strength = material * np.cos(rng.uniform(0.0, ANGLE))
        steps = round(APPROACH / SPEED / one.period)
        seen = None
        for k in range(steps + 1):
            way = SPEED * one.period * k
            volts = signal(finder, START - way, strength, rng)
            at = way * AXIS
            seen = finder.take(volts, k * one.period, at, AXIS)
            exact = finder.signal(START - way, strength)
            sigma = 0.5 * (START - way + one.offset) * finder.noise(exact) / exact
            farther += seen.near - (START - way) > 3.0 * sigma
            signals += 1
        assert seen is not None
        middle = 0.5 * (seen.near + seen.far)
        errors.append(middle - (START - APPROACH))
        dark.append(material < 0.1)
    size, is_dark = np.abs(errors), np.array(dark)
    return {
        "approaches": count,
        "signals": signals,
        "farther": int(farther),
        "sigma3": float(np.quantile(size, 0.997)),
        "sigma3_bright": float(np.quantile(size[~is_dark], 0.997)),
        "fitted": float(np.mean(size < 0.02)),
    }
