"""The panel of a recording: play, pause, step, a line to go anywhere, its stops."""

import viser

from armguard.station.view.playback import Playback

SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1": 1.0, "4": 4.0, "16": 16.0}


class TimeLine:
    """The controls of a playback.

    Args:
        server: The page.
        playback: What is played.
    """

    def __init__(self, server: viser.ViserServer, playback: Playback) -> None:
        gui, self._playback = server.gui, playback
        with gui.add_folder("Time line"):
            self._line = gui.add_slider(
                "Second", 0.0, max(round(playback.length, 3), 0.001), 0.001, 0.0
            )
            self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
            steps = gui.add_button_group("Cycle", ("-10", "-1", "+1", "+10"))
            stops = gui.add_button_group(
                f"{len(playback.stops)} stops", ("before", "next")
            )
            speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1")
        self._says_play = True

        @self._line.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                playback.play(False)
                playback.go(float(self._line.value))

        @self._play.on_click
        def _(_: viser.GuiEvent) -> None:
            playback.play(not playback.playing)

        @steps.on_click
        def _(_: viser.GuiEvent) -> None:
            playback.step(int(steps.value))

        @stops.on_click
        def _(_: viser.GuiEvent) -> None:
            playback.to_stop(stops.value == "next")

        @speed.on_update
        def _(_: viser.GuiEvent) -> None:
            playback.set_speed(SPEEDS.get(speed.value, 1.0))

    def show(self) -> None:
        """Let the line and the button follow."""
        at = round(self._playback.position, 3)
        if abs(self._line.value - at) > 0.02:
            self._line.value = at
        if self._says_play == self._playback.playing:
            self._says_play = not self._playback.playing
            self._play.label = "Play" if self._says_play else "Pause"
