"""Joint positions of the last seconds, and between their stamps."""

from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

# Measurements that are kept.
ROOM = 2048


class Positions(NamedTuple):
    """Joint positions at a time.

    Attributes:
        q: The positions, shape (n,) [rad or m].
        error: How far off each may be, shape (n,) [rad or m].
    """

    q: Floats
    error: Floats


class JointHistory:
    """The last joint positions with their stamps, the oldest replaced first.

    Args:
        error: Error of a measured position, shape (n,) [rad or m].
        acceleration: Greatest acceleration, shape (n,) [rad/s² or m/s²].
    """

    def __init__(self, error: Floats, acceleration: Floats) -> None:
        self._error, self._acceleration = error, acceleration
        # Each is written twice, so that the last ones are always one after another.
        self._q, self._stamps = np.zeros((2 * ROOM, len(error))), np.zeros(2 * ROOM)
        self._next = self._count = 0

    @property
    def newest(self) -> float:
        """Stamp of the newest positions, minus infinity without any [s]."""
        return float(self._stamps[self._next + ROOM - 1]) if self._count else -np.inf

    @property
    def oldest(self) -> float:
        """Stamp of the oldest positions, infinite without any [s]."""
        if not self._count:
            return np.inf
        return float(self._stamps[self._next + ROOM - self._count])

    def add(self, q: ArrayLike, stamp: float) -> bool:
        """Add positions; False if they are not finite or their stamp does not rise."""
        try:
            row = np.asarray(q, dtype=np.float64)
            stamp = float(stamp)
        except (TypeError, ValueError, OverflowError):
            return False
        wrong = row.shape != self._error.shape or not np.isfinite(row).all()
        if wrong or not isfinite(stamp) or stamp <= self.newest:
            return False
        for k in (self._next, self._next + ROOM):
            self._q[k], self._stamps[k] = row, stamp
        self._next = (self._next + 1) % ROOM
        self._count = min(self._count + 1, ROOM)
        return True

    def at(self, stamp: float) -> Positions | None:
        """Positions at a time, on the straight line between two measurements.

        After the newest measurement they are those, and their error grows with the
        time. None before the oldest one.
        """
        if not self.oldest <= stamp:
            return None
        last = slice(self._next + ROOM - self._count, self._next + ROOM)
        q, stamps = self._q[last], self._stamps[last]
        after = int(stamps.searchsorted(stamp))
        if after == len(stamps):
            return self._beyond(q, stamps, stamp - stamps[-1])
        if after == 0:
            return Positions(q[0].copy(), self._error)
        a, b = q[after - 1], q[after]
        gap = stamps[after] - stamps[after - 1]
        share = (stamp - stamps[after - 1]) / gap
        # A path of bounded acceleration leaves its chord by at most a · gap² / 8.
        bend = self._acceleration * gap * gap / 8.0
        return Positions(a + share * (b - a), self._error + bend)

    def _beyond(self, q: Floats, stamps: Floats, time: float) -> Positions:
        """Positions some time after the newest measurement [s]."""
        speed = np.zeros_like(self._error)
        if len(stamps) > 1:
            speed = np.abs(q[-1] - q[-2]) / (stamps[-1] - stamps[-2])
        way = speed * time + 0.5 * self._acceleration * time * time
        return Positions(q[-1].copy(), self._error + way)
