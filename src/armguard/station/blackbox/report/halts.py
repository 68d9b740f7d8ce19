"""When robots were slowed or stopped, by what, and what would have let it pass."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Level, Reason
from armguard.guard.nuisance import Cause
from armguard.guard.verdict import Names
from armguard.station.blackbox.report.block import Block
from armguard.station.blackbox.report.spoken import Spoken, spoken

# What stands for the robots of a scene whose modes are all "fixed".
EVERYONE = "all"


@dataclass(frozen=True, slots=True)
class Halt:
    """A cycle in which robots began to be slowed or stopped.

    Attributes:
        at: When, on the monotonic clock [s].
        cycle: In which cycle.
        robots: Whom.
        stopped: Whether they were stopped; else they were slowed.
        order: Why each was ordered to; for slows, the verdict's reason.
        told: What the verdict said.
    """

    at: float
    cycle: int
    robots: tuple[str, ...]
    stopped: bool
    order: Reason
    told: Spoken

    def to_dict(self, begin: float) -> dict[str, object]:
        """The halt as plain numbers and strings, its time since the beginning."""
        return {
            "t": self.at - begin,
            "cycle": self.cycle,
            "robots": list(self.robots),
            "stopped": self.stopped,
            "order": self.order.name,
            **self.told.to_dict(),
        }


class Halts:
    """Collects the beginnings of slows and stops.

    Args:
        names: Names of the scene.
    """

    def __init__(self, names: Names) -> None:
        self._names = names
        self._robots = tuple(names.robots) or (EVERYONE,)
        self._last = np.zeros(len(self._robots), dtype=np.int64)
        self.found: list[Halt] = []

    def add(self, block: Block) -> None:
        """Take in a block."""
        if not len(block.frames):
            return
        levels = block.levels if len(self._names.robots) else block.level[:, None]
        before = np.concatenate([self._last[None, :], levels[:-1]])
        self._last = levels[-1]
        for least, stopped in ((Level.SLOW, False), (Level.STOP, True)):
            risen = (levels >= least) & (before < least)
            if not stopped:
                # Who is stopped at once is not slowed first.
                risen &= levels < Level.STOP
            for k in np.flatnonzero(risen.any(axis=1)).tolist():
                self.found.append(self._halt(block, k, risen[k], stopped))

    def halts(self) -> list[Halt]:
        """All of them in their order."""
        return sorted(self.found, key=lambda halt: halt.cycle)

    def _halt(
        self, block: Block, k: int, risen: NDArray[np.bool_], stopped: bool
    ) -> Halt:
        told = spoken(block.frames[k], self._names)
        robots = tuple(
            name for name, own in zip(self._robots, risen, strict=True) if own
        )
        return Halt(
            at=float(block.t[k]),
            cycle=int(block.cycle[k]),
            robots=robots,
            stopped=stopped,
            order=Reason(int(block.reason[k])),
            told=told,
        )


@dataclass(frozen=True, slots=True)
class CauseCount:
    """Slows and stops of one cause.

    Attributes:
        cause: What made them; None where that is not known.
        stops: How many stops.
        slows: How many slows.
        reasons: Reasons of these stops, and how often each.
        most: Greatest deficit of the stops; None if none is known [m].
        remedy: What would have let the stop with that deficit pass.
    """

    cause: Cause | None
    stops: int
    slows: int
    reasons: Counter[Reason]
    most: float | None
    remedy: str

    def to_dict(self) -> dict[str, object]:
        """The same as plain numbers and strings."""
        return {
            "cause": None if self.cause is None else self.cause.value,
            "stops": self.stops,
            "slows": self.slows,
            "reasons": {r.name: count for r, count in self.reasons.items()},
            "most_deficit": self.most,
            "remedy": self.remedy,
        }


def by_cause(halts: list[Halt]) -> list[CauseCount]:
    """Slows and stops by what made them, most stops first."""
    counts = []
    for cause in (*Cause, None):
        own = [halt for halt in halts if halt.told.cause is cause]
        if not own:
            continue
        stops = [halt for halt in own if halt.stopped]
        # What would let the worst stop pass lets the others pass too.
        worst = max(stops or own, key=lambda halt: halt.told.deficit or 0.0)
        counts.append(
            CauseCount(
                cause=cause,
                stops=len(stops),
                slows=len(own) - len(stops),
                reasons=Counter(halt.order for halt in stops),
                most=worst.told.deficit,
                remedy=worst.told.remedy,
            )
        )
    return sorted(counts, key=lambda count: (-count.stops, -count.slows))
