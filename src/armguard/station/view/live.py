"""The newest cycle of a running loop, read from its ring."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from armguard.station.frames import KIND, Frame, Kind, frame_of
from armguard.station.ring import RingReader

# Time between two looks into the ring [s]. A level is told within it.
LOOK = 0.004


class LiveFrames:
    """Reads every frame, keeps the newest cycle, and hands on what else there is.

    Every record is looked at, so that no level is missed however short it was; but what
    is drawn is the newest one, never a queue.

    Attributes:
        newest: The newest cycle, None before there is one.
        lost: Records that were overwritten before they could be looked at.

    Args:
        path: The ring's file.
        cycle: Called with every cycle that is written from `start` on, in order.
        other: Called with every other frame, and those before it.

    Raises:
        RingError: There is no ring.
    """

    def __init__(
        self,
        path: Path,
        cycle: Callable[[Frame], None],
        other: Callable[[Frame], None],
    ) -> None:
        self._reader = RingReader(path)
        self._cycle, self._other = cycle, other
        self.newest: Frame | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ring", daemon=True)

    @property
    def lost(self) -> int:
        """Records that were overwritten before they could be looked at."""
        return self._reader.lost

    @property
    def closed(self) -> bool:
        """Whether the loop said that it writes no more."""
        return self._reader.closed

    def start(self) -> None:
        """Take the events of what is in the ring already, then look in a thread."""
        cycle, self._cycle = self._cycle, lambda frame: None
        self.look()
        self._cycle = cycle
        self._thread.start()

    def look(self) -> None:
        """Take in what has been written since the last look."""
        for row in self._reader.unread():
            if int(row[KIND]) == Kind.CYCLE:
                self.newest = frame_of(row)
                self._cycle(self.newest)
            else:
                self._other(frame_of(row))

    def age(self) -> float:
        """Time since the newest cycle was written [s]; infinite before the first."""
        newest = self.newest
        return float("inf") if newest is None else time.monotonic() - newest.monotonic

    def close(self) -> None:
        """Let go of the ring."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)
        self._reader.close()

    def _run(self) -> None:
        while not self._stop.wait(LOOK):
            self.look()
