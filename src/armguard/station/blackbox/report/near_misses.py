"""Near misses: spans of time in which it was close, and what was said then."""

from dataclasses import dataclass

import numpy as np

from armguard.guard.levels import Level
from armguard.guard.verdict import Names
from armguard.station.blackbox.report.block import Block
from armguard.station.blackbox.report.spoken import Spoken, spoken
from armguard.station.frames import Frame

# What is apart by no more than this is one near miss [s].
TOGETHER = 1.0


@dataclass(frozen=True, slots=True)
class Closeness:
    """What counts as a near miss besides every stop.

    Attributes:
        clearance: A pair has less than this left beyond what it needs [m].
        slack: A stop would have to be ordered in less than this [s].
    """

    clearance: float = 0.0
    slack: float = 0.0


@dataclass(slots=True)
class NearMiss:
    """A near miss.

    Attributes:
        began: When it began, on the monotonic clock [s].
        ended: When its last cycle was judged.
        cycle: The cycle to look at: of the first stop, else of the least clearance.
        at: When that was, on the monotonic clock [s].
        level: The highest level in it.
        clearance: Least clearance in it; infinite if no pair was near [m].
        nearest_at: When that was, on the monotonic clock [s].
        told: What was said in the cycle to look at.
        nearest: What was said at the least clearance.
    """

    began: float
    ended: float
    cycle: int
    at: float
    level: Level
    clearance: float
    nearest_at: float
    told: Spoken
    nearest: Spoken

    def to_dict(self, begin: float) -> dict[str, object]:
        """The near miss as plain numbers and strings, times since the beginning."""
        return {
            "began": self.began - begin,
            "ended": self.ended - begin,
            "cycle": self.cycle,
            "t": self.at - begin,
            "highest_level": self.level.name,
            "least_clearance": self.clearance,
            "nearest_t": self.nearest_at - begin,
            "told": self.told.to_dict(),
            "nearest": self.nearest.to_dict(),
        }


@dataclass(slots=True)
class Going:
    """A near miss that may go on."""

    began: float
    ended: float
    level: int
    stop: Frame | None
    least: float
    nearest: Frame


class NearMisses:
    """Collects near misses.

    Args:
        names: Names of the scene.
        closeness: What counts as one.
    """

    def __init__(self, names: Names, closeness: Closeness) -> None:
        self._names, self._closeness = names, closeness
        self._going: Going | None = None
        self._found: list[NearMiss] = []

    def add(self, block: Block) -> None:
        """Take in a block."""
        close = self._closeness
        near = block.level >= Level.STOP
        near |= block.clearance < close.clearance
        near |= block.slack < close.slack
        edges = np.flatnonzero(np.diff(np.concatenate([[0], near, [0]])))
        for start, end in edges.reshape(-1, 2).tolist():
            self._add_span(block, start, end)

    def near_misses(self) -> list[NearMiss]:
        """All of them in their order."""
        self._finish()
        return self._found

    def _add_span(self, block: Block, start: int, end: int) -> None:
        """Take in cycles that are all near."""
        t, span = block.t, slice(start, end)
        clearance = np.where(
            np.isnan(block.clearance[span]), np.inf, block.clearance[span]
        )
        k = start + int(clearance.argmin())
        going = self._going
        if going is not None and t[start] - going.ended > TOGETHER:
            self._finish()
            going = None
        if going is None:
            first = block.frames[k]
            going = Going(float(t[start]), 0.0, 0, None, np.inf, first)
            self._going = going
        going.ended = float(t[end - 1])
        going.level = max(going.level, int(block.level[span].max()))
        stops = np.flatnonzero(block.level[span] >= Level.STOP)
        if going.stop is None and len(stops):
            going.stop = block.frames[start + int(stops[0])]
        if clearance[k - start] < going.least:
            going.least = float(clearance[k - start])
            going.nearest = block.frames[k]

    def _finish(self) -> None:
        """Put the one that may go on into words."""
        going, self._going = self._going, None
        if going is None:
            return
        frame = going.nearest if going.stop is None else going.stop
        self._found.append(
            NearMiss(
                began=going.began,
                ended=going.ended,
                cycle=frame.cycle,
                at=frame.monotonic,
                level=Level(going.level),
                clearance=going.least,
                nearest_at=going.nearest.monotonic,
                told=spoken(frame, self._names),
                nearest=spoken(going.nearest, self._names),
            )
        )
