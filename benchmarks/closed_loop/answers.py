"""What the loop asks of a guard, and what it reads of a verdict."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from time import perf_counter

from armguard.guard import Level, Reason
from arrays import Floats

# The levels from which on an arm is to be stopped by a controlled stop, by its brake.
STOP, BRAKE = Level.STOP, Level.BRAKE


@dataclass(frozen=True, slots=True)
class Answer:
    """What the loop reads of a verdict."""

    levels: Mapping[str, IntEnum]
    reason: IntEnum
    cycle_time: float = 0.0
    speed_scale: Mapping[str, float] | None = None


class Guarding:
    """What the loop asks of a guard; this one never stops anything.

    Args:
        robots: Names of the arms.
    """

    def __init__(self, robots: Iterable[str]) -> None:
        self.robots = tuple(robots)

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """An object was seen there, at that time."""

    def reset(self) -> None:
        """Forget what was."""

    def step(
        self, q: Floats, stamp: Mapping[str, float], *, velocity: Floats, now: float
    ) -> Answer:
        """Judge a cycle."""
        begin = perf_counter()
        stopped = self.stopped(q, stamp, velocity, now)
        levels = {r: STOP if r in stopped else Level.CLEAR for r in self.robots}
        reason = Reason.TOO_CLOSE if stopped else Reason.OK
        return Answer(levels, reason, perf_counter() - begin)

    def stopped(
        self, q: Floats, stamp: Mapping[str, float], velocity: Floats, now: float
    ) -> Collection[str]:
        """Arms that are to be stopped in a cycle."""
        return ()
