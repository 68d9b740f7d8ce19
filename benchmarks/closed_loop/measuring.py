"""What the guard is given: old, and a little wrong, within the declared figures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from closed_loop.settings import SUBSTEP
from closed_loop.truth import Truth

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Errors that go unnoticed change from nothing to the largest in a quarter second [1/s].
DRIFT = 4.0


class Measuring:
    """Measurements of all arms.

    Args:
        truth: True figures of the episode.
        first: First joint of each arm, and n, shape (a + 1,).
        q_rows: True positions at every substep so far and to come, (k, n); read only.
        v_rows: True velocities, the same.
    """

    def __init__(
        self, truth: Truth, first: Ints, q_rows: Floats, v_rows: Floats
    ) -> None:
        self._truth = truth
        self._first = first
        self._q_rows, self._v_rows = q_rows, v_rows
        self._signs = truth.rng.choice([-1.0, 1.0], len(truth.velocity))
        self._shares = np.zeros_like(self._signs)
        self._tick = 0
        self._last = [0] * (len(first) - 1)

    def measure(
        self, tick: int, cycle: int, outward: Floats
    ) -> tuple[Floats, Floats, Sequence[float]]:
        """What arrives for a cycle.

        Args:
            tick: Substep of the cycle.
            cycle: Its number.
            outward: Gradient of the least distance, shape (n,).

        Returns:
            Positions and velocities, each shape (n,), and the stamp of each arm [s].
        """
        truth = self._truth
        q, v = np.empty_like(self._signs), np.empty_like(self._signs)
        stamps = []
        for arm, figures in enumerate(truth.figures):
            age = int(truth.delay(figures.sensing) / SUBSTEP + 1e-9)
            # Measurements of one arm arrive in their order.
            at = max(tick - age, self._last[arm])
            self._last[arm] = at
            own = slice(self._first[arm], self._first[arm + 1])
            q[own], v[own] = self._q_rows[at, own], self._v_rows[at, own]
            stamps.append(at * SUBSTEP)
        shares = truth.errors(cycle, outward, self._signs)
        wrong = shares * truth.velocity_error
        if truth.styles.errors == "quiet":
            self._drift(shares, tick)
            shares, wrong = self._shares, np.clip(wrong, -np.abs(v), np.abs(v))
        return q + shares * truth.position_error, v + wrong, stamps

    def _drift(self, shares: Floats, tick: int) -> None:
        """Let the position errors drift towards others, too slowly to be noticed."""
        way = DRIFT * (tick - self._tick) * SUBSTEP
        self._tick = tick
        self._shares = self._shares + np.clip(shares - self._shares, -way, way)
