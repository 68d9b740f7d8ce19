"""Late cycles: measured period of the loop, and the value to declare."""

import logging
from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import Reason
from armguard.scene.schema import LEAST_UNLIKELY

log = logging.getLogger("armguard")

CYCLE_LATE = int(Reason.CYCLE_LATE)

# Count of consecutive late cycles that prove a loop slower than declared.
IN_A_ROW = 20

# Greatest ratio of the cycle times of a regular loop [-].
REGULAR = 1.5


class Pace:
    """Detects a loop that is steadily slower than declared, and logs it once.

    Args:
        period: Declared time from one cycle to the next [s].
        late: Permitted delay of a cycle beyond that [s].
    """

    __slots__ = ("_count", "_least", "_most", "_said", "_total", "late", "period")

    def __init__(self, period: float, late: float) -> None:
        self.period, self.late = period, late
        self._said = False
        self._count, self._total = 0, 0.0
        self._least = self._most = 0.0

    def note(self, answer: NDArray[np.float64]) -> float:
        """Add the answer of a cycle, and return its reason."""
        reason = answer.item(IN_HEADER.reason)
        if reason == CYCLE_LATE:
            self._add(answer.item(IN_HEADER.value))
        elif self._count:
            self._count = 0
        return reason

    def _add(self, passed: float) -> None:
        if self._said:
            return
        least, most = min(self._least, passed), max(self._most, passed)
        if not self._count or most > REGULAR * least:
            self._count, self._total = 0, 0.0
            least = most = passed
        self._count, self._total = self._count + 1, self._total + passed
        self._least, self._most = least, most
        if self._count == IN_A_ROW:
            self._said = True
            mean = self._total / IN_A_ROW
            advice = remedy(mean, most - mean)
            if mean >= LEAST_UNLIKELY:
                advice = f"stamps look like {unit_of(mean)}; give seconds"
            log.warning(
                "cycles come every %.1f ms, %s and %s",
                mean * 1e3,
                declared(self.period, self.late),
                f"robots are stopped: {advice}",
            )


def late_sentence(passed: float, period: float, late: float) -> str:
    """A late cycle in words, with the values to declare."""
    unit = ""
    if passed >= LEAST_UNLIKELY:
        unit = f"if stamps are in {unit_of(passed)}, give seconds; else "
    return (
        f"{passed * 1e3:.1f} ms since the last cycle, {declared(period, late)}: "
        f"{unit}{remedy(passed)}; if only some cycles take so long, set late"
    )


def unit_of(passed: float) -> str:
    """Unit in which a time between cycles [s] would be that of a control loop."""
    if passed < 1e3 * LEAST_UNLIKELY:
        return "milliseconds"
    return "microseconds" if passed < 1e6 * LEAST_UNLIKELY else "nanoseconds"


def clock_sentence(off: float) -> str:
    """Likely cause of a stamp that is off the time of the cycle [s]; "" if unknown."""
    if off < LEAST_UNLIKELY:
        return ""
    return "; give stamp and now in seconds, of the same clock"


def declared(period: float, late: float) -> str:
    """Declared period and delay of the scene, in words."""
    return (
        f"but the scene declares period {period * 1e3:.1f} ms "
        f"(+ late {late * 1e3:.1f} ms)"
    )


def remedy(period: float, late: float = 0.0) -> str:
    """Values to declare for a period and its greatest delay [s], in words."""
    period = rounded_up(period)
    code, keys = f"period={period:g}", f"period: {period:g}"
    if late > 0.01 * period:
        late = rounded_up(late)
        code, keys = f"{code}, late={late:g}", f"{keys}, late: {late:g}"
    return (
        f"set Scene({code}), in a scene file `cycle: {{{keys}}}`, for a service "
        f"--rate {1.0 / period:.4g}"
    )


def rounded_up(seconds: float) -> float:
    """A time rounded up to three digits [s]."""
    scale = 10.0 ** (2 - floor(log10(seconds)))
    return ceil(seconds * scale * (1.0 - 1e-9)) / scale
