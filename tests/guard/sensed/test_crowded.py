"""Cells that crowd one arm do not slow another one."""

import numpy as np
import pytest

from armguard.geometry import Pose
from armguard.guard import Level
from armguard.respond import Guard
from armguard.scene import Scene
from sensed import PERIOD, changes, feed

CELL, SIZE = 0.025, 128
CENTRE = np.array([0.0, 0.0, 1.0])
LOW = CENTRE - 0.5 * SIZE * CELL

# Two places beside the hand of the first arm at home, one on each side of it and in one
# group of 16³ cells [m].
BESIDE = ((0.235, -0.6, 0.56), (0.385, -0.6, 0.56))

# Space from here on is about the second arm [m]. Every eighth cell of it is unknown, so
# that its words are no boxes.
OTHER_SIDE = 0.3


@pytest.fixture(scope="module")
def guard():
    """Two Pandas side by side."""
    scene = Scene(period=PERIOD, late=PERIOD)
    for name, y in (("one", -0.6), ("other", 0.6)):
        scene.add_robot("panda", name, base=Pose(xyz=(0, y, 0)))
    scene.set_sensing(
        region={"centre": CENTRE.tolist(), "size": SIZE}, cell=CELL, unknown="still",
        intruder={"speed": 1.6, "size": 0.05},
    )  # fmt: skip
    return Guard(scene, self_test=False)


def levels(guard, unknown, stamp):
    """Levels of both arms at rest at home."""
    feed(guard, changes(np.zeros_like(unknown), unknown, stamp), stamp)
    guard.reset()
    still = np.zeros(len(guard.home))
    guard.step(guard.home, stamp, velocity=still)
    return guard.step(guard.home, stamp + PERIOD, velocity=still).levels


def test_an_arm_in_unknown_space_does_not_coarsen_that_about_another_one(guard):
    unknown = np.zeros((SIZE,) * 3, dtype=np.bool_)
    for place in BESIDE:
        unknown[tuple(((place - LOW) / CELL).astype(int))] = True
    assert max(levels(guard, unknown, 1.0).values()) < Level.SLOW
    unknown[::2, int((OTHER_SIDE - LOW[1]) / CELL) :: 2, ::2] = True
    found = levels(guard, unknown, 2.0)
    assert found["one"] < Level.SLOW
    assert found["other"] >= Level.STOP
