"""Whether pages live, and in which of them a pointer is held down."""

import threading
import time
from collections.abc import Callable

# What a page does not repeat for so long has ended [s].
HELD = 0.25

# Where no page says that it lives for so long, nobody looks after what it began [s].
LEFT = 2.0


class Pulses:
    """When each page last said that it lives, and that something is held in it.

    Args:
        clock: The present [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._lived: dict[str, float] = {}
        self._held: dict[str, float] = {}

    def hear(self, page: str, held: bool) -> None:
        """Take a pulse of a page; `held` says that a pointer is down in it."""
        now = self._clock()
        with self._lock:
            self._lived[page] = now
            if held:
                self._held[page] = now
            else:
                self._held.pop(page, None)

    def gone(self, page: str) -> None:
        """A page was closed."""
        with self._lock:
            self._lived.pop(page, None)
            self._held.pop(page, None)

    def holds(self, page: str) -> bool:
        """Whether something is held in a page."""
        with self._lock:
            return self._clock() - self._held.get(page, -float("inf")) <= HELD

    def silence(self, page: str | None = None) -> float:
        """Time since a page's newest pulse, or any page's; infinite without one [s]."""
        with self._lock:
            if page is not None:
                newest = self._lived.get(page, -float("inf"))
            else:
                newest = max(self._lived.values(), default=-float("inf"))
        return self._clock() - newest
