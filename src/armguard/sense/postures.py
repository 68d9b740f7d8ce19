"""Postures that determine the pose of a sensor, on paths that the guard allows."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.guard.monitor import Monitor
from armguard.scene.scene import Scene
from armguard.sense.calibration import (
    EXPECTED,
    POSTURES,
    TILTED,
    rays_of,
    sensors_of,
)
from armguard.sense.surfaces import Surfaces, expected
from armguard.sense.view import SIGMAS, View

Floats = NDArray[np.float64]

# Random postures that are compared, and of these the paths that are tried for each.
CANDIDATES, TRIES = 240, 60

# Joints of unlimited travel turn by so much about home, and others keep so much of
# their travel from its ends [-].
TURN, MARGIN = 1.5, 0.15

# Part of the way from home to a random posture.
SHARES = (0.4, 1.0)


def calibration_postures(
    scene: Scene, entry: str, count: int = POSTURES, seed: int = 0
) -> Floats:
    """Postures that determine the pose of a sensor, in an order that is allowed.

    Each is the one that adds most to what is known of the pose, among random ones that
    the guard lets the arms reach on a straight line of joint positions.

    Args:
        scene: The scene.
        entry: Name of a sensor or of a ring of sensors.
        count: How many.
        seed: Seed of the random postures.

    Returns:
        The postures, from home on, shape (1 + count, n) [rad or m].

    Raises:
        SceneError: There is no such sensor, or the arms reach fewer postures.
    """
    knows = information(scene, entry)
    guard = Monitor(scene)
    candidates = random_postures(scene, entry, np.random.default_rng(seed))
    gains = [knows(q) for q in candidates]
    left = [k for k, gain in enumerate(gains) if gain.any()]
    path, total = [scene.home], np.diag(EXPECTED[:6] ** -2.0)
    while len(path) <= count:
        scores = [np.linalg.slogdet(total + gains[k])[1] for k in left]
        best = [left[k] for k in np.argsort(scores)[::-1][:TRIES]]
        allowed = (k for k in best if is_allowed(guard, path[-1], candidates[k]))
        k = next(allowed, None)
        if k is None:
            raise SceneError(
                f"the guard allows the way to {len(path) - 1} of {count} postures for "
                f"'{entry}'; give the arms more room at home, or another home"
            )
        path.append(candidates[k])
        total = total + gains[k]
        left.remove(k)
    return np.array(path)


def is_allowed(guard: Monitor, start: Floats, end: Floats) -> bool:
    """Whether the model allows a straight line of joint positions.

    The calibration plans before a sensor has seen anything.
    """
    return bool(guard.check_path([start, end], sensed=False).clear)


def random_postures(scene: Scene, entry: str, rng: np.random.Generator) -> Floats:
    """Random postures of the arm that carries a sensor, or of all arms.

    Returns:
        Shape (CANDIDATES, n) [rad or m].
    """
    sensor = next(iter(sensors_of(scene, entry).values()))
    tables = Surfaces(scene).tables
    low = np.maximum(tables.lower, scene.home - TURN)
    high = np.minimum(tables.upper, scene.home + TURN)
    room = MARGIN * (high - low)
    moves = np.ones(len(scene.home), dtype=np.bool_)
    if sensor.on is not None:
        carrier = sensor.on.split("/", 1)[0] + "/"
        moves = np.array([name.startswith(carrier) for name in scene.q_names])
    found = rng.uniform(low + room, high - room, (CANDIDATES, len(low)))
    share = rng.uniform(*SHARES, (CANDIDATES, 1))
    return np.where(moves, scene.home + share * (found - scene.home), scene.home)


def information(scene: Scene, entry: str) -> Callable[[Floats], Floats]:
    """What the frames of a sensor at a posture say of its pose.

    Returns:
        Of joint positions the matrix of information, shape (6, 6).
    """
    surfaces, sensors = Surfaces(scene), sensors_of(scene, entry)
    views = [View(one, 0.05) for one in sensors.values()]
    fans = [rays_of(view) if view.sensor.form != "points" else cone() for view in views]

    def knows(q: Floats) -> Floats:
        total = np.zeros((6, 6))
        for view, rays in zip(views, fans, strict=True):
            now = expected(surfaces, view.sensor, rays, q, np.zeros(6))
            least, greatest = view.sensor.range
            good = now.whole & (now.way > least) & (now.way < 0.8 * greatest)
            noise = (view.slack(now.way[good]) - view.sensor.error) / SIGMAS
            sigma = np.hypot(noise, TILTED * now.spread[good])
            rows = now.rows[good] / sigma[:, None]
            total += rows.T @ rows
        return total

    return knows


def cone() -> Floats:
    """Rays within 45° about the axis of a sensor that gives points, (n, 1, 3)."""
    slope = np.linspace(-0.8, 0.8, 12)
    x, y = (part.ravel() for part in np.meshgrid(slope, slope))
    ways = np.stack([x, y, np.ones(len(x))], axis=1)
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))[:, None]
