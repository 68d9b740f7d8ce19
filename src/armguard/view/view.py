"""The page: a world with its drawables, its tabs, its light and its sounds."""

import itertools
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from armguard.errors import StationError
from armguard.recording.frames import Frame
from armguard.recording.palette import BLUE
from armguard.scene.poses import body_poses
from armguard.scene.scene import Scene
from armguard.scene.tables import SceneTables
from armguard.view.computed_drawables import Leaves, StopGhost
from armguard.view.controls import on_value
from armguard.view.drawables import (
    Drawable,
    NearPairs,
    Objects,
    Primitives,
    Robots,
    Shells,
)
from armguard.view.login import Login
from armguard.view.page_server import PageServer
from armguard.view.sensed import Frontier, SensedCells, SensorViews
from armguard.view.signals import MarkedPair, NearList, SignalPlot
from armguard.view.state_message import state_message
from armguard.view.viser_server import open_viser
from armguard.view.world import World, held_in, levels_of

Floats = NDArray[np.float64]

# Drawings a second.
RATE = 30.0

# The page gets sentence and numbers this often, a change of its light at once [s].
SENTENCE = 0.1

# Angle of the first camera against the line across the arms: back, aside, above [-].
DIRECTION = 1.35, 0.85, 0.8

# Room about the origins of links for the links themselves [m].
LINK = 0.15

# Slopes of the lines of sight that the first camera fits the robots into, aside and
# above [-].
HALF_VIEW = np.array([0.9, 0.65])

BACKGROUND = (238, 241, 244)


class View:
    """Shows cycles of one scene at a time.

    Attributes:
        page: The page and its channel.
        login: Admits browsers, each by a separate link.
        server: Viser's server, for tabs and nodes.
        world: The scene that is drawn.
        tabs: The panel's tabs.
        drawables: What follows the cycles, in the scene and in the panel.
        plot: The plot of the last seconds.
        marked: The pair that is marked in the picture.
        remark: Why the service stops all robots beside its verdicts; empty if it does
            not.
        changed: Whether objects were changed within the last second.
        place: Position on the time line of a recording [s], and whether it plays.
        cue_delays: From a cycle's writing until its changed level left for the pages,
            of the last thousand changes [s].

    Args:
        scene: The scene that is shown at first.
        page_port: Port of the page; 0 for any port that is free.
        received: Called with a page's name and its message, from the page's thread.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self,
        scene: Scene,
        page_port: int,
        received: Callable[[str, Mapping[str, Any]], None],
    ) -> None:
        self._hand_on = received
        self.login = Login()
        self.server = open_viser(self.login)
        port = self.server.get_port()
        try:
            self.page = PageServer(page_port, port, self.login, self._receive)
        except StationError:
            self.server.stop()
            raise
        self.cue_delays: deque[float] = deque(maxlen=1000)
        self._published = -np.inf
        self.remark, self.changed = "", False
        self.place: dict[str, Any] = {}
        self.show_scene(scene)

    def show_scene(self, scene: Scene) -> None:
        """Draw another scene from now on, with the tab to watch it by."""
        self.server.gui.reset()
        self.server.gui.configure_theme(
            show_share_button=False, show_logo=False, brand_color=BLUE
        )
        self.server.gui.main_panel.dock_right()
        world = self.world = World(self.server, scene)
        self.server.scene.reset()
        with self.server.atomic():
            set_stage(self.server, world.tables)
            self.drawables: list[Drawable] = [
                kind(world) for kind in DRAWABLES if kind.serves(world)
            ]
        self._drawn: Frame | None = None
        self._summary: tuple[int, ...] = ()
        self.tabs = self.server.gui.add_tab_group()
        with self.tabs.add_tab("Watch", viser.Icon.EYE):
            self.plot = SignalPlot(world)
            self.marked = MarkedPair(world, self.plot)
            self.drawables += self.plot, self.marked, NearList(world)
            with self.server.gui.add_folder("Show"):
                for one in self.drawables:
                    if one.label:
                        self._add_switch(one)

    def run(self, until: Callable[[], bool]) -> None:
        """Draw thirty times a second; a drawing that is late is left out."""
        due = time.monotonic()
        while not until():
            self.step()
            due = max(due + 1.0 / RATE, time.monotonic())
            time.sleep(max(due - time.monotonic(), 0.001))

    def step(self) -> None:
        """Draw the newest cycle of the source."""
        raise NotImplementedError

    def draw(self, frame: Frame | None) -> None:
        """Draw a cycle, unless all of it is drawn already."""
        if frame is None or frame is self._drawn or not self.world.fits(frame):
            return
        self._drawn = frame
        cycle, now = self.world.cycle(frame), time.monotonic()
        with self.server.atomic():
            done = [one.follow(cycle, now) for one in self.drawables]
        if not all(done):
            # A cycle that stays, as in a recording, is drawn by all of them.
            self._drawn = None

    def publish(self, frame: Frame | None, grey: str = "", recorded: str = "") -> None:
        """Send a cycle's state to the pages: at once if levels changed, else seldom.

        Args:
            frame: The cycle.
            grey: Why it is not the present and to be grey; empty where it is live.
            recorded: When it was recorded; empty where it is live.
        """
        if frame is None or not self.world.fits(frame):
            return
        now = time.monotonic()
        live = not (grey or recorded)
        before, summary = self._summary, self._summary_of(frame) if live else ()
        changed = live and summary != before
        if not changed and now - self._published < SENTENCE:
            return
        self._summary, self._published = summary, now
        message = state_message(
            self.world.cycle(frame),
            0.0 if recorded else now - frame.monotonic,
            grey,
            recorded,
            remark=self.remark if live else "",
            changed=self.changed and live,
        )
        self.page.publish("state", {**message, **self.place}, repeat=True)
        if changed and before:
            self.cue_delays.append(time.monotonic() - frame.monotonic)

    def close(self) -> None:
        """Close the page."""
        self.page.close()
        self.server.stop()

    def _receive(self, page: str, message: Mapping[str, Any]) -> None:
        """Take a page's message, in the page's thread."""
        if message["type"] == "mark":
            self.marked.pointed = str(message["at"]), str(message["name"])
            # Also where the cycle stays the same.
            self._drawn = None
            return
        if message["type"] == "gone":
            self.marked.pointed = "", ""
        self._hand_on(page, message)

    def _summary_of(self, frame: Frame) -> tuple[int, ...]:
        """What pages get at once when it changes: levels, who is held, remarks."""
        robots = len(self.world.names.robots)
        levels, held = levels_of(frame, robots), held_in(frame, robots)
        return *levels, *held, self.changed, bool(self.remark)

    def _add_switch(self, drawable: Drawable) -> None:
        def show(shown: bool) -> None:
            drawable.show(shown)
            # Also where the cycle stays the same.
            self._drawn = None

        box = self.server.gui.add_checkbox(drawable.label, drawable.shown)
        on_value(box, show)


# What each scene is drawn by. Robots come first: others have nodes below their bodies.
DRAWABLES: tuple[type[Drawable], ...] = (
    *(Robots, Objects, NearPairs),
    *(Primitives, Shells, StopGhost, Leaves, SensedCells, Frontier, SensorViews),
)


def set_stage(server: viser.ViserServer, tables: SceneTables) -> None:
    """Put up light and floor, and the camera where arms hide least."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_default_lights(enabled=True, cast_shadow=False)
    scene.set_background_image(np.full((2, 2, 3), BACKGROUND, dtype=np.uint8))
    scene.add_grid(
        "/floor",
        width=8.0,
        height=8.0,
        plane="xy",
        cell_size=0.25,
        section_size=1.0,
        cell_color=(216, 220, 224),
        section_color=(192, 198, 204),
    )
    places = body_poses(tables, tables.home)[:, [3, 7, 11]]
    tools = places[[tables.links[part.tool].body for part in tables.robots]]
    roots = places[[k for k, parent in enumerate(tables.parent) if parent < 0]]
    arms = np.concatenate([tools, roots]).mean(axis=0)
    forward = tools.mean(axis=0) - roots.mean(axis=0)
    ahead = tools.mean(axis=0) + forward * [1.0, 1.0, 0.0]
    towards = (arms - ahead) * [1.0, 1.0, 0.0]
    size = np.linalg.norm(towards)
    towards = towards / size if size > 0.05 else np.array([0.0, -1.0, 0.0])
    aside = np.array([-towards[1], towards[0], 0.0])
    direction = np.array([towards, aside, [0.0, 0.0, 1.0]]).T @ DIRECTION
    corners = corners_of(*bounds_of(tables, places))
    position, look_at = fitted(corners, direction / np.linalg.norm(direction))
    server.initial_camera.position, server.initial_camera.look_at = position, look_at


def fitted(corners: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Position of a camera that sees all corners, and the point it looks at [m].

    Args:
        corners: Corners of a box, shape (8, 3) [m].
        direction: Unit vector from the box to the camera.
    """
    middle = corners.mean(axis=0)
    aside = np.cross(direction, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    beside = (corners - middle) @ np.array([aside, np.cross(aside, direction)]).T
    away = (np.abs(beside) / HALF_VIEW).max(axis=1) + (corners - middle) @ direction
    return middle + away.max() * direction, middle


def bounds_of(tables: SceneTables, places: Floats) -> tuple[Floats, Floats]:
    """Corners of the box about the robots, where they are at home.

    Args:
        tables: The scene.
        places: Origins of all bodies at home, shape (b, 3) [m].

    Returns:
        Least and greatest corner, shape (3,) [m].
    """
    joints = places[: len(tables.parent)]
    return joints.min(axis=0) - LINK, joints.max(axis=0) + LINK


def corners_of(low: Floats, high: Floats) -> Floats:
    """Corners of a box, shape (8, 3) [m]."""
    return np.array(list(itertools.product(*zip(low, high, strict=True))))
