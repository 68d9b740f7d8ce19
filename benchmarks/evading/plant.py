"""Arms that are late, are measured late, and miss what they are told.

Their figures are those the scene declares, and they are used up: commands take effect
after up to `command`, measurements are up to `sensing` old and off by up to
`position_error`, velocities miss what was told by up to `tracking_error` and change no
faster than by `acceleration`. What a joint misses by stays the same for a while, so
that errors do not average out. Nothing swings.
"""

from collections import deque

import numpy as np

from armguard.guard import Level
from armguard.respond import Action, Blocked, Command, Guard
from arrays import Bools, Floats
from evading.places import PERIOD, Place

# Grid of all instants: delays and ages are multiples of it [s].
SUBSTEP = 0.001

# Longest time for which a joint misses its commands by the same [s].
SAME_ERROR = 0.3


class Plant:
    """Arms that are told by a guard what their operators want.

    Attributes:
        q: True positions, shape (n,) [rad or m].
        v: True velocities, shape (n,) [rad/s or m/s].
        time: Time [s].
        stops: Time, arm and named reason of all stops, in order.
        began: When each arm was first told to get out of the way [s], and its true
            state then; only of those that were.
        cycle_times: How long each cycle took [s].

    Args:
        guard: The guard.
        place: Where the arms are, and their figures.
        q: Where they begin, shape (n,) [rad or m].
        rng: Draws delays and errors.
    """

    def __init__(
        self, guard: Guard, place: Place, q: Floats, rng: np.random.Generator
    ) -> None:
        self.guard, self.place, self.rng = guard, place, rng
        self.q, self.v = q.copy(), np.zeros_like(q)
        self.cycles = 0
        self.stops: list[tuple[float, str, str]] = []
        self.began: dict[str, tuple[float, Floats, Floats]] = {}
        self.cycle_times: list[float] = []
        self._actions = dict.fromkeys(place.robots, Action.FOLLOW)
        self._brake_at = dict.fromkeys(place.robots, np.inf)
        self._most = {
            name: place.joined(name)
            for name in ("position_error", "tracking_error", "velocity_error")
        }
        self._acceleration = place.joined("acceleration")
        late = min(figures.command for figures in place.figures.values())
        aged = min(figures.sensing for figures in place.figures.values())
        delay = int(rng.integers(int(late / SUBSTEP + 1e-9) + 1))
        age = int(rng.integers(int(aged / SUBSTEP + 1e-9) + 1))
        self._age = age * SUBSTEP
        self._told = deque(
            [(np.zeros_like(q), np.ones(len(q), dtype=np.bool_))] * delay
        )
        self._past = deque([(self.q, self.v)] * (age + 1))
        self._error, self._until = np.zeros_like(q), 0

    @property
    def time(self) -> float:
        """Time [s]."""
        return self.cycles * PERIOD

    def clock(self, time: float) -> float:
        """What the guard's clock shows at a time: its first measurement is at 0 [s]."""
        return time + self._age

    def cycle(self, wish: Floats) -> Command:
        """One cycle in which velocities are asked for, shape (n,) [rad/s or m/s]."""
        q, v = self._past[0]
        rng, most = self.rng, self._most
        off = most["position_error"]
        measured = q + rng.uniform(-off, off)
        off = most["velocity_error"]
        speeds = v + rng.uniform(-off, off)
        stamp, now = self.time, self.clock(self.time)
        command = self.guard.filter(measured, wish, stamp, velocity=speeds, now=now)
        self._note(command)
        if self.cycles >= self._until:
            self._draw_error()
        drives = np.ones(len(q), dtype=np.bool_)
        for name, action in command.actions.items():
            own = self.place.own[name]
            # A joint that is stopped does not drift.
            drives[own] = (command.velocity[own] != 0.0) | (action < Action.STOP)
        for _ in range(round(PERIOD / SUBSTEP)):
            self._told.append((command.velocity, drives))
            self._move(*self._told.popleft())
        self.cycles += 1
        return command

    def _move(self, told: Floats, drives: Bools) -> None:
        """Move the joints on by a substep."""
        aim = told + drives * self._error
        most = self._acceleration * SUBSTEP
        for name, at in self._brake_at.items():
            if self.time >= at:
                own = self.place.own[name]
                aim[own] = 0.0
                most = most.copy()
                most[own] = self.place.figures[name].brake_deceleration * SUBSTEP
        before = self.v
        self.v = before + np.clip(aim - before, -most, most)
        self.q = self.q + 0.5 * (before + self.v) * SUBSTEP
        self._past.append((self.q, self.v))
        self._past.popleft()

    def _draw_error(self) -> None:
        """Draw what velocities miss what is told by from now on, and for how long."""
        most = self._most["tracking_error"]
        error = self.rng.uniform(-most, most)
        if self.rng.random() < 0.5:
            error = most * np.sign(error)
        for name, action in self._actions.items():
            # A stop is as declared: it is not sped up again.
            if action >= Action.STOP:
                own = self.place.own[name]
                error[own] = self._error[own]
        self._error = error
        longest = int(SAME_ERROR / PERIOD)
        self._until = self.cycles + int(self.rng.integers(1, longest))

    def _note(self, command: Command) -> None:
        """Remember stops when they begin, and engage who was stopped and may go on."""
        verdict, blocked = command.verdict, command.blocked
        self.cycle_times.append(verdict.cycle_time)
        for name, action in command.actions.items():
            if blocked[name] is Blocked.EVADING:
                self.began.setdefault(name, (self.time, self.q, self.v))
            before, self._actions[name] = self._actions[name], action
            if action >= Action.BRAKE and self._brake_at[name] == np.inf:
                delay = self.place.figures[name].brake_delay
                self._brake_at[name] = self.time + delay
            elif action < Action.BRAKE:
                self._brake_at[name] = np.inf
            if action > before and verdict.levels[name] >= Level.STOP:
                self.stops.append((self.time, name, verdict.reason.name))
            if blocked[name] is Blocked.STOPPED and action is Action.HOLD:
                self.guard.engage(name)
