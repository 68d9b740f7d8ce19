"""Prediction whether a finger, moving on with its hand, hits or passes an object.

A grasp target gets between the fingers. A finger that hits it head on, however slowly,
touches it where it cannot hold it: that is no grasp.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, scaled
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.grips import Grips
from armguard.guard.near_pairs import boxes_apart
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel

Floats = NDArray[np.float64]

# Distance below which a moving finger counts as hitting an object [m].
GRAZE = 1e-3

# Steps along a path; a finger that has not passed by then counts as hitting it [-].
STEPS = 24


@kernel(inline=False)
def runs_into(f: int, o: int, way: Vec3, length: float, h: Grips, w: Workspace) -> bool:
    """Whether a finger in straight motion hits an object.

    Args:
        f: The finger.
        o: The object.
        way: Direction of motion of its hand, unit vector.
        length: Length of the motion [m].
        h: Grips.
        w: Workspace.
    """
    T = array_at(stack(12), (12,), np.float64)
    row = array_at(stack(16), (ROW_WIDTH,), np.float64)
    for k in range(12):
        T[k] = 0.0
    T[0] = T[5] = T[10] = 1.0
    for i in range(h.fingers[f].first, h.fingers[f].end):
        for j in range(h.objects[o].first, h.objects[o].end):
            if boxes_apart(w.world.boxes, i, j, length):
                continue
            if meets(i, j, way, length, T, row, w):
                return True
    return False


@kernel
def meets(
    i: int, j: int, way: Vec3, length: float, T: Floats, row: Floats, w: Workspace
) -> bool:
    """Whether a primitive in straight motion hits another one.

    Each step is as long as the present distance, which is safe; steps become short only
    where the primitives meet.

    Args:
        i: The primitive.
        j: The other one.
        way: Direction of motion, unit vector.
        length: Length of the motion [m].
        T: A frame that is not rotated, shape (12,); its origin is overwritten.
        row: Scratch, shape (16,).
        w: Workspace.
    """
    kinds, rows = w.world.kinds, w.world.rows
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    gone, steps = 0.0, 0
    while gone < length and steps < STEPS:
        x, y, z = scaled(gone, way)
        T[3], T[7], T[11] = x, y, z
        place_row(kinds[i], rows[i], T, row)
        measure(kinds[i], row, kinds[j], rows[j], witness)
        if not witness[0] > GRAZE:
            return True
        gone += witness[0]
        steps += 1
    return gone < length
