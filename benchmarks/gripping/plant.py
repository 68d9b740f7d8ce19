"""A gantry that is late, is measured late, and misses what it is told.

Its figures are those the scene declares, and it uses them up: commands take effect
after up to `command`, measurements are up to `sensing` old and off by up to
`position_error`, velocities miss what was told by up to `tracking_error`, and change no
faster than by `acceleration`. What it misses by stays the same for a while, so that
errors do not average out.
"""

from collections import deque

import numpy as np

from armguard.respond import Action, Command, Guard
from arrays import Floats
from gripping.workplace import STOPPING

# Longest time for which a joint misses its commands by the same [s].
SAME_ERROR = 0.3


class Plant:
    """A robot that is told by a guard what its operator wants.

    Attributes:
        q: True positions, shape (n,) [m].
        v: True velocities, shape (n,) [m/s].
        measured: Positions as measured last, shape (n,) [m].
        rows: True positions after each cycle [m].
        stops: Named reasons of all stops, in order.
        command: The last command; None before the first cycle.
        stopped_for: Time for which the robot is being stopped [s].

    Args:
        guard: The guard.
        rng: Draws delays and errors.
    """

    # Joints of the fingers, the last ones.
    fingers = slice(3, 5)

    def __init__(self, guard: Guard, rng: np.random.Generator) -> None:
        self.guard = guard
        self.rng = rng
        self.period = guard.tables.period
        self.q = guard.home
        self.v = np.zeros_like(self.q)
        self.measured = self.q.copy()
        self.rows: list[Floats] = []
        self.stops: list[str] = []
        self.command: Command | None = None
        self.stopped_for = 0.0
        self._action = Action.FOLLOW
        self._grips = False
        late = int(STOPPING["command"] / self.period + 1e-9)
        aged = int(STOPPING["sensing"] / self.period + 1e-9)
        delay, self._age = int(rng.integers(late + 1)), int(rng.integers(aged + 1))
        self._told = deque([(np.zeros_like(self.q), Action.FOLLOW)] * delay)
        self._past = deque([(self.q, self.v)] * (self._age + 1))
        self._error, self._until = np.zeros_like(self.q), 0

    @property
    def time(self) -> float:
        """Time [s]."""
        return (len(self.rows) + self._age) * self.period

    @property
    def seen(self) -> Floats:
        """Where hand and fingers are as measured last: x, y, z, left, right [m]."""
        return self.measured

    def cycle(self, wish: Floats) -> Command:
        """One cycle in which velocities of hand and fingers are asked for [m/s]."""
        return self.drive(wish)

    def drive(self, wish: Floats) -> Command:
        """One cycle in which velocities of all joints are asked for."""
        now = self.time
        self._past.append((self.q, self.v))
        self._past.popleft()
        q, v = self._past[0]
        most = STOPPING["position_error"]
        self.measured = q + self.rng.uniform(-most, most, len(q))
        stamp = len(self.rows) * self.period
        command = self.guard.filter(self.measured, wish, stamp, velocity=v, now=now)
        action = command.action
        self.stopped_for += self.period if action >= Action.STOP else -self.stopped_for
        self._note(command, action)
        self._told.append((command.velocity, action))
        told, takes_effect = self._told.popleft()
        # A stop is as declared: it is not sped up again.
        if len(self.rows) >= self._until and takes_effect < Action.STOP:
            self._draw_error()
        # A joint that is stopped does not drift.
        drifts = (told != 0.0) | (takes_effect < Action.STOP)
        change = told + drifts * self._error - self.v
        most = STOPPING["acceleration"] * self.period
        self.v = self.v + np.clip(change, -most, most)
        self.q = self.q + self.v * self.period
        self.rows.append(self.q)
        return command

    def grip(self, *, grips: bool) -> None:
        """From now on the fingers stand still against what they grip, or no more."""
        self._grips = grips
        if grips:
            self._error[self.fingers] = 0.0

    def _draw_error(self) -> None:
        """Draw what velocities miss what is told by from now on, and for how long."""
        most = STOPPING["tracking_error"]
        self._error = self.rng.uniform(-most, most, len(self.q))
        if self.rng.random() < 0.5:
            self._error = most * np.sign(self._error)
        if self._grips:
            self._error[self.fingers] = 0.0
        longest = int(SAME_ERROR / self.period)
        self._until = len(self.rows) + int(self.rng.integers(1, longest))

    def _note(self, command: Command, action: Action) -> None:
        """Remember the reason of a stop when it begins."""
        before, self._action = self._action, action
        self.command = command
        if action > before and action >= Action.STOP:
            verdict = command.verdict
            nearest = verdict.nearest
            pair = "" if nearest is None else f": {nearest.a}, {nearest.b}"
            self.stops.append(f"{verdict.reason.name}{pair}")
