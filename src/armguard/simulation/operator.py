"""An operator who drives as the tele-driver says, and knows what to do after a stop."""

from collections import deque
from collections.abc import Mapping
from copy import copy
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from armguard.prove.tube import Tube
from armguard.respond.command import Blocked
from armguard.scene.tables import SceneTables
from armguard.simulation.tele import TeleDriver

Floats = NDArray[np.float64]

# Time without desired motion from the stop of an arm to its engagement [s].
WAIT = 0.6

# Duration of the retreat that follows, age of the configuration it leads to [s], and
# its share of the top speeds [-].
BACK, BEFORE, BACK_PACE = 0.8, 1.6, 0.25

# A stop so soon after the arm went on belongs to the last one [s].
LET_BE = 1.0

# Time between two configurations that are kept [s].
GLANCE = 0.2

# A motion is followed in proportion to what a joint is off its place [1/s]; its clock
# is slowed from the one distance on, and waits from the other on [rad or m].
KEEPS, OFF, LOST = 5.0, 0.1, 0.3

# Time on one leg without getting away from a near body, before the next leg [s].
TRY = 1.5


class Hands(Protocol):
    """Source of desired motion, see `Operator.drive`."""

    engages: bool
    """Whether robots are engaged that the service stopped."""

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """Desired velocities, and robots that are engaged."""


class Operator:
    """Drives all arms; one that was stopped is released, engaged, and led back.

    Attributes:
        driver: Source of the motion between stops.
        engages: Whether stopped arms are engaged.

    Args:
        driver: Source of the motion between stops.
    """

    def __init__(self, driver: TeleDriver) -> None:
        self.driver = driver
        self.engages = True
        self._hands = [Hand(driver, r) for r in range(len(driver.robots))]

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """Desired velocities, and arms that are engaged now.

        Args:
            t: Time [s].
            q: Positions, shape (n,) [rad or m].
            blocked: What keeps each arm from following, as the service reports it.

        Returns:
            Velocities, shape (n,) [rad/s or m/s], and names of robots.
        """
        driver = self.driver
        engages = [
            name
            for name, hand in zip(driver.robots, self._hands, strict=True)
            if hand.learns(t, q, blocked.get(name, Blocked.NOT))
        ]
        desired = driver.desired([t + hand.ahead for hand in self._hands], q)
        for hand in self._hands:
            hand.overrule(t, q, desired)
        return desired, engages


class Hand:
    """The operator's hand on one arm.

    Attributes:
        ahead: How far the driver's time of this arm is ahead [s].
    """

    def __init__(self, driver: TeleDriver, r: int) -> None:
        self.ahead = 0.0
        self._driver, self._r, self._own = driver, r, driver.own(r)
        self._off_until = self._back_until = self._free_at = -np.inf
        self._stopped, self._tries = False, 0
        self._near_since = np.nan
        self._past: deque[tuple[float, Floats]] = deque(maxlen=int(BEFORE / GLANCE))

    def learns(self, t: float, q: Floats, why: Blocked) -> bool:
        """Take in what the arm does; whether it is engaged now."""
        stopped, self._stopped = self._stopped, why is Blocked.STOPPED
        if self._stopped:
            if not stopped:
                self._tries = self._tries + 1 if t < self._free_at else 0
                self._let_go(t)
            elif t >= self._off_until:
                self._let_go(t)
                return True
        elif why in (Blocked.TOO_NEAR, Blocked.PINCHED):
            self._try_elsewhere(t)
        else:
            self._near_since = np.nan
            if t >= self._back_until:
                self._remember(t, q)
        return False

    def overrule(self, t: float, q: Floats, desired: Floats) -> None:
        """Do something else than the driver says, where there is need."""
        if t < self._off_until:
            desired[self._own] = 0.0
        elif t < self._back_until and self._past:
            target = self._past[0][1]
            desired[self._own] = self._driver.towards(
                self._r, target, q[self._own], BACK_PACE
            )

    def _let_go(self, t: float) -> None:
        """Release the arm, then back off, then begin the next leg.

        Where that ended in another stop, the other arms go first, and every other time
        the arm does not go back on its path.
        """
        patience = self._tries % 3 * self._r
        self._off_until = t + WAIT + patience * BACK
        self._back_until = self._off_until + (BACK if self._tries % 2 == 0 else 0.0)
        self._free_at = self._back_until + LET_BE
        rest = self._back_until - t
        self.ahead = self._driver.next_leg(t + self.ahead) - t - rest

    def _try_elsewhere(self, t: float) -> None:
        """Begin another leg if this one has not led away from a near body."""
        if np.isnan(self._near_since):
            self._near_since = t
        elif t - self._near_since >= TRY:
            self._near_since = t
            self.ahead = self._driver.next_leg(t + self.ahead) - t

    def _remember(self, t: float, q: Floats) -> None:
        """Keep where the arm was."""
        if not self._past or t - self._past[-1][0] >= GLANCE:
            self._past.append((t, q[self._own].copy()))


class MotionOperator:
    """Follows a motion; its clock is slowed while an arm is off its place.

    After a stop nothing is desired of the arm for a while; then it is engaged.

    Attributes:
        engages: Whether stopped arms are engaged.
        at: How far the motion is [s].

    Args:
        tube: The motion.
        tables: The scene.
    """

    def __init__(self, tube: Tube, tables: SceneTables) -> None:
        self.engages = True
        self.at = float(tube.times[0])
        self._tube, self._end = tube, float(tube.times[-1])
        self._now = np.nan
        self._own = {
            part.name: slice(part.first_joint, part.first_joint + part.joint_count)
            for part in tables.robots
        }
        self._stopped: dict[str, float] = {}

    def __deepcopy__(self, _: dict[int, object]) -> Self:
        """An operator of the same motion that goes on from here by itself."""
        other = copy(self)
        other._stopped = dict(self._stopped)
        return other

    @property
    def done(self) -> float:
        """Share of the motion that is done [-]."""
        start = float(self._tube.times[0])
        return (self.at - start) / (self._end - start)

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """See `Operator.drive`."""
        passed = 0.0 if np.isnan(self._now) else t - self._now
        self._now = t
        for name in self._own:
            if blocked.get(name) is Blocked.STOPPED:
                self._stopped.setdefault(name, t)
        off = float(np.abs(self._place() - q).max(initial=0.0))
        rate = min(max((LOST - off) / (LOST - OFF), 0.0), 1.0)
        if self._stopped or self.at >= self._end:
            rate = 0.0
        self.at = min(self.at + rate * passed, self._end)
        along = self._tube.velocities(np.array([self.at]))[0]
        desired: Floats = rate * along + KEEPS * (self._place() - q)
        engages = []
        for name, since in [*self._stopped.items()]:
            desired[self._own[name]] = 0.0
            if t - since >= WAIT:
                del self._stopped[name]
                if blocked.get(name) is Blocked.STOPPED:
                    engages.append(name)
        return desired, engages

    def _place(self) -> Floats:
        """Where the motion is, shape (n,) [rad or m]."""
        found: Floats = self._tube.at(np.array([self.at]))[0]
        return found
