"""A recording as a source of cycles: play, pause, step, and go anywhere in it."""

import bisect
import time
from collections.abc import Callable, Iterable

from armguard.station.frames import Frame, Kind
from armguard.station.view.judged import level_at_a_glance

# Cycles that are kept; of a longer recording every second one, or every fourth, ….
MOST = 200_000

STOP_LEVEL = 30


class Playback:
    """Frames of a recording on a time line.

    Attributes:
        speed: Seconds of the recording in a second [-].
        playing: Whether time passes.

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
            now = level_at_a_glance(frame, robots)[0] >= STOP_LEVEL
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
        self.speed = 1.0
        self._playing = False
        self._at = 0.0
        self._since = clock()

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
        if not self._cycles:
            return None
        return self._cycles[self._place()]

    def events(self) -> list[Frame]:
        """All that happened up to this position that is no cycle."""
        now = self._start + self.position
        return [frame for frame in self._events if frame.monotonic <= now]

    def play(self, playing: bool) -> None:
        """Let time pass, or stop it; at its end a recording starts anew."""
        at = self.position
        self._go(0.0 if playing and at >= self.length else at)
        self._playing = playing

    def go(self, position: float) -> None:
        """Go to a position [s]."""
        self._go(min(max(position, 0.0), self.length))

    def set_speed(self, speed: float) -> None:
        """Change how fast time passes [-]."""
        self._go(self.position)
        self.speed = speed

    def step(self, cycles: int) -> None:
        """Go on by some cycles, or back, and stay there."""
        self._playing = False
        if self._cycles:
            place = min(max(self._place() + cycles, 0), len(self._times) - 1)
            self._go(self._times[place])

    def to_stop(self, forward: bool) -> None:
        """Go to the next stop, or to the one before."""
        at = self.position
        if forward:
            places = [stop for stop in self.stops if stop > at + 1e-6]
            target = places[0] if places else self.length
        else:
            places = [stop for stop in self.stops if stop < at - 1e-6]
            target = places[-1] if places else 0.0
        self._playing = False
        self._go(target)

    def close(self) -> None:
        """There is nothing to let go of."""

    def _go(self, at: float) -> None:
        self._at, self._since = at, self._clock()

    def _place(self) -> int:
        found = bisect.bisect_right(self._times, self.position + 1e-9) - 1
        return max(found, 0)
