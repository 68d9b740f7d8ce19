"""The view: frames in, a page that shows them out."""

import logging
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from armguard.scene.scene import Scene
from armguard.station.frames import Frame, Kind
from armguard.station.view.cues import state_message
from armguard.station.view.judged import level_at_a_glance
from armguard.station.view.live import LiveFrames
from armguard.station.view.page_server import PageServer
from armguard.station.view.panel import Panel
from armguard.station.view.scene_port import open_scene_port
from armguard.station.view.world import World

log = logging.getLogger(__name__)

# Drawings a second.
RATE = 30.0

# The page's sentence and numbers are told anew this often, its light at once [s].
SENTENCE = 0.1

# A frame that is older than this is not the present any more [s].
OLD = 0.5


class View:
    """Shows a running loop's ring on a page.

    Attributes:
        page: The page and its channel.
        world: What is drawn.
        cue_delays: From a cycle's writing until its changed level left for the pages,
            of the last thousand changes [s].

    Args:
        scene: What the frames are about.
        page_port: Where the page is to be; 0 for any port that is free.
    """

    def __init__(self, scene: Scene, *, page_port: int = 8080) -> None:
        self._server = open_scene_port(lambda: self.page.origins)
        self.page = PageServer(page_port, self._server.get_port(), self._heard)
        self.cue_delays: deque[float] = deque(maxlen=1000)
        self._frames: LiveFrames | None = None
        self._shown: Frame | None = None
        self._glance: tuple[int, ...] = ()
        self._told = -float("inf")
        self.world = World(self._server, scene)
        self.panel = Panel(self._server, self.world)

    def watch(self, ring: Path) -> None:
        """Show what is written into a ring from now on.

        Raises:
            RingError: There is no ring.
        """
        if self._frames is not None:
            self._frames.close()
        self._frames = LiveFrames(ring, self._cycle, self._other)
        self._frames.start()

    def run(self, until: Callable[[], bool]) -> None:
        """Draw until told not to."""
        due = time.monotonic()
        while not until():
            self.draw()
            due = max(due + 1.0 / RATE, time.monotonic())
            time.sleep(max(due - time.monotonic(), 0.001))

    def draw(self) -> None:
        """Draw the newest cycle, if it is newer than what is drawn."""
        frame = None if self._frames is None else self._frames.newest
        if frame is None or frame is self._shown:
            self._say_old(frame)
            return
        self._shown = frame
        if not self.world.fits(frame):
            return
        cycle = self.world.judged(frame)
        self.world.draw(cycle)
        self.panel.show(cycle, time.monotonic())

    def close(self) -> None:
        """Let go of ring and page."""
        if self._frames is not None:
            self._frames.close()
        self.page.close()
        self._server.stop()

    def _cycle(self, frame: Frame) -> None:
        """Every cycle of the loop, from the ring's thread: light and sound at once."""
        if not self.world.fits(frame):
            return
        now = time.monotonic()
        glance = level_at_a_glance(frame, len(self.world.names.robots))
        changed = glance != self._glance
        if not changed and now - self._told < SENTENCE:
            return
        first, self._glance, self._told = not self._glance, glance, now
        age = now - frame.monotonic
        cycle = self.world.judged(frame)
        grey = old_sentence(age)
        self.page.tell("state", state_message(cycle, age, grey), keep=True)
        if changed and not first:
            self.cue_delays.append(time.monotonic() - frame.monotonic)

    def _other(self, frame: Frame) -> None:
        """What is no cycle, from the ring's thread."""
        if frame.kind is Kind.EVENT:
            self.world.placements.take(frame.text)

    def _say_old(self, frame: Frame | None) -> None:
        """Tell the page when nothing comes any more; grey is not left to chance."""
        now = time.monotonic()
        if frame is None or now - self._told < SENTENCE:
            return
        age = now - frame.monotonic
        if age < OLD:
            return
        self._told = now
        cycle = self.world.judged(frame)
        ended = self._frames is not None and self._frames.closed
        grey = "the service has ended" if ended else old_sentence(age)
        self.page.tell("state", state_message(cycle, age, grey), keep=True)

    def _heard(self, said: Mapping[str, Any]) -> None:
        """What a page says, from the page's thread."""


def old_sentence(age: float) -> str:
    """Why a frame is not the present; empty if it is young enough."""
    return f"nothing new since {age:.1f} s" if age >= OLD else ""
