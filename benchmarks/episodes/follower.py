"""Arms that follow the commands of a guard late and inexactly.

Their figures are those the scene declares, and they are used up: commands take effect
after up to `command`, measurements are up to `sensing` old and off by up to
`position_error`, velocities miss commands by up to `tracking_error` and change no
faster than by `acceleration`. What a joint misses by stays the same for a while, so
that errors do not average out. Nothing swings.
"""

from collections import deque

import numpy as np

from armguard.respond import Action, Command, Guard
from armguard.scene import SceneTables
from arrays import Bools, Floats, Ints
from closed_loop.truth import joined

# Longest time for which a joint misses its commands by the same [s].
SAME_ERROR = 0.3


class Arms:
    """The arms of a scene, and what is declared of them.

    Attributes:
        tables: The scene's tables.
        robots: Their names.
        figures: Declared figures of each arm, by name.
        own: Places of each arm's joints in q, by name.
        first: First joint of each arm, and n, shape (a + 1,).
        lower: Least joint positions, joints without end within one turn, shape (n,).
        upper: Greatest, shape (n,).
    """

    def __init__(self, tables: SceneTables) -> None:
        self.tables, parts = tables, tables.robots
        self.robots = tuple(part.name for part in parts)
        self.figures = {p.name: p.stopping for p in parts if p.stopping is not None}
        ends = {p.name: (p.first_joint, p.first_joint + p.joint_count) for p in parts}
        self.own = {name: slice(*end) for name, end in ends.items()}
        stops = [own.stop for own in self.own.values()]
        self.first: Ints = np.array([0, *stops], dtype=np.int64)
        self.lower = np.maximum(tables.lower, -np.pi)
        self.upper = np.minimum(tables.upper, np.pi)

    def joined(self, figure: str) -> Floats:
        """A figure of all joints, shape (n,)."""
        return joined(self.figures.values(), figure)


class Follower(Arms):
    """All arms of a guard, see also `Arms`.

    Attributes:
        guard: The guard.
        q: True positions, shape (n,) [rad or m].
        v: True velocities, shape (n,) [rad/s or m/s].
        measured: Positions as measured last, shape (n,) [rad or m].
        cycles: Number of cycles.
        period: Time from one cycle to the next [s].

    Args:
        guard: The guard.
        q: Where they begin, shape (n,) [rad or m].
        rng: Draws delays and errors.
    """

    # Substeps of a cycle: delays and ages are multiples of one.
    substeps = 1

    def __init__(self, guard: Guard, q: Floats, rng: np.random.Generator) -> None:
        super().__init__(guard.tables)
        self.guard, self.rng = guard, rng
        self.period = guard.tables.period
        self.substep = self.period / self.substeps
        self.q, self.v, self.measured = q.copy(), np.zeros_like(q), q.copy()
        self.cycles = 0
        figures = self.figures.values()
        names = ("position_error", "velocity_error", "tracking_error", "acceleration")
        self._most = {name: self.joined(name) for name in names}
        late = min(f.command for f in figures) / self.substep + 1e-9
        aged = min(f.sensing for f in figures) / self.substep + 1e-9
        delay = int(rng.integers(int(late) + 1))
        self._age = int(rng.integers(int(aged) + 1))
        still = np.zeros_like(q), np.ones(len(q), dtype=np.bool_)
        self._sent = deque([still] * delay)
        self._past = deque([(self.q, self.v)] * (self._age + 1))
        self._error, self._until = np.zeros_like(q), 0

    @property
    def time(self) -> float:
        """Time [s]."""
        return self.cycles * self.period

    def clock(self, time: float) -> float:
        """What the guard's clock shows at a time: its first measurement is at 0 [s]."""
        return time + self._age * self.substep

    def drive(self, desired: Floats) -> Command:
        """One cycle with desired velocities of all joints, shape (n,)."""
        q, v = self._past[0]
        self.measured = q + self.noise("position_error")
        stamp, now = self.time, self.clock(self.time)
        command = self.guard.filter(
            self.measured, desired, stamp, velocity=self.measured_speeds(v), now=now
        )
        self.note(command)
        may_draw = self.may_draw(command)
        if may_draw and self.cycles >= self._until:
            self.draw_error()
        drifts = np.ones(len(q), dtype=np.bool_)
        for name, action in command.actions.items():
            own = self.own[name]
            # A joint that is stopped does not drift.
            drifts[own] = (command.velocity[own] != 0.0) | (action < Action.STOP)
        for _ in range(self.substeps):
            self._sent.append((command.velocity, drifts))
            self.move(*self._sent.popleft())
            self._past.append((self.q, self.v))
            self._past.popleft()
        self.cycles += 1
        return command

    def noise(self, figure: str) -> Floats:
        """Random errors within a declared figure, shape (n,)."""
        most = self._most[figure]
        return self.rng.uniform(-most, most)

    def measured_speeds(self, v: Floats) -> Floats:
        """Velocities as measured, shape (n,)."""
        return v

    def note(self, command: Command) -> None:
        """Note what is new about a command."""

    def may_draw(self, command: Command) -> bool:
        """Whether other errors may be drawn."""
        return True

    def draw_error(self) -> None:
        """Draw by what velocities miss commands from now on, and for how long."""
        error = self.noise("tracking_error")
        if self.rng.random() < 0.5:
            error = self._most["tracking_error"] * np.sign(error)
        self._error = self.kept_error(error)
        longest = int(SAME_ERROR / self.period)
        self._until = self.cycles + int(self.rng.integers(1, longest))

    def kept_error(self, error: Floats) -> Floats:
        """The errors of joints after they were drawn, shape (n,)."""
        return error

    def move(self, velocity: Floats, drifts: Bools) -> None:
        """Move the joints on by a substep."""
        most = self._most["acceleration"] * self.substep
        change = velocity + drifts * self._error - self.v
        self.v = self.v + np.clip(change, -most, most)
        self.q = self.q + self.v * self.substep
