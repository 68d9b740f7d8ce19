"""What the guard is given: old, and a little wrong, within the declared figures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from closed_loop.settings import SUBSTEP
from closed_loop.truth import Truth

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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
        errors = truth.errors(cycle, outward, self._signs)
        q += errors * truth.position_error
        v += errors * truth.velocity_error
        return q, v, stamps
