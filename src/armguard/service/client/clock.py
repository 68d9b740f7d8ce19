"""The service's clock, as a client knows it."""

import time
from math import isfinite


class ServiceClock:
    """The service's monotonic clock.

    On the machine of the service it is this machine's. Elsewhere it is estimated from
    the quickest round trip there was: the service's clock was read somewhere between
    question and answer.

    Attributes:
        offset: What has to be added to this machine's clock [s].
        bound: How wrong that is at most, drift left out [s].
    """

    def __init__(self) -> None:
        self.offset = 0.0
        self.bound = float("inf")

    def share(self) -> None:
        """The service runs on this machine."""
        self.offset = self.bound = 0.0

    def learn(self, asked: int, read: int, answered: int) -> None:
        """Learn from a round trip.

        Args:
            asked: When the question left, on this clock [ns].
            read: When it came in, on the service's [ns].
            answered: When the answer came in, on this one [ns].
        """
        bound = (answered - asked) * 0.5e-9
        if 0.0 <= bound < self.bound:
            self.bound = bound
            self.offset = (read - (asked + answered) // 2) * 1e-9

    def __call__(self) -> float:
        """The service's clock now [s]."""
        return time.monotonic() + self.offset

    def earliest(self) -> float:
        """The earliest that the service's clock may show now [s].

        A message with this stamp is never stamped later than the cycle that receives
        it. Before the first round trip it is this machine's clock.
        """
        return self() - (self.bound if isfinite(self.bound) else 0.0)
