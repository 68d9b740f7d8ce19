"""Sensed space on the page: cells, and sensors with their views and states."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from trimesh.creation import box

from armguard.cells.view import CellView
from armguard.geometry.pose import Pose
from armguard.guard.levels import Level
from armguard.recording.palette import BLUE, FIXTURE, STATE_COLOURS, Rgb
from armguard.scene.sensors import SceneSensor
from armguard.view.controls import on_click
from armguard.view.drawables import Drawable, put, slug
from armguard.view.world import Cycle, World

Floats = NDArray[np.float64]

# Cells that are drawn at most, and faces of the frontier: those nearest to the robots.
MOST_CELLS, MOST_FACES = 4000, 6000

# The frontier is drawn up to this distance from the links, which are taken as points
# that are no farther apart than their edges [m].
BESIDE, EDGE = 0.3, 0.1

# Views are drawn so far at most [m].
LONGEST = 0.5

# Colour of cells, and of the view of a sensor that is at fault.
CELLS, AT_FAULT = (214, 102, 20), STATE_COLOURS[Level.STOP]

# Colour of the frontier of knowledge.
FRONTIER = (120, 80, 170)

ORDER = "in order"


class Points(Drawable):
    """Points of sensed space as a cloud of squares."""

    path: ClassVar[str]
    colour: ClassVar[Rgb]

    @classmethod
    def serves(cls, world: World) -> bool:
        """Whether the scene has sensed space."""
        return world.sensed.view is not None

    def _draw_points(self, points: Floats, size: float) -> None:
        """Draw these points, shape (n, 3) [m], at a size [m]."""
        points = points.astype(np.float32)
        if self.nodes and len(points):
            self.nodes[0].points, self.nodes[0].visible = points, True
            return
        while self.nodes:
            self.nodes.popitem()[1].remove()
        if len(points):
            self.nodes[0] = self.api.add_point_cloud(
                self.path, points, self.colour, point_size=size, precision="float32"
            )


class SensedCells(Points):
    """The occupied cells that are nearest to the robots."""

    label = "Sensed cells"
    every = 0.2
    path, colour = "/cells", CELLS

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._revision = -1

    def _draw(self, cycle: Cycle) -> None:
        view, revision = self.world.sensed.view, self.world.sensed.revision
        if view is None:
            return
        if revision != self._revision or not self.nodes:
            self._revision = revision
            points = nearest_cells(view, cycle.frame.poses[:, [3, 7, 11]])
            self._draw_points(points, 0.5 * view.cell)
        for node in self.nodes.values():
            node.visible = True


class Frontier(Points):
    """The faces between known free and unknown cells beside the links."""

    label = "Frontier of knowledge"
    every = 1.0
    path, colour = "/frontier", FRONTIER

    def __init__(self, world: World) -> None:
        super().__init__(world)
        moving = range(self.tables.moving_count)
        parts = [self.primitive(i).subdivide_to_size(EDGE).vertices for i in moving]
        counts = [len(part) for part in parts]
        self._bodies = np.repeat(self.tables.bodies[: self.tables.moving_count], counts)
        self._points = np.concatenate(parts)

    def _draw(self, cycle: Cycle) -> None:
        view = self.world.sensed.view
        if view is not None and np.isfinite(cycle.frame.poses).all():
            T = cycle.frame.poses.reshape(-1, 3, 4)[self._bodies]
            links = np.einsum("nij,nj->ni", T[:, :, :3], self._points) + T[:, :, 3]
            self._draw_points(frontier(view, links), 0.1 * view.cell)


def frontier(view: CellView, links: Floats) -> Floats:
    """Middles of faces between known free and unknown cells, shape (k, 3) [m].

    Args:
        view: The cells.
        links: Points of the links, shape (n, 3) [m]; the faces nearest to them.
    """
    low, high = links.min(axis=0) - BESIDE, links.max(axis=0) + BESIDE
    corners = (np.array([low, high]) - view.middles(np.zeros(3))) / view.cell
    first, last = np.clip(corners + np.array([[-1.0], [2.0]]), 0, view.size).astype(
        np.int64
    )
    part = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
    free, occupied = view.known_free()[part], view.occupied()[part]
    faces = [np.zeros((0, 3))]
    for axis in range(3):
        differ = np.diff(free, axis=axis) & ~np.diff(occupied, axis=axis)
        middles = view.middles(first + np.argwhere(differ))
        faces.append(middles + 0.5 * view.cell * np.eye(3)[axis])
    points = np.concatenate(faces)
    far = cKDTree(links).query(points, distance_upper_bound=BESIDE)[0]
    order = np.argsort(far)[: min(int(np.isfinite(far).sum()), MOST_FACES)]
    return np.asarray(points[order])


def nearest_cells(view: CellView, places: Floats) -> Floats:
    """Middles of the occupied cells nearest to some places, shape (k, 3) [m].

    Args:
        view: The cells.
        places: The places, shape (n, 3) [m].
    """
    middles = view.middles(np.argwhere(view.occupied()))
    if len(middles) <= MOST_CELLS:
        return middles
    far = np.full(len(middles), np.inf)
    for place in places:
        far = np.minimum(far, np.linalg.norm(middles - place, axis=1))
    return np.asarray(middles[np.argpartition(far, MOST_CELLS)[:MOST_CELLS]])


class SensorViews(Drawable):
    """Edges of what each sensor sees, in the colour of its state."""

    label = "Views of sensors"
    every = 0.2

    @classmethod
    def serves(cls, world: World) -> bool:
        """Whether the scene has sensors."""
        return bool(world.scene.sensors)

    def __init__(self, world: World) -> None:
        super().__init__(world)
        for name, sensor in world.scene.sensors.items():
            path, T = f"/views/{slug(name)}", np.eye(4)
            if sensor.on is not None:
                link = self.tables.links[sensor.on]
                path, T = f"/bodies/{link.body}/view_{slug(name)}", link.T_body_link
            node = self.api.add_line_segments(
                path, view_edges(sensor), BLUE, thickness=1.5,
                thickness_units="screen",
            )  # fmt: skip
            put(node, T @ sensor.pose.matrix())
            self.nodes[name] = node

    def _draw(self, cycle: Cycle) -> None:
        for name, node in self.nodes.items():
            says = self.world.sensed.health.get(name, "")
            colour = BLUE if says == ORDER else AT_FAULT if says else FIXTURE
            node.visible, node.colors = True, np.array(colour, np.uint8)


def view_edges(sensor: SceneSensor) -> Floats:
    """Edges of the view of a sensor in its frame, shape (8, 2, 3) [m]."""
    length = min(sensor.range[1], LONGEST)
    x, y = np.tan(0.5 * np.array(sensor.view))
    ends = length * np.array([(x, y, 1), (-x, y, 1), (-x, -y, 1), (x, -y, 1)])
    start = np.zeros_like(ends)
    rim = np.stack([ends, np.roll(ends, 1, axis=0)], axis=1)
    lines = np.concatenate([np.stack([start, ends], axis=1), rim])
    return lines.astype(np.float32)


class SensorTab(Drawable):
    """State of each sensor in words; buttons that blindfold simulated ones.

    Args:
        world: The scene.
        ask: Asks the simulated sensors, see `ask_rig`; None where there are none.
    """

    every = 0.5

    def __init__(
        self,
        world: World,
        ask: Callable[[Mapping[str, str] | None], dict[str, Any] | None],
    ) -> None:
        super().__init__(world)
        self._ask, self._faults = ask, dict[str, str]()
        self._words = {
            name: self.gui.add_markdown(line_of(name, ""))
            for name in world.scene.sensors
        }
        self._buttons = {name: self._add_button(name) for name in self._words}
        self._boxes = False

    def _draw(self, cycle: Cycle) -> None:
        state = self._ask(None)
        if state is not None:
            self._faults = state["faults"]
            self._add_boxes(state["boxes"])
        for name, words in self._words.items():
            line = line_of(name, self.world.sensed.health.get(name, ""))
            if words.content != line:
                words.content = line
        for name, button in self._buttons.items():
            button.visible = state is not None
            does = "See again" if name in self._faults else "Blindfold"
            button.label = f"{does}: {name}"

    def _add_button(self, name: str) -> Any:
        """Add a button that is hidden until simulated sensors answer."""

        def turn() -> None:
            others = {k: v for k, v in self._faults.items() if k != name}
            self._ask(others if name in self._faults else others | {name: "blind"})
            self._due = -np.inf

        button = self.gui.add_button(f"Blindfold: {name}", visible=False)
        return on_click(button, turn)

    def _add_boxes(self, boxes: list[dict[str, Any]]) -> None:
        """Draw the boxes that only sensors see, once."""
        if self._boxes:
            return
        self._boxes = True
        for k, one in enumerate(boxes):
            mesh = box(extents=one["size"])
            node = self.mesh(f"/boxes/{k}", mesh, FIXTURE, 0.3)
            put(node, Pose(xyz=one["xyz"]).matrix())


def line_of(name: str, says: str) -> str:
    """State of a sensor as a line of markdown."""
    sign = "●" if says == ORDER else "▲" if says else "○"
    return f"{sign} **{name}**: {says or 'no report'}"
