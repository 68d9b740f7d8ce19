"""The last half minute, kept in memory, and whether it is to be kept for good."""

from collections import deque
from dataclasses import dataclass, field
from itertools import islice
from math import inf

from armguard.guard.levels import Level
from armguard.recording.messages import Summary
from armguard.recording.ros import Stored

# Bytes kept in memory, whatever the time they are of.
MOST_KEPT = 256 << 20

# A near miss has to be over for so long before it can begin again [s].
OVER = 1.0

# Kinds of near misses: a level, a headroom [mm], a time [ms].
SENTENCES = (
    "a stop: {0}",
    "the nearest pair had {1:.1f} mm beyond what it needs",
    "a stop had to be ordered within {2:.1f} ms",
)


@dataclass
class Before:
    """Messages of the last while, beginning with a checkpoint where there is one."""

    span: float  # how long back they must go [s]
    _kept: deque[tuple[float, Stored, bool]] = field(default_factory=deque)
    _size: int = 0

    def add(self, now: float, message: Stored, checkpoint: bool) -> None:
        """Keep a message, and forget what is not needed any more."""
        self._kept.append((now, message, checkpoint))
        self._size += len(message.data)
        old = self._begin(now - self.span) if checkpoint else 0
        while old > 0 or self._size > MOST_KEPT:
            self._size -= len(self._kept.popleft()[1].data)
            old -= 1

    def messages(self, since: float = -inf) -> list[Stored]:
        """All that is kept, in order; at least what came after a time [s].

        What came before it is left out as far as a checkpoint allows, from which on a
        replay can begin.
        """
        kept = islice(self._kept, self._begin(since), None)
        return [message for _, message, _ in kept]

    def _begin(self, time: float) -> int:
        """Place of the last checkpoint not after a time [s]; 0 if there is none."""
        found = (
            k for k, (at, _, is_one) in enumerate(self._kept) if is_one and at <= time
        )
        return max(found, default=0)


@dataclass
class Trigger:
    """Detects the beginning of a near miss, which gets a file of its own."""

    headroom: float  # of a nearest pair: less than this is a near miss [m]
    time_left: float  # time until a stop must be ordered: likewise [s]
    _active: tuple[bool, ...] = ()
    _ended: list[float] = field(default_factory=lambda: [-OVER] * 3)

    def look(self, now: float, cycle: Summary) -> str:
        """The near miss that begins with a cycle, in words; empty if none does."""
        found = (
            cycle.level >= Level.STOP,
            cycle.headroom < self.headroom,
            cycle.time_left < self.time_left,
        )
        began = ""
        for k, (was, holds) in enumerate(zip(self._active, found, strict=False)):
            if was and not holds:
                self._ended[k] = now
            # A stop is one however soon it follows another.
            fresh = k == 0 or now - self._ended[k] >= OVER
            if holds and not was and fresh and not began:
                name, left = Level(cycle.level).name, cycle.headroom * 1e3
                began = SENTENCES[k].format(name, left, cycle.time_left * 1e3)
        self._active = found
        return began
