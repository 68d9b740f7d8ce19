"""The drives of one arm: they follow velocities, stop, brake and hold, as declared."""

from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from armguard.robot.stopping import StoppingFigures

Floats = NDArray[np.float64]


class Phase(Enum):
    """What the drives of an arm do."""

    FOLLOWING = auto()
    """They follow the commanded velocities."""

    STOPPING = auto()
    """A controlled stop, or the brake in its place, is under way."""

    HELD = auto()
    """The arm rests and is held; the first velocity that is not zero lets it go."""


class Drives:
    """All joints of one arm.

    A stop that has begun is carried out to its end, whatever is commanded meanwhile.
    A joint that reaches its end stop rests there until it is driven away from it.

    Attributes:
        q: Positions, shape (n,) [rad or m].
        v: Velocities, shape (n,) [rad/s or m/s].
        phase: What they do.
        braked: Whether the present stop, or the last one, is the brake's.

    Args:
        figures: How they accelerate and stop.
        q: Where the arm is held at the start.
        lower: End stops, shape (n,); -inf for a joint without one [rad or m].
        upper: The same; inf for a joint without one.
    """

    def __init__(
        self, figures: StoppingFigures, q: Floats, lower: Floats, upper: Floats
    ) -> None:
        self.q = np.array(q, dtype=np.float64)
        self._lower, self._upper = lower, upper
        self.v = np.zeros_like(self.q)
        self.phase = Phase.HELD
        self.braked = False
        self._figures = figures
        self._aim = np.zeros_like(self.q)
        self._miss = np.zeros_like(self.q)

    def follow(self, velocity: Floats, miss: Floats) -> None:
        """Take on velocities, all of them missed by something while not zero.

        Args:
            velocity: Commanded velocities, shape (n,) [rad/s or m/s].
            miss: What a joint that is to move misses that by, shape (n,).
        """
        self._aim = velocity + np.where(velocity != 0.0, miss, 0.0)
        if self.phase is Phase.HELD and velocity.any():
            self.phase, self.braked = Phase.FOLLOWING, False

    def stop(self) -> None:
        """Begin a controlled stop, unless one is under way."""
        if self.phase is Phase.FOLLOWING:
            figures = self._figures
            self._begin(self._stop_deceleration(), figures.ramp, figures.settle)

    def brake(self) -> None:
        """Let the brake take the place of whatever is under way."""
        if self.phase is not Phase.HELD and not self.braked:
            nothing = np.zeros_like(self.q)
            self._begin(self._figures.brake_deceleration, 0.0, nothing)
            self.braked = True

    def advance(self, dt: float) -> None:
        """Let time pass [s]."""
        if self.phase is Phase.FOLLOWING:
            self._approach(dt)
        elif self.phase is Phase.STOPPING:
            self._come_to_rest(dt)
        reached = np.clip(self.q, self._lower, self._upper)
        self.v = np.where(self.q == reached, self.v, 0.0)
        self.q = reached

    def _approach(self, dt: float) -> None:
        """Change velocities towards the commanded ones, and keep them."""
        figures = self._figures
        aim = np.clip(self._aim, -figures.velocity, figures.velocity)
        change = aim - self.v
        rate = np.copysign(figures.acceleration, change)
        ramp = np.minimum(change / rate, dt)
        self.q += self.v * ramp + 0.5 * rate * ramp * ramp + aim * (dt - ramp)
        self.v = np.where(ramp < dt, aim, self.v + rate * ramp)

    def _stop_deceleration(self) -> Floats:
        """The least of a controlled stop from the present velocities, shape (n,)."""
        figures = self._figures
        least = figures.deceleration.copy()
        for j, speed in enumerate(np.abs(self.v).tolist()):
            table = figures.table_of(j)
            if table is not None and speed > 0.0:
                time, travel = table.at(speed)
                least[j] = max(speed * speed / (2.0 * travel), speed / time)
        return least

    def _begin(self, deceleration: Floats, ramp: float, settle: Floats) -> None:
        """Begin to come to rest from the present state."""
        figures = self._figures
        self.phase = Phase.STOPPING
        self._since = 0.0
        self._q0, self._v0 = self.q.copy(), self.v.copy()
        self._deceleration, self._ramp = deceleration, ramp
        self._rest = rest_after(np.abs(self.v), deceleration, ramp)
        self._swing = settle * self.v / figures.velocity
        swings = (self._swing != 0.0) & (figures.settle_time > 0.0)
        ends = self._rest + np.where(swings, figures.settle_time, 0.0)
        self._end = float(ends.max(initial=0.0))

    def _come_to_rest(self, dt: float) -> None:
        """Go on with a stop; when all joints rest they are held."""
        self._since += dt
        way, left = way_of_stop(
            self._since, np.abs(self._v0), self._deceleration, self._ramp
        )
        beyond, swinging = swing_out(
            self._since - self._rest, self._swing, self._figures.settle_time
        )
        self.q = self._q0 + np.copysign(way, self._v0) + beyond
        self.v = np.copysign(left, self._v0) + swinging
        if self._since >= self._end:
            self.phase = Phase.HELD
            self.v = np.zeros_like(self.q)


def rest_after(speed: Floats, deceleration: Floats, ramp: float) -> Floats:
    """Time from the beginning of a stop until each joint first rests, (n,) [s].

    Args:
        speed: Speeds at its beginning, shape (n,), >= 0 [rad/s or m/s].
        deceleration: Decelerations, shape (n,) [rad/s² or m/s²].
        ramp: Time in which they rise to that, linearly from 0 [s].
    """
    # A joint that slow rests before its deceleration has risen to the full value.
    slow = speed <= 0.5 * deceleration * ramp
    early = np.sqrt(2.0 * ramp * speed / deceleration)
    times: Floats = np.where(slow, early, 0.5 * ramp + speed / deceleration)
    return times


def way_of_stop(
    time: float, speed: Floats, deceleration: Floats, ramp: float
) -> tuple[Floats, Floats]:
    """How far each joint got since a stop began, and the speed it has left.

    Args:
        time: Time since then [s].
        speed: Speeds at its beginning, shape (n,), >= 0 [rad/s or m/s].
        deceleration: Decelerations, shape (n,) [rad/s² or m/s²].
        ramp: Time in which they rise to that, linearly from 0 [s].

    Returns:
        Ways [rad or m] and speeds [rad/s or m/s], each shape (n,), >= 0.
    """
    t = np.minimum(time, rest_after(speed, deceleration, ramp))
    rising = np.minimum(t, ramp)
    full = t - rising
    jerk = deceleration / ramp if ramp > 0.0 else np.zeros_like(deceleration)
    risen = speed - 0.5 * jerk * rising**2
    way = speed * rising - jerk * rising**3 / 6.0
    way = way + risen * full - 0.5 * deceleration * full**2
    return way, np.maximum(risen - deceleration * full, 0.0)


def swing_out(since: Floats, height: Floats, duration: float) -> tuple[Floats, Floats]:
    """How far beyond its rest each joint is while it settles, and how fast.

    Out and back once, without a jump of the speed.

    Args:
        since: Time since each joint came to rest, shape (n,) [s].
        height: How far out each goes, with its sign, shape (n,) [rad or m].
        duration: Time until it is back [s].
    """
    nothing = np.zeros_like(height)
    if duration <= 0.0:
        return nothing, nothing
    u = np.pi * since / duration
    out = (since > 0.0) & (since < duration)
    way = np.where(out, height * np.sin(u) ** 2, 0.0)
    return way, np.where(out, height * np.pi / duration * np.sin(2.0 * u), 0.0)
