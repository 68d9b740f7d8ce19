"""The log of the loop: throttled, and written by another thread.

A cause may repeat a thousand times a second; and a terminal that is paused, or a pipe
that is not read, would block the loop if it wrote the lines itself.
"""

import logging
import sys
import threading
import time
from queue import SimpleQueue
from typing import TextIO

log = logging.getLogger("armguard.service")

# A cause is named in the log no more often than this [ns].
PAUSE = 1_000_000_000

# Lines that wait to be written; further ones are left out.
MOST_LINES = 1000


class ThrottledLog:
    """Names a cause once a second at most, and how often it was left out before."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self._silent: dict[str, int] = {}

    def report(
        self, cause: str, sentence: str, now: int, level: int = logging.WARNING
    ) -> None:
        """Log a sentence, or only count it.

        Args:
            cause: What is logged once a second.
            sentence: The same in words.
            now: Monotonic clock [ns].
            level: Level of the log.
        """
        last = self._last.get(cause)
        if last is not None and now - last < PAUSE:
            self._silent[cause] = self._silent.get(cause, 0) + 1
            return
        self._last[cause] = now
        more = self._silent.pop(cause, 0)
        before = f" ({more} more before)" if more else ""
        log.log(level, "%s: %s%s", cause, sentence, before)


class PatientHandler(logging.Handler):
    """Writes lines from a thread of its own; the one that logs never waits.

    Args:
        stream: Where lines go; standard error if None.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        self._stream = stream
        self._lines: SimpleQueue[str] = SimpleQueue()
        self._writing = False
        threading.Thread(target=self._write, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Leave a line to be written, or leave it out if too many wait."""
        if self._lines.qsize() < MOST_LINES:
            self._lines.put(self.format(record) + "\n")

    def finish(self, patience: float = 1.0) -> None:
        """Wait until all is written, but not for longer than that [s]."""
        end = time.monotonic() + patience
        while time.monotonic() < end and (self._writing or self._lines.qsize()):
            time.sleep(0.005)

    def _write(self) -> None:
        """Write lines as they come."""
        while True:
            line = self._lines.get()
            self._writing = True
            try:
                stream = self._stream or sys.stderr
                stream.write(line)
                stream.flush()
            except (OSError, ValueError):
                # The log is not read any more; the loop goes on.
                pass
            self._writing = False
