"""What is kept of every cycle of a recording: some forty bytes each."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Level
from armguard.station.blackbox.report.block import Block

Floats = NDArray[np.float64]
Shorts = NDArray[np.int8]
Singles = NDArray[np.float32]
Longs = NDArray[np.int64]

# A cycle that comes later than this many periods, and than this, is behind a gap [s].
GAP_PERIODS = 10.0
LEAST_GAP = 0.05


@dataclass(frozen=True, slots=True)
class Series:
    """All cycles of a recording in their order.

    Attributes:
        t: When each was judged, since the first one, shape (k,) [s].
        held: How long its verdict was the newest one; behind the last one before a gap
            a period is counted, shape (k,) [s].
        gaps: Places of cycles that a gap follows, shape (g,).
        missing: Cycles whose numbers are missing.
        cycle_time: What judging took, shape (k,) [s].
        answer: From a message's receipt to its answer; NaN if not known, (k,) [s].
        level: Level of each cycle, shape (k,).
        levels: Level of each robot, shape (k, r).
        reason: Reason of each cycle, shape (k,).
        ages: Age of each robot's measurement, shape (k, r) [s].
        slack: Time until a stop must be ordered, shape (k,) [s].
        clearance: What the nearest pair has left, shape (k,) [m].
        distance: Distance of that pair, shape (k,) [m].
        period: Time from one cycle to the next as the scene says [s].
    """

    t: Floats
    held: Floats
    gaps: Longs
    missing: int
    cycle_time: Singles
    answer: Singles
    level: Shorts
    levels: Shorts
    reason: Shorts
    ages: Singles
    slack: Singles
    clearance: Singles
    distance: Singles
    period: float

    @property
    def judged(self) -> float:
        """Time for which there was a verdict [s]."""
        return float(self.held.sum())

    @property
    def duration(self) -> float:
        """From the first cycle to the end of the last one [s]."""
        return float(self.t[-1] + self.held[-1]) if len(self.t) else 0.0

    def time_at(self, levels: Shorts) -> dict[Level, float]:
        """How long each level lasted, of a column of levels [s]."""
        return {level: float(self.held[levels == level].sum()) for level in Level}

    def time_of(self, place: int) -> float:
        """When a cycle was judged, since the first one [s]."""
        return float(self.t[place])


class SeriesMaker:
    """Collects a series, block by block.

    Args:
        robots: How many there are.
        period: Time from one cycle to the next [s].
    """

    def __init__(self, robots: int, period: float) -> None:
        self._robots, self._period = robots, period
        self._blocks: dict[str, list[NDArray[Any]]] = {}

    def add(self, block: Block) -> None:
        """Take in a block."""
        kinds: dict[str, NDArray[Any]] = {
            "t": block.t,
            "cycle": block.cycle,
            "cycle_time": block.cycle_time.astype(np.float32),
            "answer": block.answer.astype(np.float32),
            "level": block.level.astype(np.int8),
            "levels": block.levels.astype(np.int8),
            "reason": block.reason.astype(np.int8),
            "ages": block.ages.astype(np.float32),
            "slack": block.slack.astype(np.float32),
            "clearance": block.clearance.astype(np.float32),
            "distance": block.distance.astype(np.float32),
        }
        for name, values in kinds.items():
            self._blocks.setdefault(name, []).append(values)

    def series(self) -> Series:
        """All that was taken in; to be asked for once."""
        # One after another: an hour need not be in memory twice.
        columns = {
            name: np.concatenate(self._blocks.pop(name)) for name in list(self._blocks)
        }
        cycle = columns.pop("cycle", np.zeros(0, np.int64))
        t = columns.pop("t", np.zeros(0))
        for name in ("levels", "ages"):
            columns.setdefault(name, np.zeros((0, self._robots)))
        for name in COLUMNS:
            columns.setdefault(name, np.zeros(0))
        steps = np.diff(t)
        gaps = np.flatnonzero(steps > max(GAP_PERIODS * self._period, LEAST_GAP))
        held = np.append(np.maximum(steps, 0.0), self._period)[: len(t)]
        held[gaps] = self._period
        skipped = np.diff(cycle) - 1
        return Series(
            t=t - t[0] if len(t) else t,
            held=held,
            gaps=gaps,
            missing=int(skipped[skipped > 0].sum()),
            period=self._period,
            **columns,
        )


# One number a cycle.
COLUMNS = (
    "cycle_time",
    "answer",
    "level",
    "reason",
    "slack",
    "clearance",
    "distance",
)
