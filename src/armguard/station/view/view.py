"""The page and what is on it: a world, its tabs, its light and its sounds."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import viser

from armguard.scene.scene import Scene
from armguard.station.errors import StationError
from armguard.station.frames import Frame
from armguard.station.view.cues import state_message
from armguard.station.view.door import Door
from armguard.station.view.judged import level_at_a_glance
from armguard.station.view.page_server import PageServer
from armguard.station.view.scene_port import dress, open_scene_port
from armguard.station.view.watch_tab import WatchTab
from armguard.station.view.world import World

# Drawings a second.
RATE = 30.0

# The page's sentence and numbers are told anew this often, its light at once [s].
SENTENCE = 0.1


class View:
    """Shows cycles of one scene at a time.

    Attributes:
        page: The page and its channel.
        door: Lets browsers in, each by a link of its own.
        server: Viser's server, for tabs and nodes.
        world: What is drawn.
        remark: Why the service stops all robots beside its verdicts; empty if it does
            not.
        changed: Whether objects were changed within the last second.
        cue_delays: From a cycle's writing until its changed level left for the pages,
            of the last thousand changes [s].

    Args:
        scene: What is shown at first.
        page_port: Where the page is to be; 0 for any port that is free.
        heard: Called with a page's name and what it says, from the page's thread.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self,
        scene: Scene,
        page_port: int,
        heard: Callable[[str, Mapping[str, Any]], None],
    ) -> None:
        self.door = Door()
        self.server = open_scene_port(self.door)
        try:
            self.page = PageServer(page_port, self.server.get_port(), self.door, heard)
        except StationError:
            self.server.stop()
            raise
        self.cue_delays: deque[float] = deque(maxlen=1000)
        self._shown: Frame | None = None
        self._glance: tuple[int, ...] = ()
        self._told = -float("inf")
        self.remark, self.changed = "", False
        self.show_scene(scene)

    def show_scene(self, scene: Scene) -> viser.GuiTabGroupHandle:
        """Draw another scene from now on; its tabs, to put more into."""
        dress(self.server)
        self.world = World(self.server, scene)
        self._shown, self._glance = None, ()
        tabs = self.server.gui.add_tab_group()
        with tabs.add_tab("Watch", viser.Icon.EYE):
            self._watch = WatchTab(self.server, self.world)
        self.tabs = tabs
        return tabs

    def draw(self, frame: Frame | None) -> bool:
        """Draw a cycle, unless it is drawn already; whether it was drawn now."""
        if frame is None or frame is self._shown or not self.world.fits(frame):
            return False
        self._shown = frame
        cycle = self.world.judged(frame)
        now = time.monotonic()
        self.world.draw(cycle, now)
        self._watch.show(cycle, now)
        return True

    def cue(self, frame: Frame) -> None:
        """Tell pages of a live cycle: at once if its levels are others, else seldom."""
        if not self.world.fits(frame):
            return
        now = time.monotonic()
        robots = len(self.world.names.robots)
        glance = (
            *level_at_a_glance(frame, robots),
            *(np.isfinite(frame.told[-robots:]) if len(frame.told) else ()),
            self.changed,
            bool(self.remark),
        )
        changed = glance != self._glance
        if not changed and now - self._told < SENTENCE:
            return
        first, self._glance, self._told = not self._glance, glance, now
        cycle = self.world.judged(frame)
        message = state_message(
            cycle, now - frame.monotonic, remark=self.remark, changed=self.changed
        )
        self.page.tell("state", message, keep=True)
        if changed and not first:
            self.cue_delays.append(time.monotonic() - frame.monotonic)

    def tell(self, frame: Frame | None, grey: str = "", recorded: str = "") -> None:
        """Tell pages of a cycle that is not the present, and why.

        Args:
            frame: The cycle.
            grey: Why it is to be grey; empty where it is not.
            recorded: When it was recorded; empty where it is live.
        """
        now = time.monotonic()
        if frame is None or now - self._told < SENTENCE or not self.world.fits(frame):
            return
        self._told, self._glance = now, ()
        age = 0.0 if recorded else now - frame.monotonic
        message = state_message(self.world.judged(frame), age, grey, recorded)
        self.page.tell("state", message, keep=True)

    def close(self) -> None:
        """Let go of the page."""
        self.page.close()
        self.server.stop()


def at_rate(work: Callable[[], None], until: Callable[[], bool]) -> None:
    """Do something thirty times a second until told not to; none is made up for."""
    due = time.monotonic()
    while not until():
        work()
        due = max(due + 1.0 / RATE, time.monotonic())
        time.sleep(max(due - time.monotonic(), 0.001))
