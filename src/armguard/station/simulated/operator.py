"""An operator who drives as the tele-driver says, and knows what to do after a stop."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from armguard.respond.command import Blocked
from armguard.station.simulated.tele import TeleDriver

Floats = NDArray[np.float64]

# How long he keeps his hands off an arm that was stopped, before he engages it [s].
WAIT = 0.6

# How long he tries to get out of what is too near in one direction [s].
TRY = 1.5


class Operator:
    """Drives all arms; lets go of one that was stopped, waits, and goes elsewhere.

    Args:
        driver: Where he wants to go.
    """

    def __init__(self, driver: TeleDriver) -> None:
        self.driver = driver
        count = len(driver.robots)
        self._ahead = np.zeros(count)
        self._since = np.full(count, np.nan)

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """What he asks for, and which arms he engages now.

        Args:
            t: Time [s].
            q: Positions, shape (n,) [rad or m].
            blocked: What keeps each arm from following him, as far as he was told.

        Returns:
            Velocities, shape (n,) [rad/s or m/s], and names of robots.
        """
        engages = []
        hands_off = []
        for r, name in enumerate(self.driver.robots):
            why = blocked.get(name, Blocked.NOT)
            if why is Blocked.NOT:
                self._since[r] = np.nan
                continue
            if np.isnan(self._since[r]):
                self._since[r] = t
            stopped = why is Blocked.STOPPED
            if t - self._since[r] >= (WAIT if stopped else TRY):
                # Elsewhere: his next leg begins now.
                self._ahead[r] = self.driver.next_leg(t + self._ahead[r]) - t
                self._since[r] = t
                if stopped:
                    engages.append(name)
            if stopped:
                hands_off.append(r)
        wish = self.driver.wish(t + self._ahead, q)
        for r in hands_off:
            wish[self.driver.own(r)] = 0.0
        return wish, engages
