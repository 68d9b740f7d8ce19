"""What the loop asks of a guard, and what it reads of an answer."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

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
    """Levels of the guards here."""

    CLEAR = 0
    STOP = STOP


class Why(IntEnum):
    """Reasons of the guards here."""

    OK = 0
    TOO_CLOSE = 20


@dataclass(frozen=True, slots=True)
class Said:
    """Answer of a guard here."""

    levels: Mapping[str, Graded]
    reason: Why
    cycle_time: float = 0.0
