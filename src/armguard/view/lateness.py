"""Whether a machine is too busy to run the guard in time."""

import time
from collections import deque
from collections.abc import Callable

from armguard.guard.layout import IN_HEADER
from armguard.recording.frames import Frame
from armguard.simulation.tally import LATE_REASONS

# So many stops by lateness within so long mean a machine that is too busy [-], [s].
BUSY_STOPS, BUSY_SPAN = 3, 20.0

BUSY = (
    "This computer is too busy to run the guard in time: stops by late cycles and old "
    "measurements come from the machine, not from the arms."
)


class Lateness:
    """Counts the stops of the last seconds that lateness caused.

    Args:
        clock: The present [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._late = False
        self._stops: deque[float] = deque(maxlen=BUSY_STOPS)

    @property
    def busy(self) -> bool:
        """Whether the machine is too busy to judge in time."""
        stops = self._stops
        return len(stops) == BUSY_STOPS and self._clock() - stops[0] < BUSY_SPAN

    def add(self, frame: Frame) -> None:
        """Take in a cycle."""
        late = (
            bool(len(frame.verdict)) and frame.verdict[IN_HEADER.reason] in LATE_REASONS
        )
        if late and not self._late:
            self._stops.append(self._clock())
        self._late = late
