"""Cells of links and modelled objects: neither foreign, nor freed by sensors."""

import numpy as np
from numpy.typing import NDArray

from armguard.cells.cell_map import CellMap
from armguard.cells.state import Words
from armguard.geometry.shapes.kind import ShapeKind
from armguard.sense.prediction import Mount
from armguard.sense.view import View
from armguard.sense.world import Placed, World
from armguard.table import IntVector

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Kept = tuple[IntVector, Words]

HALF_SPACE, BOX = int(ShapeKind.HALF_SPACE), int(ShapeKind.BOX)

# Time between two masks of all links, by which cells in them are passed [s].
EVERY = 0.1


class Masks:
    """Masks of the links and objects of a scene in its map.

    Args:
        world: The scene.
        cells: The map.
    """

    def __init__(self, world: World, cells: CellMap) -> None:
        self._world, self._cells = world, cells
        self._kept: dict[str, Kept] = {}
        self._whole = -np.inf

    def forget(self, name: str | None = None) -> None:
        """Mask static objects again: one of them, or a sensor, has another place.

        Args:
            name: The sensor; None for all.
        """
        for one in [name] if name is not None else list(self._kept):
            self._kept.pop(one, None)

    def pass_links(self, placed: Placed, stamp: float) -> None:
        """Pass the cells in all links, if that was not done for some time."""
        if stamp < self._whole + EVERY:
            return
        self._whole = stamp
        self._pass(placed, stamp, 0.0)

    def pass_about_links(self, placed: Placed, stamp: float, clear: float) -> None:
        """Pass the cells within a distance of all links [m]: nothing is there."""
        self._pass(placed, stamp, clear)

    def _pass(self, placed: Placed, stamp: float, clear: float) -> None:
        own, none = self._world.own, np.zeros(len(placed.rows))
        kinds, rows, slacks = self._rows(own, placed, none)
        slacks += (-clear, clear)
        self._cells.mask_near(kinds, rows, slacks, None)
        self._cells.points(np.zeros((0, 3)), np.zeros(3), stamp)

    def set(
        self, view: View, mount: Mount, placed: Placed, *, all_links: bool = False
    ) -> None:
        """Mask what a frame may not hit, nor free.

        Args:
            view: The sensor.
            mount: Where it is.
            placed: The primitives.
            all_links: Whether to mask links that it does not see, too.
        """
        tables, sensor = self._world.tables, view.sensor
        aside = (placed.balls[:, :3] - mount.origin) @ mount.R
        away = np.linalg.norm(aside, axis=1)
        depth = np.minimum(away + placed.balls[:, 3], sensor.range[1])
        # The hits of zones are explained one by one, whatever their depth.
        single = sensor.form == "zones" or sensor.narrow
        slack = np.full(len(depth), sensor.error) if single else view.slack(depth)
        slack += mount.shift + mount.turn * depth
        if sensor.name not in self._kept:
            self._keep(sensor.name, sensor.on is not None, placed, slack)
        kept, cell = self._kept[sensor.name], self._cells.cell
        moving = np.arange(len(depth)) < tables.moving_count
        if all_links:
            # Not only cells that a frame touches are withdrawn.
            self._cells.mask_near(*self._rows(moving, placed, slack), kept)
            return
        reach = view.reach if single else sensor.range[1]
        seen = away - placed.balls[:, 3] - slack <= reach
        beside = view.beside(aside, placed.balls[:, 3] + slack + placed.shifts + cell)
        rows = self._rows(moving & seen, placed, slack, beside)
        self._cells.mask_near(*rows, kept, mount.origin, view.span + 2.0 * cell)

    def _keep(self, name: str, moves: bool, placed: Placed, slack: Floats) -> None:
        """Mask the static objects once for a sensor.

        Args:
            name: Its name.
            moves: Whether it moves: then the greatest slack is taken for all.
            placed: The primitives.
            slack: How far each may seem to reach, shape (p,) [m].
        """
        first = self._world.tables.moving_count
        static = placed.balls[:, 3] >= 0.0
        static[:first] = False
        if moves and static.any():
            slack = np.full(len(slack), slack[first:].max())
        self._cells.mask_near(*self._rows(static, placed, slack), None)
        self._kept[name] = self._cells.masked()

    def _rows(
        self, chosen: Bools, placed: Placed, slack: Floats, beside: Bools | None = None
    ) -> tuple[IntVector, Floats, Floats]:
        """Kinds, rows and slacks of masks, see `CellMap.mask_near`.

        Args:
            chosen: Which primitives, shape (p,).
            placed: All of them.
            slack: How far each may seem to reach, shape (p,) [m].
            beside: Links that are beside the view: only their inside matters.
        """
        world, own = self._world, self._world.own
        slacks = np.empty((len(own), 2))
        slacks[:, 0] = np.where(own, placed.shifts + world.model_errors, np.inf)
        slacks[:, 1] = placed.shifts + slack
        if beside is not None:
            only = beside & own
            slacks[only, 1] = -slacks[only, 0]
        kinds, rows = world.kinds[chosen], placed.rows[chosen]
        for k in np.flatnonzero(kinds == HALF_SPACE):
            kinds[k], rows[k] = BOX, self._slab(rows[k])
        return kinds, rows, slacks[chosen]

    def _slab(self, row: Floats) -> Floats:
        """A box in place of a half-space, of which the map has no more."""
        normal, cells = row[4:7], self._cells
        edge = 2.0 * cells.size * cells.cell
        # The surface below the middle of the map.
        height = (cells.centre - row[1:4]) @ normal - row[0]
        middle = cells.centre - (height + 0.5 * edge) * normal
        side = np.eye(3)[np.abs(normal).argmin()]
        u = np.cross(normal, side)
        u /= np.linalg.norm(u)
        box = np.zeros(16)
        box[1:4], box[4:7] = middle, 0.5 * edge
        box[7:16] = np.stack([u, np.cross(normal, u), normal], axis=1).reshape(9)
        return box
