"""Cells of joint positions and of the world, in which lower bounds of gaps are kept."""

import numpy as np
from numpy.typing import NDArray

from armguard.robot.kinematics import FIXED
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Cells along a joint where one or two lie between two links.
FINE = 128

# Cells along a joint where three lie between them, and along each axis of the world.
COARSE = 32

# Most joints between two links whose gap is kept in cells.
MOST_JOINTS = 3

# Most cells of all pairs [bytes].
MOST_CELLS = 1 << 25

# Part of a region's size by which it is made wider.
MARGIN = 0.05


def grid_of(lower: Floats, upper: Floats, cells: int) -> Floats:
    """Lower end of the first of some cells, and cells in a unit, along each axis.

    The first and the last cell lie beyond the bounds.

    Args:
        lower: Bounds, shape (n,).
        upper: Bounds, of that shape.
        cells: How many cells there are.

    Returns:
        Shape (n, 2).
    """
    width = np.maximum(upper - lower, 1e-3) / (cells - 2)
    return np.column_stack((lower - width, 1.0 / width))


def joint_grid(tables: SceneTables) -> Floats:
    """`Plan.grid`; a joint without limits has cells for one turn."""
    lower = np.where(np.isfinite(tables.lower), tables.lower, -np.pi)
    upper = np.where(np.isfinite(tables.upper), tables.upper, np.pi)
    return grid_of(lower, upper, FINE)


def region_of(points: Floats) -> Floats:
    """`Plan.region`: around points, shape (k, 3) [m]."""
    if not len(points):
        return grid_of(np.zeros(3), np.ones(3), COARSE)
    lower, upper = points.min(axis=0), points.max(axis=0)
    margin = MARGIN * (upper - lower).max()
    return grid_of(lower - margin, upper + margin, COARSE)


def ways_of(tables: SceneTables, pairs: Ints, bodies: Ints) -> tuple[Ints, int]:
    """`Plan.ways`, and how many cells there are in all.

    Args:
        tables: The scene.
        pairs: `Plan.pairs`.
        bodies: Body of each part, shape (t,).
    """
    ways = np.full((len(pairs), 2 + MOST_JOINTS), -1, dtype=np.int32)
    size = 0
    for k, (a, b, slot) in enumerate(pairs.tolist()):
        between = joints_between(tables, slot - 1, (int(bodies[a]), int(bodies[b])))
        count = (COARSE if len(between) == MOST_JOINTS else FINE) ** len(between)
        known = slot > 0 and 0 < len(between) <= MOST_JOINTS
        if known and size + count <= MOST_CELLS:
            ways[k, : 2 + len(between)] = size, len(between), *between
            size += count
    return ways, size


def joints_between(
    tables: SceneTables, carrier: int, ends: tuple[int, ...]
) -> list[int]:
    """Places in q of the joints behind a carrier of two bodies, up to these."""
    found = set()
    for body in ends:
        at = body
        while at not in (carrier, -1):
            if tables.joint_kind[at] != FIXED and tables.parent[at] >= 0:
                found.add(int(tables.q_index[at]))
            at = int(tables.parent[at])
    return sorted(found)
