"""The view of a recording: its frames on a time line."""

import datetime
from collections.abc import Iterable, Mapping
from typing import Any

import viser

from armguard.scene.scene import Scene
from armguard.station.frames import Frame, Kind
from armguard.station.view.cycles import Playback
from armguard.station.view.view import View
from armguard.station.view.world import ObjectPoses

SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1": 1.0, "4": 4.0, "16": 16.0}


class RecordedView(View):
    """Shows what was recorded, and never takes it for the present.

    Attributes:
        source: Where on the time line it is.

    Args:
        scene: The scene it was recorded with.
        frames: What was recorded, in order.
        page_port: Port of the page; 0 for any port that is free.

    Raises:
        StationError: The port is taken.
    """

    source: Playback

    def __init__(
        self, scene: Scene, frames: Iterable[Frame], page_port: int = 8080
    ) -> None:
        super().__init__(scene, page_port, self._received)
        self.source = Playback(frames, len(self.world.names.robots))
        self._events = -1
        with self.tabs.add_tab("Recording"):
            self._add_time_line()

    def step(self) -> None:
        """Draw the cycle at the present position."""
        playback = self.source
        events = playback.events()
        if len(events) != self._events:
            self._events = len(events)
            self.world.objects = ObjectPoses(self.world.scene)
            for event in events:
                if event.kind is Kind.EVENT:
                    self.world.objects.apply(event.text)
        super().step()
        at = round(playback.position, 3)
        if abs(self._line.value - at) > 0.02:
            self._line.value = at
        self._play.label = "Pause" if playback.playing else "Play"
        frame = playback.newest
        if frame is not None:
            when = datetime.datetime.fromtimestamp(frame.wall, datetime.UTC)
            at_second = f"{playback.position:.2f} of {playback.length:.2f} s"
            recorded = f"recorded {when:%Y-%m-%d %H:%M:%S} UTC, {at_second}"
            self.publish(frame, recorded=recorded)

    def _received(self, page: str, message: Mapping[str, Any]) -> None:
        """There is nothing to drive or to stop but the playback."""
        if message["type"] == "stop":
            self.source.play(False)

    def _add_time_line(self) -> None:
        """Add the controls: play, pause, step, jump, speed."""
        gui, playback = self.server.gui, self.source
        with gui.add_folder("Time line"):
            self._line = gui.add_slider(
                "Second", 0.0, max(round(playback.length, 3), 0.001), 0.001, 0.0
            )
            self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
            steps = gui.add_button_group("Cycle", ("-10", "-1", "+1", "+10"))
            count = f"{len(playback.stops)} stops"
            stops = gui.add_button_group(count, ("before", "next"))
            speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1")

        @self._line.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                playback.play(False)
                playback.go(float(self._line.value))

        self._play.on_click(lambda _: playback.play(not playback.playing))
        steps.on_click(lambda _: playback.step(int(steps.value)))
        stops.on_click(lambda _: playback.to_stop(stops.value == "next"))
        speed.on_update(lambda _: playback.set_speed(SPEEDS.get(speed.value, 1.0)))
