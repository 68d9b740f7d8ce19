"""What the view computes itself: the rest after a stop, and the octree's leaves."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.objects import stand_at, take_out
from armguard.guard.world_at_home import build_index, place_all, world_at_home
from armguard.index import Octree
from armguard.recording.frames import Frame
from armguard.recording.palette import BLUE
from armguard.robot.stopping.distance import brake_way
from armguard.scene.poses import body_poses
from armguard.scene.tables import SceneTables
from armguard.view.drawables import Bodies, Drawable, slug
from armguard.view.world import Cycle, World

Floats = NDArray[np.float64]

# The ghost has no body that would move less than this [m, or by the turn of its axes].
LEAST = 0.004

# Size of the ghost beside the arm's own [-].
SHARE = 0.97

# Leaves that are drawn, the smallest first.
MOST = 160

CORNERS = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)], dtype=bool)
EDGES = np.array([(a, b) for a in range(8) for b in range(a) if (a ^ b) in (1, 2, 4)])


class StopGhost(Bodies):
    """A translucent arm where the declared stop of the present motion would end."""

    label = "Rest if stopped now"

    def __init__(self, world: World) -> None:
        super().__init__(world)
        links = list(self.links(visuals=False))
        self.frames("ghost", (body for _, body, _, _ in links))
        for _, body, name, mesh in links:
            # A little smaller than the arm, which hides it where both are the same.
            middle = mesh.bounds.mean(axis=0)
            mesh.vertices = middle + SHARE * (mesh.vertices - middle)
            self.mesh(f"/ghost/{body}/{slug(name)}", mesh, BLUE, 0.22)
        self._hide()

    def _draw(self, cycle: Cycle) -> None:
        q = resting(cycle.frame, self.tables)
        if q is None:
            self._hide()
            return
        poses = body_poses(self.tables, q)
        for k, node in self.nodes.items():
            node.visible = bool(np.abs(poses[k] - cycle.frame.poses[k]).max() > LEAST)
        self.move(poses)


class Leaves(Drawable):
    """Edges of the octree's leaves that the box of a moving primitive meets.

    The leaves are a function of where bodies are, never of how they got there
    (docs/architecture.md), so a separate tree with the poses of a frame has the same.
    """

    label = "Octree leaves at the arms"
    every = 0.2
    shown = False

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._tree: Octree | None = None
        self._revision = -1

    def _draw(self, cycle: Cycle) -> None:
        if self.tables.index.kind in ("brute_force", "joint_table"):
            return
        cells = self._cells(cycle.frame)
        corners = np.where(CORNERS, cells[:, None, 3:], cells[:, None, :3])
        points = corners[:, EDGES].reshape(-1, 2, 3).astype(np.float32)
        if not self.nodes:
            self.nodes[0] = self.api.add_line_segments(
                "/leaves", points, BLUE, thickness=1.0, thickness_units="screen"
            )
        self.nodes[0].points, self.nodes[0].visible = points, True

    def _cells(self, frame: Frame) -> Floats:
        """Corners of the leaves, lower and upper, shape (k, 6) [m]."""
        tables, objects = self.tables, self.world.objects
        if self._tree is None:
            home = world_at_home(tables, np.zeros((len(tables.parent), 12)))
            tree = build_index(tables, home)
            assert isinstance(tree, Octree)
            self._tree = tree
        tree = self._tree
        world = tree.world
        if objects.revision != self._revision:
            self._revision = objects.revision
            for name, T in objects.poses.items():
                item = objects.present(name, tables.standing[name])
                if T is None:
                    take_out(tree, item)
                elif item.body < 0:
                    stand_at(tree, item, T)
        poses = np.ascontiguousarray(frame.poses)
        place_all(tables.kinds, tables.bodies, tables.local_rows, poses, world)
        for i in range(tables.moving_count):
            tree.update(i)
        cells = tree.cells(tree.leaves())
        boxes = world.boxes[: tables.moving_count]
        low, high = cells[:, None, :3], cells[:, None, 3:]
        beyond = np.maximum(boxes[None, :, :3] - high, low - boxes[None, :, 3:])
        near = cells[(beyond.max(axis=2) <= 0.0).any(axis=1)]
        return np.asarray(near[np.argsort(near[:, 3] - near[:, 0])][:MOST])


def resting(frame: Frame, tables: SceneTables) -> Floats | None:
    """Joint positions after a stop ordered now, shape (n,); None if unknown.

    Joints keep their speed until the order is obeyed, then slow down by the least
    deceleration that is declared. Robots without declared figures rest at once.
    """
    if frame.velocity is None or not np.isfinite(frame.q).all():
        return None
    travel, speed = np.zeros(len(frame.q)), np.abs(frame.velocity)
    for part in tables.robots:
        figures = part.stopping
        if figures is None:
            continue
        reaction = figures.sensing + figures.command + tables.period + tables.late
        for k in range(part.joint_count):
            j, table = part.first_joint + k, figures.table_of(k)
            if table is not None:
                braking = table.at(float(speed[j]))[1]
            else:
                deceleration = float(figures.deceleration[k])
                braking = brake_way(float(speed[j]), deceleration, figures.ramp)[0]
            travel[j] = speed[j] * reaction + braking
    q = frame.q + np.sign(frame.velocity) * travel
    return np.clip(q, tables.lower, tables.upper)
