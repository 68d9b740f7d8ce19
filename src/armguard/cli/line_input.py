"""What `armguard coordinate` reads while it runs: the belt as measured, and jobs."""

import threading
from collections.abc import Iterable, Iterator
from queue import Empty, Queue
from time import monotonic

import numpy as np

from armguard.bounded import shown

# How long the belt gets to be measured at first [s].
PATIENCE = 10.0

# A measurement of the belt that is older stops all robots [s].
STALE = 0.1

# Lines with jobs that are read and not taken; then reading waits [-].
MOST_LINES = 100


class LineInput:
    """Reads measurements of the belt, jobs, or both, a line each.

    A measurement is two numbers: how far the belt has moved [m], and its speed [m/s]. A
    job is a JSON object, see `job_of`. Where both are read, lines that begin with a
    brace are jobs.

    Attributes:
        measures: Whether the belt is measured.

    Args:
        lines: Lines as they come.
        belt: Whether these have measurements of the belt.
        jobs: Whether these have jobs.
    """

    def __init__(self, lines: Iterable[str], *, belt: bool, jobs: bool) -> None:
        self.measures, self._has_jobs = belt, jobs
        self._newest, self._stamp = (np.nan, np.nan), -np.inf
        self._wrong = ""
        self._jobs: Queue[str] = Queue(MOST_LINES)
        self._closed = False
        threading.Thread(target=self._read, args=(lines,), daemon=True).start()

    @property
    def ended(self) -> bool:
        """Whether no more jobs come."""
        return not self._has_jobs or (self._closed and self._jobs.empty())

    def measured(self) -> tuple[float, float] | None:
        """The newest travel [m] and speed [m/s]; None if they are too old."""
        return self._newest if monotonic() - self._stamp <= STALE else None

    @property
    def problem(self) -> str:
        """Why there is no measurement, in words."""
        if self._wrong:
            return f"'{self._wrong}' is no travel and speed of the belt; give m and m/s"
        return f"the belt was not measured for {STALE:g} s"

    def jobs(self) -> Iterator[str]:
        """Lines with jobs that were not taken yet."""
        try:
            while True:
                yield self._jobs.get_nowait()
        except Empty:
            return

    def _read(self, lines: Iterable[str]) -> None:
        """Read to the end, or to the first measurement that is none."""
        try:
            for line in lines:
                text = line.strip()
                if self._has_jobs and (text.startswith("{") or not self.measures):
                    if text:
                        self._jobs.put(text)
                    continue
                try:
                    travel, speed = map(float, text.split())
                except ValueError:
                    self._wrong = shown(text)
                    return
                self._newest, self._stamp = (travel, speed), monotonic()
        finally:
            self._closed = True
