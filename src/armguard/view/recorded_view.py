"""The view of a recording: its frames on a time line."""

import bisect
import datetime
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from armguard.guard.levels import Level
from armguard.recording.frames import Frame, Kind
from armguard.recording.palette import STATE_COLOURS, State, hexadecimal, state_of
from armguard.scene.scene import Scene
from armguard.view.signals import RATE, SPAN
from armguard.view.view import View
from armguard.view.world import ObjectPoses, held_in, levels_of

# A cycle that is so much later than the last one, or earlier, comes after a jump [s].
JUMP = 1.0

# Cycles whose clock shows an earlier time were judged afterwards [s since 1970].
UNDATED = 1e8

# Cycles before a position that the plot shows.
PLOTTED = SPAN * RATE

# Parts of the time line that can be distinguished.
PIECES = 2000

SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1": 1.0, "4": 4.0, "16": 16.0}

# Cycles that are kept; of a longer recording every second one, or every fourth, ….
MOST = 200_000


class Playback:
    """Frames of a recording on a time line: play, pause, step, and jump.

    Attributes:
        stops: When a robot was stopped [s].
        states: When the state of all robots together changed [s], and to which.
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
        states: list[tuple[float, State]] = []
        stopped: tuple[bool, ...] = ()
        every = seen = 0
        for frame in frames:
            if frame.kind is not Kind.CYCLE:
                self._events.append(frame)
                continue
            if not len(frame.poses) or not len(frame.verdict):
                continue
            each = levels_of(frame, robots)
            state = state_of(each[0], any(held_in(frame, robots)))
            if not states or state != states[-1][1]:
                states.append((frame.monotonic, state))
            now = tuple(one >= Level.STOP for one in each)
            if any(
                a and not b
                for a, b in zip(now, stopped or (False,) * len(now), strict=True)
            ):
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
        self.states = tuple((at - self._start, state) for at, state in states)
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

    def past(self) -> list[Frame]:
        """Cycles of the last seconds before this position, no more than are plotted."""
        last = self._place()
        first = bisect.bisect_left(self._times, self.position - SPAN, hi=last)
        return self._cycles[first : last : max(round((last - first) / PLOTTED), 1)]

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
    """Shows a recording, and never takes it for the present.

    It opens at the first stop.

    Attributes:
        source: Where on the time line it is.

    Args:
        scene: The scene it was recorded with.
        frames: Recorded frames, in order.
        page_port: Port of the page; 0 for any port that is free.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self, scene: Scene, frames: Iterable[Frame], page_port: int = 8080
    ) -> None:
        super().__init__(scene, page_port, self._received)
        self.source = Playback(frames, len(self.world.names.robots))
        self._events, self._plotted = -1, -math.inf
        if self.source.stops:
            self.source.go(self.source.stops[0])
        self.page.publish("timeline", self._time_line())

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
        if frame is not None:
            if not 0.0 <= frame.monotonic - self._plotted <= JUMP:
                self.plot.fill(self.world.cycle(one) for one in playback.past())
            self._plotted = frame.monotonic
            self.draw(frame)
            self.place = self.where()
            self.publish(frame, recorded=self.when(frame))

    def where(self) -> dict[str, Any]:
        """Position on the time line [s], and whether time passes."""
        return {"position": self.source.position, "playing": self.source.playing}

    def when(self, frame: Frame) -> str:
        """Of when a cycle is, in words; what was never live has no date."""
        if frame.wall < UNDATED:
            return f"at {frame.monotonic:.2f} s"
        when = datetime.datetime.fromtimestamp(frame.wall, datetime.UTC)
        return f"recorded {when:%Y-%m-%d %H:%M:%S} UTC"

    def _received(self, page: str, message: Mapping[str, Any]) -> None:
        """Take a message of the time line; there is nothing to drive or to stop."""
        kind, playback = message["type"], self.source
        if kind == "play":
            playback.play(not playback.playing)
        elif kind == "speed" and message.get("value") in SPEEDS.values():
            playback.set_speed(float(message["value"]))
        elif kind == "seek":
            at, stop = float(message.get("at", math.nan)), message.get("stop")
            if math.isfinite(at):
                playback.stay(at)
            elif stop in (-1, 1):
                playback.to_stop(forward=stop == 1)
            else:
                playback.step(int(message["cycles"]))

    def _time_line(self) -> dict[str, Any]:
        """The message of the whole recording: its length, states and stops."""
        playback = self.source
        states = thinned(playback.states, playback.length)
        return {
            "length": playback.length,
            "states": [[at, hexadecimal(STATE_COLOURS[one])] for at, one in states],
            "stops": list(playback.stops[:PIECES]),
            "speeds": list(SPEEDS.items()),
        }


def thinned(
    states: Sequence[tuple[float, State]], length: float
) -> Sequence[tuple[float, State]]:
    """Changes of a state that a time line of some length [s] can show.

    Of many changes each part of the line keeps its highest state.
    """
    if len(states) <= PIECES:
        return states
    highest = np.zeros(PIECES, dtype=np.int64)
    ends = [at for at, _ in states[1:]] + [length]
    for (at, state), end in zip(states, ends, strict=True):
        first, last = (int(PIECES * t / length) for t in (at, end))
        own = slice(first, last + 1)
        highest[own] = np.maximum(highest[own], state)
    changed = np.flatnonzero(np.diff(highest, prepend=-1))
    return [(k * length / PIECES, State(int(highest[k]))) for k in changed.tolist()]
