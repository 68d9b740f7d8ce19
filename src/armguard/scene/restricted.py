"""Tables of a scene in which only some pairs are checked."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables

# What a primitive rides on: the world, or a robot by its number from 0.
WORLD = -1


def riders(tables: SceneTables) -> NDArray[np.intp]:
    """Number of the robot in the scene that carries each primitive, or WORLD."""
    found = np.full(len(tables.kinds), WORLD, dtype=np.intp)
    found[: tables.moving_count] = tables.robot_of_primitive
    return found


def restricted(
    tables: SceneTables,
    carriers: NDArray[np.intp],
    keeps: Callable[[int, int], bool],
    floor: float = 0.0,
) -> SceneTables:
    """The same tables, with fewer pairs that are checked.

    Args:
        tables: The scene.
        carriers: A number for each primitive, as of `riders`, shape (p,).
        keeps: Whether pairs of primitives of two such numbers stay checked; it is
            symmetric.
        floor: Least buffer of those pairs [m].
    """
    keys = np.column_stack((tables.groups, carriers))
    rows, groups = np.unique(keys, axis=0, return_inverse=True)
    old, carrier = rows.T
    kept = np.array([[keeps(int(a), int(b)) for b in carrier] for a in carrier])
    checked = tables.checked[np.ix_(old, old)] * kept
    return replace(
        tables,
        groups=groups.reshape(-1).astype(tables.groups.dtype),
        checked=np.ascontiguousarray(checked.astype(tables.checked.dtype)),
        buffers=np.maximum(tables.buffers[np.ix_(old, old)], floor),
    )
