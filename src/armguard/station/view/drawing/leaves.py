"""Leaves of the octree around the arms, as a tree of the same primitives has them.

Which leaves there are is a function of where things are, never of how they got there
(docs/architecture.md), so a tree that is told the poses of a frame has the same ones.
"""

from typing import Any

import numpy as np
import viser

from armguard.guard.objects import stand_at, take_out
from armguard.guard.world_at_home import build_index, place_all, world_at_home
from armguard.index import Octree
from armguard.scene.tables import SceneTables
from armguard.station.frames import Frame
from armguard.station.palette import BLUE
from armguard.station.view.drawing.frames import Floats
from armguard.station.view.placements import Placements

# Leaves that are drawn, the smallest first.
MOST = 160

# Time between two looks at the tree [s].
LOOK = 0.2

CORNERS = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)], dtype=bool)
EDGES = np.array([(a, b) for a in range(8) for b in range(a) if (a ^ b) in (1, 2, 4)])


class Leaves:
    """Edges of the leaves that a moving primitive's box meets.

    Attributes:
        shown: Whether they are drawn.

    Args:
        server: The page's scene.
        tables: The scene.
    """

    def __init__(self, server: viser.ViserServer, tables: SceneTables) -> None:
        self._server, self._tables = server, tables
        self._tree: Octree | None = None
        self._lines: Any | None = None
        self._placed = -1
        self._looked = -np.inf
        self.shown = False

    def draw(self, frame: Frame, placements: Placements, now: float) -> None:
        """Draw the leaves as they were in a cycle; nothing where none are wanted."""
        if not self.shown or self._tables.index.kind == "brute_force":
            if self._lines is not None and self._lines.visible:
                self._lines.visible = False
            return
        if now - self._looked < LOOK:
            return
        self._looked = now
        points = edges_of(self._cells(frame, placements))
        if self._lines is None:
            self._lines = self._server.scene.add_line_segments(
                "/leaves", points, BLUE, thickness=1.0, thickness_units="screen"
            )
        self._lines.points = points.astype(np.float32)
        self._lines.visible = True

    def _cells(self, frame: Frame, placements: Placements) -> Floats:
        """Corners of the leaves, lower and upper, shape (k, 6) [m]."""
        tables = self._tables
        if self._tree is None:
            world = world_at_home(tables, np.zeros((len(tables.parent), 12)))
            tree = build_index(tables, world)
            assert isinstance(tree, Octree)
            self._tree = tree
        tree = self._tree
        world = tree.world
        if placements.changes != self._placed:
            self._placed = placements.changes
            for name, T in placements.poses.items():
                thing = placements.standing(name, tables.standing[name])
                if T is None:
                    take_out(tree, thing)
                elif thing.body < 0:
                    stand_at(tree, thing, T)
        poses = np.ascontiguousarray(frame.poses)
        place_all(tables.kinds, tables.bodies, tables.local_rows, poses, world)
        moving = range(tables.moving_count)
        for i in moving:
            tree.update(i)
        cells = tree.cells(tree.leaves())
        boxes = world.boxes[: tables.moving_count]
        low, high = cells[:, None, :3], cells[:, None, 3:]
        beyond = np.maximum(boxes[None, :, :3] - high, low - boxes[None, :, 3:])
        near = cells[(beyond.max(axis=2) <= 0.0).any(axis=1)]
        return np.asarray(near[np.argsort(near[:, 3] - near[:, 0])][:MOST])


def edges_of(cells: Floats) -> Floats:
    """Both ends of all edges of boxes, shape (12 k, 2, 3) [m]."""
    corners = np.where(CORNERS, cells[:, None, 3:], cells[:, None, :3])
    return np.asarray(corners[:, EDGES].reshape(-1, 2, 3))
