"""Scenes and states of which the same is asked in several ways."""

from collections.abc import Callable

import numpy as np

import armguard as ag
from armguard.scene import Scene
from arrays import Floats

ROBOTS = ("left", "right")

# Pairs up to this far apart are reported [m].
MARGIN = 0.12

# Halvings between a clear state and one that is too near: from some 1 mm to rounding.
HALVINGS = (12, 28)

# Boards of the shelf: heights of their middles [m].
BOARDS = (0.15, 0.4, 0.65)


def bay() -> Scene:
    """Both arms of the bay, whose pairs have three buffers."""
    scene = ag.bay_scene()
    scene.set_margin(MARGIN)
    scene.set_buffer("left", "right", 0.05)
    for arm in ROBOTS:
        scene.set_buffer(f"{arm}/link7", "rack", 0.01)
    return scene


def opposite(name: str, half: float, buffer: float) -> Scene:
    """Two arms face to face at a table with a post and a shelf.

    Args:
        name: Name of the robots.
        half: Half the distance of their bases [m].
        buffer: Distance that most pairs have to keep [m].
    """
    scene = Scene(mode="fixed", buffer=buffer, margin=MARGIN)
    turned = ag.Pose(xyz=(half, 0, 0), rpy=(0, 0, np.pi))
    scene.add_robot(name, "left", base=ag.Pose(xyz=(-half, 0, 0)))
    scene.add_robot(name, "right", base=turned)
    table, post = (3.0 * half, 2.0 * half, 0.04), (0.06, 0.06, 0.4)
    scene.add(ag.Box(size=table), "table", pose=ag.Pose(xyz=(0, 0, -0.15)))
    scene.add(ag.Box(size=post), "post", pose=ag.Pose(xyz=(0, half, 0.2)))
    board = ag.Box(size=(0.6 * half, 0.3 * half, 0.02))
    for k, height in enumerate(BOARDS):
        at = ag.Pose(xyz=(0, -0.9 * half, 2.0 * half * height))
        scene.add(board, f"board{k}", pose=at)
    scene.set_buffer("left", "right", 0.03)
    scene.set_buffer("left", "post", 0.002)
    return scene


# Scenes by name, each with the middle of the cube of its region octrees [m].
SCENES: dict[str, tuple[Callable[[], Scene], tuple[float, float, float]]] = {
    "bay": (bay, (0.0, 0.0, 1.3)),
    "two Pandas": (lambda: opposite("panda", 0.55, 0.02), (0.0, 0.0, 0.5)),
    "two SO-101": (lambda: opposite("so101", 0.42, 0.005), (0.0, 0.0, 0.2)),
}


def random_states(checker: ag.Checker, count: int, rng: np.random.Generator) -> Floats:
    """States of which half are anywhere, and half where a pair is at its buffer.

    The latter are between a clear state and one that is too near, halved several times.

    Args:
        checker: A checker of the scene.
        count: How many.
        rng: Source of the random numbers.

    Returns:
        Joint positions, shape (count, n) [rad or m].
    """
    half, joints = count // 2, len(checker.lower)
    size = (count - half, joints)
    anywhere = rng.uniform(checker.lower, checker.upper, size)
    clear, near = (some_states(checker, half, rng, one) for one in (True, False))
    halvings = rng.integers(*HALVINGS, half)
    for k in range(HALVINGS[1]):
        middle = 0.5 * (clear + near)
        keeps, left = checker.clear(middle), k < halvings
        clear = np.where((left & keeps)[:, None], middle, clear)
        near = np.where((left & ~keeps)[:, None], middle, near)
    side = rng.random(half) < 0.5
    border = np.where(side[:, None], clear, near)
    return np.concatenate((anywhere, border))


def some_states(
    checker: ag.Checker, count: int, rng: np.random.Generator, clear: bool
) -> Floats:
    """Random states, all of them clear or all too near, shape (count, n)."""
    found = np.empty((0, len(checker.lower)))
    while len(found) < count:
        rows = rng.uniform(checker.lower, checker.upper, (4 * count, found.shape[1]))
        found = np.concatenate((found, rows[checker.clear(rows) == clear]))
    return found[:count]
