"""An operator who has arms sway about their home, for ever."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from armguard.respond.command import Blocked
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Time of one sway [s].
SWAY = 2.4

# How far joints go to either side, in shares of their range and at most [rad or m].
SHARE, MOST = 0.02, 0.06

# A joint that is off its way is led back in proportion [1/s].
BACK = 2.0


class Sway:
    """Has each joint swing a little, so that every arm moves at every time.

    It never releases and never engages an arm: one that was stopped stays at rest until
    another client engages it.

    Args:
        tables: The scene.
    """

    def __init__(self, tables: SceneTables) -> None:
        self.engages = False
        span = np.minimum(SHARE * (tables.upper - tables.lower), MOST)
        room = np.minimum(tables.home - tables.lower, tables.upper - tables.home)
        self._span = np.clip(span, 0.0, np.maximum(0.5 * room, 0.0))
        self._home = tables.home
        # Neighbours swing a quarter apart: when one turns round the other is fastest.
        self._phase = 0.5 * np.pi * (np.arange(len(span)) % 2)

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """See `Operator.drive`."""
        rate = 2.0 * np.pi / SWAY
        angle = rate * t + self._phase
        there = self._home + self._span * np.sin(angle)
        # Bounded, whatever positions are reported.
        back = np.clip(BACK * (there - q), -self._span, self._span)
        desired: Floats = self._span * rate * np.cos(angle) + back
        return desired, []
