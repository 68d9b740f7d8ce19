"""An arm among sensed cells, and the same cells as boxes of the scene."""

import numpy as np

from armguard.cells.deltas import Delta
from armguard.cells.grid import packed
from armguard.geometry import Box, Pose
from armguard.record import records
from armguard.respond import Guard
from armguard.scene import Scene

PERIOD = 0.004

# A small region around a Panda: 64 cells an edge.
CENTRE, CELL, SIZE = (0.0, 0.0, 0.5), 0.05, 64
LOW = np.array(CENTRE) - 0.5 * SIZE * CELL


def sensed_scene(
    unknown="free", speed=1.6, cell=CELL, size=SIZE, margin=None, **settings
):
    """A Panda and sensed space."""
    scene = Scene(period=PERIOD, late=PERIOD, margin=margin)
    scene.add_robot("panda", "arm")
    if unknown == "free":
        settings.setdefault("reason", "a test")
    scene.set_sensing(
        region={"centre": CENTRE, "size": size},
        cell=cell,
        unknown=unknown,
        intruder={"speed": speed, "size": 0.05},
        **settings,
    )
    return scene


def sensed_guard(*args, budget=1024, **settings):
    """A guard of such a scene, without its self-test."""
    return Guard(sensed_scene(*args, **settings), self_test=False, budget=budget)


def boxed_guard(count, top_speed=0.0, **sensing):
    """A guard of the arm and of boxes as large as a cell, none of them placed.

    It has sensed space of the same buffers, which stays empty.
    """
    scene = sensed_scene(**sensing)
    for k in range(count):
        scene.add(Box(size=(CELL,) * 3), f"cell{k}", present=False, top_speed=top_speed)
    return Guard(scene, self_test=False, budget=1 << 20)


def grid(size=SIZE):
    """No cells."""
    return np.zeros((size,) * 3, dtype=np.bool_)


def changes(occupied, unknown, stamp, error=0.0, motion=0):
    """All words of a map as changes; arguments may differ from word to word."""
    words = packed(occupied)
    # Packing takes milliseconds, and most worlds are known.
    hidden = packed(unknown) if unknown.any() else np.zeros_like(words)
    found = records(len(words), Delta)
    found["bits"][:, 0], found["bits"][:, 1] = words, hidden
    found["word"] = np.arange(len(words))
    found["stamp"], found["error"], found["motion"] = stamp, error, motion
    return found


def feed(guard, found, stamp):
    """Take over changes in as many calls as they need."""
    for k in range(0, len(found), 4096):
        guard.update_cells(found[k : k + 4096], stamp)


def middle(cell, edge=CELL):
    """Middle of a cell [m]."""
    return LOW + edge * (np.asarray(cell) + 0.5)


def at(cell):
    """Pose of a box as large as a cell."""
    return Pose(xyz=middle(cell).tolist())
