"""When a guard warns of a motion: the first slow and the stop, and of which pair."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from armguard import Guard, Level
from armguard.scene.settings import Mode
from arrays import Floats
from room.lines import PERIOD

MODES: tuple[Mode, ...] = ("path", "speed", "fixed")

# Reasons from here on are about the input, which is as it should be here [-].
FAULTS = 100


@dataclass(frozen=True, slots=True)
class Warned:
    """A warning.

    Attributes:
        distance: True distance of the pair it is for [m].
        pair: Its two bodies.
        speed: Speed of the tool [m/s].
        budget: What the pair needs, by cause [m]; None where buffers are fixed.
        closing: Closing speed the guard counts with for the time left [m/s]; None
            where there is none left.
    """

    distance: float
    pair: tuple[str, str]
    speed: float
    budget: dict[str, float] | None
    closing: float | None


def first_warnings(
    guard: Guard, motion: Iterable[tuple[Floats, Floats, float]]
) -> tuple[Warned | None, Warned | None]:
    """The first slow and the first stop of a motion, which ends there.

    The guard gets every sample with its stamp and its velocity, all exact, and does not
    know how old it is: it counts as late as declared.

    Raises:
        RuntimeError: The guard refused the input: the motion is not what it should be.
    """
    guard.reset()
    slow: Warned | None = None
    for k, (q, v, speed) in enumerate(motion):
        verdict = guard.step(q, k * PERIOD, velocity=v)
        if verdict.reason >= FAULTS:
            raise RuntimeError(verdict.why)
        if verdict.level < Level.SLOW:
            continue
        near, budget = verdict.near, verdict.budget
        stopped = verdict.level >= Level.STOP
        # A stop is for what lacks most, a slow for what has least time.
        pair = (
            min(near, key=lambda p: p.clearance)
            if stopped
            else min(near, key=lambda p: p.time_left)
        )
        warning = Warned(
            pair.primitive_distance,
            (pair.a, pair.b),
            speed,
            None if budget is None else asdict(budget),
            pair.clearance / pair.time_left if pair.time_left > 0.0 else None,
        )
        if stopped:
            return slow or warning, warning
        slow = slow or warning
    return slow, None


def plain(warned: Warned | None) -> dict[str, Any] | None:
    """A warning as plain numbers."""
    return None if warned is None else asdict(warned)
