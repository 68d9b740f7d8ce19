"""The last half minute, kept in memory, and whether it is to be kept for good."""

from collections import deque
from dataclasses import dataclass, field
from itertools import islice
from math import inf

from armguard.guard.levels import Level
from armguard.station.blackbox.ros import Stored

# Bytes kept in memory, whatever the time they are of.
MOST_KEPT = 256 << 20

# What ended has to be over for so long before it can begin again [s].
OVER = 1.0


@dataclass
class Before:
    """Messages of the last while, beginning with a checkpoint where there is one.

    Attributes:
        span: How long back they must go [s].
    """

    span: float
    _kept: deque[tuple[float, Stored, bool]] = field(default_factory=deque)
    _size: int = 0

    def add(self, now: float, message: Stored, checkpoint: bool) -> None:
        """Keep a message, and forget what is not needed any more."""
        self._kept.append((now, message, checkpoint))
        self._size += len(message.data)
        if checkpoint:
            self._forget(now)
        while self._size > MOST_KEPT:
            self._size -= len(self._kept.popleft()[1].data)

    def messages(self, since: float = -inf) -> list[Stored]:
        """All that is kept, in order; at least what came after a time [s].

        What came before it is left out as far as a checkpoint allows, from which on a
        replay can begin.
        """
        first = 0
        for k, (time, _, checkpoint) in enumerate(self._kept):
            if checkpoint and time <= since:
                first = k
        return [message for _, message, _ in islice(self._kept, first, None)]

    def _forget(self, now: float) -> None:
        """Forget what is before the last checkpoint that is old enough."""
        enough = [
            k
            for k, (time, _, checkpoint) in enumerate(self._kept)
            if checkpoint and time <= now - self.span
        ]
        for _ in range(enough[-1] if enough else 0):
            self._size -= len(self._kept.popleft()[1].data)


@dataclass
class Trigger:
    """Tells when something begins that is worth a file of its own.

    Attributes:
        clearance: A nearest pair with less than this beyond what it needs is one [m].
        slack: Less time than this until a stop must be ordered is one [s].
    """

    clearance: float
    slack: float
    _active: dict[str, bool] = field(default_factory=dict)
    _ended: dict[str, float] = field(default_factory=dict)
    _known: bool = False

    def look(self, now: float, level: int, clearance: float, slack: float) -> str:
        """What begins with a cycle, in words; empty if nothing does."""
        found = {
            "stop": level >= Level.STOP,
            "clearance": clearance < self.clearance,
            "slack": slack < self.slack,
        }
        began = ""
        for what, holds in found.items():
            was = self._active.get(what, False)
            if was and not holds:
                self._ended[what] = now
            fresh = now - self._ended.get(what, -OVER) >= OVER or what == "stop"
            if holds and not was and fresh and self._known:
                began = began or what
            self._active[what] = holds
        self._known = True
        if began == "stop":
            return f"a stop: {Level(level).name}"
        if began == "clearance":
            return f"the nearest pair had {clearance * 1e3:.1f} mm beyond what it needs"
        if began == "slack":
            return f"a stop had to be ordered within {slack * 1e3:.1f} ms"
        return ""
