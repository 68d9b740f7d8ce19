"""The bay's arms on their bundled task, as the service's benchmark drives them."""

import numpy as np
from numpy.typing import NDArray

from armguard.scene import bay_scene, bay_task
from armguard.station.client import Answer

Floats = NDArray[np.float64]

# The bundled task: rows, and time from one to the next [s].
ROWS, STEP = 2000, 0.03

# How hard the operators pull towards where the task is by now [1/s], and the fastest
# they ask for [rad/s].
PULL, FASTEST = 2.0, 1.2

# What the bay's arms can do: they speed up and stop with that much, their brakes with
# more [rad/s²].
STRENGTH, BRAKES = 8.0, 30.0

# As `Action` numbers what is more than a stop.
BRAKE = 20

# Nobody waits longer than that for a turn; after that they have been stopped [s].
LONGEST = 1.0


class Arms:
    """Both arms, and two operators who follow the task as far as they are let.

    They do what they are told as real ones do: as of the moment it comes, and no
    faster than they can.

    Attributes:
        q: Where they are, shape (n,) [rad].
        v: Their velocities, shape (n,) [rad/s].
        worked: How far into the task the operators are [s].
    """

    def __init__(self) -> None:
        self._rows: Floats = bay_task(ROWS).for_scene(bay_scene("path"))
        self.q: Floats = self._rows[0].copy()
        self.v: Floats = np.zeros_like(self.q)
        self.worked = 0.0
        self._told: Floats = np.zeros_like(self.q)
        self._at = float("nan")
        self._braked = False

    def measure(self, now: float) -> None:
        """Let them move until now [s]."""
        passed = now - self._at
        self._at = now
        if not 0.0 < passed < LONGEST:
            return
        most = (BRAKES if self._braked else STRENGTH) * passed
        after = self.v + np.clip(self._told - self.v, -most, most)
        self.q += 0.5 * (self.v + after) * passed
        self.v = after
        self.worked += passed

    def wish(self) -> Floats:
        """What the operators want, shape (n,) [rad/s]."""
        at = self.worked / STEP % (len(self._rows) - 1)
        row = int(at)
        before, after = self._rows[row], self._rows[row + 1]
        target = before + (at - row) * (after - before)
        pull = (after - before) / STEP + PULL * (target - self.q)
        wanted: Floats = np.clip(pull, -FASTEST, FASTEST)
        return wanted

    def obey(self, answer: Answer, now: float) -> None:
        """An answer has come [s]."""
        self.measure(now)
        self._braked = answer.action_number >= BRAKE
        self._told = np.zeros_like(self.q) if self._braked else answer.velocity

    def rest(self) -> None:
        """Nobody tells them anything any more: they stop."""
        self.q += 0.5 * self.v * np.abs(self.v) / STRENGTH
        self.v[:] = 0.0
        self._told = np.zeros_like(self.q)
        self._at = float("nan")

    @property
    def resting(self) -> bool:
        """Whether they stand."""
        return not self.v.any()
