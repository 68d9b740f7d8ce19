"""Arms in time: the plant, its true states, what is measured of them, and orders."""

import numpy as np

from arrays import Floats
from closed_loop import plant as plants
from closed_loop.measuring import Measuring
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Truth
from episodes.follower import Arms

Stamps = dict[str, float]


class Drives:
    """All arms of an arena, from a start at rest on.

    Attributes:
        arena: What is declared of them.
        truth: Their true figures.
        plant: Their true state.
        tick: Substeps done.
        q_rows: True positions after each substep, shape (k + 1, n) [rad or m].
        v_rows: True velocities, the same [rad/s or m/s].
        free_rows: Whether each arm is its operator's then, shape (k + 1, a).

    Args:
        arena: What is declared of them.
        truth: Their true figures.
        q: Where they are at first, shape (n,) [rad or m].
        ticks: How many substeps there are at most.
    """

    def __init__(self, arena: Arms, truth: Truth, q: Floats, ticks: int) -> None:
        self.arena, self.truth, self.tick = arena, truth, 0
        self.plant = plants.plant_at(
            q, arena.first, truth.velocity, truth.acceleration, truth.brake
        )
        self.q_rows = np.tile(q, (ticks + 1, 1))
        self.v_rows = np.zeros_like(self.q_rows)
        self.free_rows = np.zeros((ticks + 1, len(arena.robots)), dtype=bool)
        self._measuring = Measuring(truth, arena.first, self.q_rows, self.v_rows)

    @property
    def now(self) -> float:
        """Time [s]."""
        return self.tick * SUBSTEP

    def measured(self, cycle: int, outward: Floats) -> tuple[Floats, Floats, Stamps]:
        """What arrives for a cycle: positions, velocities, and the stamp of each arm.

        Args:
            cycle: Its number.
            outward: See `Measuring.measure`.
        """
        q, v, stamps = self._measuring.measure(self.tick, cycle, outward)
        return q, v, dict(zip(self.arena.robots, stamps, strict=True))

    def order_stop(self, arm: int, closing: Floats) -> bool:
        """Order a stop unless one is ordered or under way; whether it is a new one.

        Args:
            arm: Number of the arm.
            closing: See `Truth.stop`.
        """
        plant = self.plant
        if plant.phase[arm] != plants.FREE or plant.stop_at[arm] < np.inf:
            return False
        stop = self.truth.stop(closing)
        plants.order_stop(plant, arm, self.now + self.command_delay(arm), stop)
        return True

    def order_brake(self, arm: int) -> None:
        """Order the brake of an arm."""
        plants.order_brake(self.plant, arm, self.now + self.truth.brake_delay(arm))

    def command_delay(self, arm: int) -> float:
        """Time until an arm's drives obey an order [s]."""
        return self.truth.command_delay(arm)

    def advance(self, tick: int, target: int, desired: Floats) -> tuple[Floats, Floats]:
        """Move the arms from one substep to a later one; their states after each.

        Args:
            tick: The one.
            target: The later one.
            desired: Desired velocities, shape (n,).
        """
        rows = slice(tick + 1, target + 1)
        q_rows, v_rows, free_rows = (
            states[rows] for states in (self.q_rows, self.v_rows, self.free_rows)
        )
        plants.advance(self.plant, tick, SUBSTEP, desired, q_rows, v_rows, free_rows)
        return q_rows, v_rows
