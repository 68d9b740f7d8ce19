"""Sensed space on the page: cells, and sensors with their views and states."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh.creation import box

from armguard.cells.view import CellView
from armguard.geometry.pose import Pose
from armguard.guard.levels import Level
from armguard.recording.palette import BLUE, FIXTURE, STATE_COLOURS
from armguard.scene.sensors import SceneSensor
from armguard.view.controls import on_click
from armguard.view.drawables import Drawable, put, slug
from armguard.view.world import Cycle, World

Floats = NDArray[np.float64]

# Cells that are drawn at most: those of the words nearest to the robots.
MOST_CELLS = 4000

# Views are drawn so far at most [m].
LONGEST = 0.5

# Colour of cells, and of the view of a sensor that is at fault.
CELLS, AT_FAULT = (214, 102, 20), STATE_COLOURS[Level.STOP]

ORDER = "in order"


class SensedCells(Drawable):
    """The occupied cells that are nearest to the robots."""

    label = "Sensed cells"
    every = 0.2

    @classmethod
    def serves(cls, world: World) -> bool:
        """Whether the scene has sensed space."""
        return world.sensed.view is not None

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
            self._draw_points(points.astype(np.float32), view.cell)
        for node in self.nodes.values():
            node.visible = True

    def _draw_points(self, points: Floats, size: float) -> None:
        if self.nodes and len(points):
            self.nodes[0].points = points
            return
        while self.nodes:
            self.nodes.popitem()[1].remove()
        if len(points):
            self.nodes[0] = self.api.add_point_cloud(
                "/cells", points, CELLS, point_size=0.5 * size, precision="float32"
            )


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
