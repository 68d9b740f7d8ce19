"""Cycles to draw: a frame with its verdict, from a loop's ring or from a recording."""

import bisect
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

from armguard.guard import layout
from armguard.guard.levels import Level, Reason, level_of
from armguard.guard.verdict import Names, NearPair, Verdict
from armguard.respond import Command
from armguard.scene.tables import SceneTables
from armguard.station.frames import KIND, Frame, Kind, frame_of
from armguard.station.ring import RingReader

# Time between two looks into the ring; a level is shown within it [s].
LOOK = 0.004

# Cycles that are kept; of a longer recording every second one, or every fourth, ….
MOST = 200_000


@dataclass(frozen=True)
class Cycle:
    """A cycle as it was judged.

    Attributes:
        frame: The frame.
        verdict: Its verdict.
        command: What the robots were commanded; None where no motion was asked for.
    """

    frame: Frame
    verdict: Verdict
    command: Command | None

    @cached_property
    def pairs(self) -> list[NearPair]:
        """Its near pairs, the one with the least clearance first."""
        return sorted(self.verdict.near, key=lambda pair: pair.clearance)


def cycle_of(frame: Frame, tables: SceneTables, names: Names) -> Cycle:
    """A cycle's frame with its verdict and its command."""
    verdict = Verdict(
        frame.verdict,
        names,
        float(frame.stamps[0]) if len(frame.stamps) else None,
        frame.cycle_time,
        str(frame.text.get("fault", "")),
    )
    command = Command(frame.told, tables.robots, verdict) if len(frame.told) else None
    return Cycle(frame, verdict, command)


def levels_of(frame: Frame, robots: int) -> tuple[int, ...]:
    """The highest level of a cycle, then that of each robot, without making a verdict.

    Args:
        frame: Frame of a cycle.
        robots: Robots the verdict has a row for.
    """
    own = level_of(Reason(int(frame.verdict[layout.REASON])))
    step = layout.ROBOT_WIDTH
    first = layout.HEADER + layout.ROBOT_LEVEL
    each = frame.verdict[first : first + robots * step : step]
    levels = tuple(int(level) for level in each)
    return (max((int(own), *levels), default=int(Level.CLEAR)), *levels)


class Source(Protocol):
    """Where cycles come from: a ring or a recording."""

    @property
    def newest(self) -> Frame | None:
        """The cycle to draw now; None before there is one."""


class LiveFrames:
    """Reads every frame of a ring; the newest cycle is drawn, never a queue.

    Every record is looked at, so that no level is missed however short it was.

    Attributes:
        newest: The newest cycle, None before there is one.

    Args:
        path: The ring's file.
        cycle: Called with every cycle that is written from `start` on, in order.
        other: Called with every other frame, and those before it.

    Raises:
        RingError: There is no ring.
    """

    newest: Frame | None = None

    def __init__(
        self,
        path: Path,
        cycle: Callable[[Frame], None],
        other: Callable[[Frame], None],
    ) -> None:
        self._reader = RingReader(path)
        self._cycle, self._other = cycle, other
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ring", daemon=True)

    @property
    def closed(self) -> bool:
        """Whether the loop has ended its ring."""
        return self._reader.closed

    @property
    def age(self) -> float:
        """Time since the newest cycle was written [s]; infinite before the first."""
        newest = self.newest
        return float("inf") if newest is None else time.monotonic() - newest.monotonic

    def start(self) -> None:
        """Take the events of what is in the ring already, then read in a thread."""
        self._read(lambda frame: None)
        self._thread.start()

    def close(self) -> None:
        """Close the ring."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)
        self._reader.close()

    def _run(self) -> None:
        while not self._stop.wait(LOOK):
            self._read(self._cycle)

    def _read(self, cycle: Callable[[Frame], None]) -> None:
        """Take in what has been written since the last look."""
        for row in self._reader.unread():
            if int(row[KIND]) == Kind.CYCLE:
                self.newest = frame_of(row)
                cycle(self.newest)
            else:
                self._other(frame_of(row))


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

    def set_speed(self, speed: float) -> None:
        """Change how fast time passes [-]."""
        self.go(self.position)
        self.speed = speed

    def step(self, cycles: int) -> None:
        """Go on by some cycles, or back, and stay there."""
        place = min(max(self._place() + cycles, 0), len(self._times) - 1)
        self._playing = False
        self.go(self._times[place] if self._times else 0.0)

    def to_stop(self, forward: bool) -> None:
        """Go to the next stop, or to the one before."""
        at = self.position
        if forward:
            target = min((s for s in self.stops if s > at + 1e-6), default=self.length)
        else:
            target = max((s for s in self.stops if s < at - 1e-6), default=0.0)
        self._playing = False
        self.go(target)

    def _place(self) -> int:
        found = bisect.bisect_right(self._times, self.position + 1e-9) - 1
        return max(found, 0)
