"""Whether what the service said last still counts; else why everything stops."""

from math import inf
from time import monotonic

from armguard.station.client.answer import Answer
from armguard.station.client.clock import ServiceClock
from armguard.station.wire.words import Cause


class Watchdog:
    """Looks at clocks in messages, and not at when they were read.

    It needs no thread: whoever asks gets a stop if the newest answer is too old,
    however long nobody asked.

    Attributes:
        newest: The newest answer; None if there is none.
        heard: When the service sent what it said last beside answers, on its clock [s].
        gone: Whether it has said good-bye.

    Args:
        limit: An answer older than that is a stop [s].
        clock: The service's clock.
    """

    def __init__(self, limit: float, clock: ServiceClock) -> None:
        self.newest: Answer | None = None
        self.heard = 0.0
        self.gone = False
        self._limit = limit
        self._clock = clock

    @property
    def cause(self) -> Cause:
        """Why the newest answer does not count; NONE if it does."""
        newest, clock = self.newest, self._clock
        now = monotonic() + clock.offset
        # What the clock may be wrong by counts for the answer, if it is known.
        bound = clock.bound
        limit = self._limit + bound if bound < inf else self._limit
        if self.gone:
            return Cause.SERVICE_GONE
        if newest is None:
            heard = self.heard
        elif now - newest.sent <= limit:
            return Cause.NONE
        else:
            heard = max(self.heard, newest.sent)
        return Cause.NO_ANSWER if now - heard <= limit else Cause.SERVICE_SILENT
