"""Guards to be attacked: the real one, and naive ones that show what the test sees."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from armguard import Guard
from armguard.scene import Scene

Floats = NDArray[np.float64]

# The levels from which on an arm is to be stopped by a controlled stop, by its brake.
STOP = 30
BRAKE = 40


class Answer(Protocol):
    """What the loop reads of a verdict."""

    levels: Mapping[str, IntEnum]
    reason: IntEnum


class Guarding(Protocol):
    """What the loop asks of a guard."""

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """An object was seen there, at that time."""

    def step(
        self, q: Floats, stamp: Mapping[str, float], *, velocity: Floats, now: float
    ) -> Answer:
        """Judge a cycle."""

    def reset(self) -> None:
        """Forget what was."""


class Graded(IntEnum):
    """Levels of the naive guards."""

    CLEAR = 0
    STOP = STOP


class Why(IntEnum):
    """Reasons of the naive guards."""

    OK = 0
    TOO_CLOSE = 20


@dataclass(frozen=True, slots=True)
class Said:
    """Answer of a naive guard."""

    levels: Mapping[str, Graded]
    reason: Why
    cycle_time: float = 0.0


class Stopper:
    """Stops everything always."""

    def __init__(self, scene: Scene) -> None:
        self._said = Said(dict.fromkeys(scene.robots, Graded.STOP), Why.TOO_CLOSE)

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """See `Guarding`."""

    def step(self, q: Floats, stamp: Any, *, velocity: Floats, now: float) -> Answer:
        """See `Guarding`."""
        return self._said

    def reset(self) -> None:
        """See `Guarding`."""


class Threshold:
    """Stops every arm as soon as any pair is nearer than a fixed distance.

    Args:
        scene: The scene; its buffers are the distance.
    """

    def __init__(self, scene: Scene) -> None:
        self._guard = Guard(scene)
        self._robots = tuple(scene.robots)

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """See `Guarding`."""
        self._guard.place(name, T)

    def step(self, q: Floats, stamp: Any, *, velocity: Floats, now: float) -> Answer:
        """See `Guarding`."""
        verdict = self._guard.step(q)
        stop = int(verdict.level) >= STOP
        level = Graded.STOP if stop else Graded.CLEAR
        why = Why.TOO_CLOSE if stop else Why.OK
        return Said(dict.fromkeys(self._robots, level), why, verdict.cycle_time)

    def reset(self) -> None:
        """See `Guarding`."""
        self._guard.reset()


class Blind(Stopper):
    """Never stops anything."""

    def __init__(self, scene: Scene) -> None:
        self._said = Said(dict.fromkeys(scene.robots, Graded.CLEAR), Why.OK)


GUARDS: Mapping[str, Callable[[Scene], Guarding]] = {
    "armguard": Guard,
    "threshold": Threshold,
    "stopper": Stopper,
    "blind": Blind,
}
