"""The view of a recording: its frames on a time line."""

import datetime
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from armguard.scene.scene import Scene
from armguard.station.frames import Frame, Kind
from armguard.station.view.placements import Placements
from armguard.station.view.playback import Playback
from armguard.station.view.time_line import TimeLine
from armguard.station.view.view import View, at_rate


class RecordedView:
    """Shows what was recorded, and never takes it for the present.

    Attributes:
        view: The page.
        playback: Where on the time line it is.

    Args:
        scene: The scene it was recorded with.
        frames: What was recorded, in order.
        page_port: Where the page is to be; 0 for any port that is free.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self, scene: Scene, frames: Iterable[Frame], page_port: int = 8080
    ) -> None:
        self.view = View(scene, page_port, self._heard)
        self.playback = Playback(frames, len(self.view.world.names.robots))
        with self.view.tabs.add_tab("Recording"):
            self._line = TimeLine(self.view.server, self.playback)
        self._events = -1

    def run(self, until: Callable[[], bool]) -> None:
        """Draw until told not to."""
        at_rate(self.draw, until)

    def draw(self) -> None:
        """Draw the cycle at the present position."""
        frame, world = self.playback.newest, self.view.world
        events = self.playback.events()
        if len(events) != self._events:
            self._events = len(events)
            world.placements = placed_by(world.scene, events)
        self.view.draw(frame)
        self._line.show()
        if frame is not None:
            self.view.tell(frame, recorded=self._when(frame))

    def close(self) -> None:
        """Let go of the page."""
        self.view.close()

    def _when(self, frame: Frame) -> str:
        """When a frame was recorded, in words."""
        when = datetime.datetime.fromtimestamp(frame.wall, datetime.UTC)
        at = f"{self.playback.position:.2f} of {self.playback.length:.2f} s"
        return f"recorded {when:%Y-%m-%d %H:%M:%S} UTC, {at}"

    def _heard(self, page: str, said: Mapping[str, Any]) -> None:
        """What a page says: there is nothing to drive or to stop but the playback."""
        if said["type"] == "stop":
            self.playback.play(False)


def placed_by(scene: Scene, events: Iterable[Frame]) -> Placements:
    """Where objects stand after some events."""
    placements = Placements(scene)
    for frame in events:
        if frame.kind is Kind.EVENT:
            placements.take(frame.text)
    return placements
