"""Joint positions of all robots at one time, from the cycles of a service."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.recording.frames import IN_FRAME, Frame, Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.service.client import RobotJoints

Floats = NDArray[np.float64]


class JointStream:
    """Reads the measured positions of each robot with their stamps.

    Robots may send their states at different times. The positions of all robots at the
    stamp of the one that is farthest behind lie between two measurements of the others.

    Attributes:
        newest: Stamp of the newest positions, minus infinity without any [s].

    Args:
        ring: The service's ring.
        parts: Joints of each robot.

    Raises:
        RingError: There is no ring.
    """

    def __init__(self, ring: Path, parts: Sequence[RobotJoints]) -> None:
        self.newest = -np.inf
        self._reader = RingReader(ring, newest=True)
        self._own = [slice(one.first, one.first + one.count) for one in parts]
        self._states = StatesOfRobots(self._own)

    @property
    def closed(self) -> bool:
        """Whether the service has ended its ring."""
        return self._reader.closed

    def unread(self) -> Iterator[tuple[Floats, float]]:
        """Positions that came since the last call, with their stamps."""
        for row in self._reader.unread():
            if row[IN_FRAME.kind] != Kind.CYCLE:
                continue
            found = self._states.add(frame_of(row))
            if found is not None and found[1] > self.newest:
                self.newest = found[1]
                yield found

    def close(self) -> None:
        """Close the ring."""
        self._reader.close()


class StatesOfRobots:
    """The last two states of each robot.

    Args:
        own: Joints of each robot.
    """

    def __init__(self, own: Sequence[slice]) -> None:
        self._own = own
        self._before = [(-np.inf, np.zeros(0))] * len(own)
        self._last = [(-np.inf, np.zeros(0))] * len(own)

    def add(self, frame: Frame) -> tuple[Floats, float] | None:
        """Take a cycle; positions of all robots at one stamp, None if one has none."""
        for r, (own, stamp) in enumerate(zip(self._own, frame.stamps, strict=True)):
            if np.isfinite(stamp) and stamp > self._last[r][0]:
                self._before[r] = self._last[r]
                self._last[r] = float(stamp), frame.q[own].copy()
        stamp = min(one[0] for one in self._last)
        if stamp == -np.inf:
            return None
        q = np.zeros(len(frame.q))
        for own, before, last in zip(self._own, self._before, self._last, strict=True):
            q[own] = last[1]
            if last[0] > stamp:
                if not before[0] <= stamp:
                    return None
                share = (stamp - before[0]) / (last[0] - before[0])
                q[own] = before[1] + share * (last[1] - before[1])
        return q, stamp
