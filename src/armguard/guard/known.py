"""How far from a link space is known free."""

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.clearance import clearances
from armguard.errors import CellMapError, UnknownNameError, did_you_mean
from armguard.guard.sensed import CellKind, Sensed
from armguard.index.world import World
from armguard.scene.sensing import SENSED, UNSEEN
from armguard.scene.tables import SceneTables
from armguard.table import Ledger

Floats = NDArray[np.float64]

# Way up to which cells are searched, and gap at which they are reached [m].
FARTHEST, REACHED = 5.0, 1e-3


@dataclass(frozen=True, slots=True)
class KnownFree:
    """Way of a link through space that is known free.

    Attributes:
        distance: Length of the way, at most 5 m [m].
        ends_at: What is at its end: `SENSED` or `UNSEEN`; None if nothing is.
        stamp: Time at which this held: that of the map [s].
    """

    distance: float
    ends_at: str | None
    stamp: float


def known_free(
    link: str, direction: ArrayLike, tables: SceneTables, world: World, sensed: Sensed
) -> KnownFree:
    """How far a link can be moved along a direction before it meets a cell.

    A shape is moved by its distance to the nearest cell again and again, so it meets
    nothing on its way.

    Args:
        link: 'robot/link'.
        direction: Direction in the world, shape (3,), not 0.
        tables: The scene.
        world: Its primitives in the world.
        sensed: The cells.

    Raises:
        UnknownNameError: The link has no primitives, or does not exist.
        CellMapError: The direction is none.
    """
    names = np.array(list(tables.body_names)[: tables.moving_count])
    own = np.flatnonzero(names == link)
    if len(own) == 0:
        raise UnknownNameError(
            f"no moving link is named '{link}'; {did_you_mean(link, names.tolist())}"
        )
    way = np.array(direction, dtype=np.float64)
    length = float(np.linalg.norm(way)) if way.shape == (3,) else 0.0
    if not 0.0 < length < inf:
        raise CellMapError(f"direction is {direction!r}; give three numbers, not all 0")
    way /= length
    kinds = kinds_of(sensed)
    found = KnownFree(FARTHEST, None, float(sensed.about.stamp))
    for i in own.tolist():
        kind, row = int(tables.kinds[i]), world.rows[i]
        for cells, ledger in kinds.items():
            free = free_way(kind, row, way, found.distance, ledger)
            if free < found.distance:
                name = SENSED if cells <= CellKind.MOVING else UNSEEN
                found = KnownFree(free, name, found.stamp)
        edge = way_inside(world.boxes[i], way, sensed)
        if sensed.about.outside >= 0 and edge < found.distance:
            found = KnownFree(edge, UNSEEN, found.stamp)
    return found


def kinds_of(sensed: Sensed) -> dict[CellKind, Ledger]:
    """Ledgers of claims whose occupied cells are those of a kind."""
    sets = (sensed.still, sensed.moving, sensed.unseen, sensed.growing)
    return {
        kind: Ledger(sensed.claims._replace(occupied=cells))
        for kind, cells in zip(CellKind, sets, strict=True)
    }


def free_way(kind: int, row: Floats, way: Floats, most: float, cells: Ledger) -> float:
    """Way of a primitive along a unit vector until it reaches a cell [m].

    Args:
        kind: ShapeKind.
        row: Its row in the world, shape (16,).
        way: The unit vector.
        most: Greatest way that matters [m].
        cells: Ledger of the claims whose occupied cells count.
    """
    pose = np.zeros((1, 12))
    pose[0, [0, 5, 10]] = 1.0
    nearest, out = np.full(1, -1, dtype=np.int32), np.zeros((1, 5))
    gone = 0.0
    while gone < most:
        pose[0, [3, 7, 11]] = gone * way
        clearances(kind, row, pose, most - gone, False, cells.lines, nearest, out)
        if not out[0, 0] > REACHED:
            return gone
        gone += min(float(out[0, 0]), most - gone)
    return most


def way_inside(box: Floats, way: Floats, sensed: Sensed) -> float:
    """Way of a bounding box along a unit vector until it leaves the region [m]."""
    lattice = sensed.claims.lattice
    low = np.asarray(lattice.low)
    high = low + lattice.side * lattice.cell
    room = np.where(way > 0.0, high - box[3:], box[:3] - low)
    with np.errstate(divide="ignore", invalid="ignore"):
        ways = np.where(way != 0.0, room / np.abs(way), inf)
    return float(max(ways.min(), 0.0))
