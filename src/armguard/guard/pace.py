"""Cycles that come later than the scene declares: how late, and what to declare."""

import logging
from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import REASON, VALUE
from armguard.guard.levels import Reason

log = logging.getLogger("armguard")

CYCLE_LATE = int(Reason.CYCLE_LATE)

# So many late cycles in a row are a loop that is slower than declared.
IN_A_ROW = 20

# Cycles whose times differ by more than this factor are no regular loop.
REGULAR = 1.5


class Pace:
    """Notices a loop that is steadily slower than declared, and says so once.

    Args:
        period: Declared time from one cycle to the next [s].
        late: How much later a cycle may come [s].
    """

    __slots__ = ("_count", "_least", "_most", "_said", "_total", "late", "period")

    def __init__(self, period: float, late: float) -> None:
        self.period, self.late = period, late
        self._said = False
        self._count, self._total = 0, 0.0
        self._least = self._most = 0.0

    def note(self, answer: NDArray[np.float64]) -> None:
        """Take in the answer of a cycle."""
        if answer[REASON] == CYCLE_LATE:
            self._add(float(answer[VALUE]))
        elif self._count:
            self._count = 0

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
            log.warning(
                "cycles come every %.1f ms, %s and %s",
                mean * 1e3,
                declared(self.period, self.late),
                f"robots are stopped: {remedy(mean, most - mean)}",
            )


def late_sentence(passed: float, period: float, late: float) -> str:
    """A late cycle in words, with what to declare."""
    return (
        f"{passed * 1e3:.1f} ms since the last cycle, {declared(period, late)}: "
        f"{remedy(passed)}; if only some cycles take so long, set late"
    )


def declared(period: float, late: float) -> str:
    """What the scene declares, in words."""
    return (
        f"but the scene declares period {period * 1e3:.1f} ms "
        f"(+ late {late * 1e3:.1f} ms)"
    )


def remedy(period: float, late: float = 0.0) -> str:
    """What to declare for cycles of that period, and that much later at most [s]."""
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
    """A time of three digits that is not shorter, but for round-off [s]."""
    scale = 10.0 ** (2 - floor(log10(seconds)))
    return ceil(seconds * scale * (1.0 - 1e-9)) / scale
