"""Robots that do as they are ordered, late and not quite, within their figures."""

import numpy as np

from armguard.respond.command import Action
from arrays import Floats
from closed_loop import plant as plants
from closed_loop.measuring import Measuring
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Styles, Truth, pick
from reach.arena import Arena
from reach.scenes import PERIOD

# Substeps of a cycle.
STEPS = round(PERIOD / SUBSTEP)

# How the figures of a trial are drawn: operators mean no harm, and nothing conspires.
TIMES = {"most": 0.4, "random": 0.5, "least": 0.1}
STOPS = {"least": 0.3, "corner": 0.2, "most": 0.1, "random": 0.4}
ERRORS = {"bias": 0.3, "noise": 0.4, "alternating": 0.1, "none": 0.2}

# Speed from which on a drive misses its velocity by all it may [rad/s or m/s].
MISSES = 0.1

# How often that changes its sign, least and most [1/s].
WAVES = (0.3, 3.0)


class Drives:
    """The robots of a trial, and what is measured of them.

    Each follows commands by a delay of its own, as fast as its acceleration lets it,
    and misses them by up to the error of tracking. A stop that is ordered is carried
    out as declared; until it rests the robot hears nothing else.

    Attributes:
        plant: Their true state.
        truth: Their true figures.
        tick: Substeps done.
        q_rows: True positions after each substep, shape (k + 1, n).
        v_rows: True velocities, the same.

    Args:
        arena: Where.
        rng: Of the trial.
        q: Where they are at first, shape (n,).
        cycles: How many there will be at most.
    """

    def __init__(
        self, arena: Arena, rng: np.random.Generator, q: Floats, cycles: int
    ) -> None:
        styles = Styles(pick(rng, TIMES), pick(rng, STOPS), pick(rng, ERRORS), True)
        self._arena = arena
        self.truth = truth = Truth(rng, arena.figures, styles)
        self.plant = plants.plant_at(
            q, arena.first, truth.velocity, truth.acceleration, truth.brake
        )
        n, robots = len(q), len(arena.robots)
        ticks = cycles * STEPS
        self.tick = 0
        self.q_rows = np.tile(q, (ticks + 1, 1))
        self.v_rows = np.zeros_like(self.q_rows)
        self._free = np.zeros((ticks + 1, robots), dtype=bool)
        self._measuring = Measuring(truth, arena.first, self.q_rows, self.v_rows)
        late = [truth.command_delay(r) for r in range(robots)]
        self._late = [int(t / SUBSTEP + 1e-9) for t in late]
        self._told = np.zeros((cycles + 1, n))
        self._nowhere = np.zeros(n)
        self._error = 0.9 * np.concatenate([f.tracking_error for f in arena.figures])
        self._waves = 2.0 * np.pi * rng.uniform(*WAVES, n)
        self._phases = rng.uniform(0.0, 2.0 * np.pi, n)

    @property
    def now(self) -> float:
        """Time [s]."""
        return self.tick * SUBSTEP

    def measure(self) -> tuple[Floats, Floats, dict[str, float]]:
        """What arrives: positions, velocities, and the stamp of each robot."""
        cycle = self.tick // STEPS
        q, v, stamps = self._measuring.measure(self.tick, cycle, self._nowhere)
        return q, v, dict(zip(self._arena.robots, stamps, strict=True))

    def obey(self, velocity: Floats, actions: dict[str, Action]) -> list[str]:
        """Take the orders of a cycle; robots for which a stop is new."""
        stopped = []
        plant = self.plant
        self._told[self.tick // STEPS] = velocity
        for r, name in enumerate(self._arena.robots):
            if actions[name] >= Action.STOP:
                if plant.phase[r] == plants.FREE and plant.stop_at[r] == np.inf:
                    stopped.append(name)
                    at = self.now + self._late[r] * SUBSTEP
                    plants.order_stop(plant, r, at, self.truth.stop(self._nowhere))
            else:
                plants.release(plant, r)
            if actions[name] >= Action.BRAKE:
                delay = self.truth.brake_delay(r)
                plants.order_brake(plant, r, self.now + delay)
        return stopped

    def move(self) -> slice:
        """Let a cycle pass; the rows of its states."""
        first = self.tick + 1
        for _ in range(STEPS):
            row = slice(self.tick + 1, self.tick + 2)
            plants.advance(
                self.plant,
                self.tick,
                SUBSTEP,
                self._driven(),
                self.q_rows[row],
                self.v_rows[row],
                self._free[row],
            )
            self.tick += 1
        return slice(first, self.tick + 1)

    def _driven(self) -> Floats:
        """Velocities the drives go for in this substep, shape (n,)."""
        arena = self._arena
        v = np.zeros(len(self._nowhere))
        for r, late in enumerate(self._late):
            own = slice(int(arena.first[r]), int(arena.first[r + 1]))
            k = (self.tick - late) // STEPS
            if k >= 0:
                v[own] = self._told[k, own]
        wave = np.sin(self._waves * self.now + self._phases)
        return v + self._error * wave * np.minimum(np.abs(v) / MISSES, 1.0)
