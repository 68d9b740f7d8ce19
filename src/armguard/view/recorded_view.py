"""The view of a recording: its frames on a time line."""

import bisect
import datetime
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import viser

from armguard.guard.levels import Level
from armguard.recording.frames import Frame, Kind
from armguard.scene.scene import Scene
from armguard.view.controls import on_click, on_page, on_value
from armguard.view.view import View
from armguard.view.world import ObjectPoses, levels_of

SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1": 1.0, "4": 4.0, "16": 16.0}

# Cycles that are kept; of a longer recording every second one, or every fourth, ….
MOST = 200_000


class Playback:
    """Frames of a recording on a time line: play, pause, step, and jump.

    Attributes:
        stops: When a robot was stopped [s].
        speed: Seconds of the recording in a second [-].

    Args:
        frames: Frames in their order; of cycles only those with poses are shown.
        robots: Robots that verdicts have a row for.
        clock: The present [s].
    """

    def __init__(
        self,
        frames: Iterable[Frame],
        robots: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock = clock
        self._cycles: list[Frame] = []
        self._events: list[Frame] = []
        stops: list[float] = []
        stopped = False
        every = seen = 0
        for frame in frames:
            if frame.kind is not Kind.CYCLE:
                self._events.append(frame)
                continue
            if not len(frame.poses) or not len(frame.verdict):
                continue
            now = levels_of(frame, robots)[0] >= Level.STOP
            if now and not stopped:
                stops.append(frame.monotonic)
            changed, stopped = now != stopped, now
            seen += 1
            if changed or seen % (1 << every) == 0:
                self._cycles.append(frame)
            if len(self._cycles) > MOST:
                every += 1
                self._cycles = self._cycles[::2]
        self._start = self._cycles[0].monotonic if self._cycles else 0.0
        self._times = [frame.monotonic - self._start for frame in self._cycles]
        self.stops = tuple(stop - self._start for stop in stops)
        self.speed, self._playing = 1.0, False
        self.go(0.0)

    @property
    def length(self) -> float:
        """Length of the recording [s]."""
        return self._times[-1] if self._times else 0.0

    @property
    def playing(self) -> bool:
        """Whether time passes."""
        return self._playing and self.position < self.length

    @property
    def position(self) -> float:
        """Where on the time line it is [s]."""
        passed = self.speed * (self._clock() - self._since) if self._playing else 0.0
        return min(max(self._at + passed, 0.0), self.length)

    @property
    def newest(self) -> Frame | None:
        """The newest cycle at this position; None of an empty recording."""
        return self._cycles[self._place()] if self._cycles else None

    def events(self) -> list[Frame]:
        """All frames up to this position that are no cycles."""
        now = self._start + self.position
        return [frame for frame in self._events if frame.monotonic <= now]

    def play(self, playing: bool) -> None:
        """Let time pass, or stop it; at its end a recording starts anew."""
        at = self.position
        self.go(0.0 if playing and at >= self.length else at)
        self._playing = playing

    def go(self, position: float) -> None:
        """Go to a position [s]."""
        self._at = min(max(position, 0.0), self.length)
        self._since = self._clock()

    def stay(self, position: float) -> None:
        """Go to a position [s] and stay there."""
        self._playing = False
        self.go(position)

    def set_speed(self, speed: float) -> None:
        """Change how fast time passes [-]."""
        self.go(self.position)
        self.speed = speed

    def step(self, cycles: int) -> None:
        """Go on by some cycles, or back, and stay there."""
        place = min(max(self._place() + cycles, 0), len(self._times) - 1)
        self.stay(self._times[place] if self._times else 0.0)

    def to_stop(self, forward: bool) -> None:
        """Go to the next stop, or to the one before."""
        at = self.position
        if forward:
            target = min((s for s in self.stops if s > at + 1e-6), default=self.length)
        else:
            target = max((s for s in self.stops if s < at - 1e-6), default=0.0)
        self.stay(target)

    def _place(self) -> int:
        found = bisect.bisect_right(self._times, self.position + 1e-9) - 1
        return max(found, 0)


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
        frame = playback.newest
        self.draw(frame)
        at = round(playback.position, 3)
        if abs(self._line.value - at) > 0.02:
            self._line.value = at
        self._play.label = "Pause" if playback.playing else "Play"
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

        on_page(self._line, lambda _: playback.stay(float(self._line.value)))
        on_click(self._play, lambda: playback.play(not playback.playing))
        on_click(steps, lambda: playback.step(int(steps.value)))
        on_click(stops, lambda: playback.to_stop(stops.value == "next"))
        on_value(speed, lambda factor: playback.set_speed(SPEEDS.get(factor, 1.0)))
