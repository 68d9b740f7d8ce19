"""What the guard is given: old, and a little wrong, within the declared figures."""

from collections.abc import Sequence

import numba
import numpy as np

from arrays import Floats, Ints
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Truth

# Errors that go unnoticed change from nothing to the largest in a quarter second [1/s].
DRIFT = 4.0


@numba.njit(cache=True)
def measured(
    tick,
    ages,
    at,
    q_rows,
    v_rows,
    first,
    shares,
    worst,
    outward,
    drift,
    drifted,
    q,
    v,
):
    """True states of the past with errors.

    Args:
        tick: Substep of the cycle.
        ages: How many substeps ago each arm was measured, shape (a,).
        at: Substep of each arm's last measurement, shape (a,); of this one from then
            on: measurements of an arm arrive in their order.
        q_rows: True positions at every substep, shape (k, n).
        v_rows: True velocities, the same.
        first: First joint of each arm, and n, shape (a + 1,).
        shares: Errors in shares of the largest, shape (n,).
        worst: Largest errors of positions and of velocities, shape (2, n).
        outward: Errors go this way where it is not zero, shape (n,).
        drift: How far position errors may go at once, in shares of the largest, and
            standing joints seem to stand; < 0 for no bound.
        drifted: Where such errors are, shape (n,), written in place.
        q: Measured positions, shape (n,), overwritten.
        v: Measured velocities, shape (n,), overwritten.
    """
    for arm in range(len(at)):
        before = at[arm]
        at[arm] = max(tick - ages[arm], before)
        if at[arm] == before and tick > 0:
            # The same measurement as before.
            continue
        for j in range(first[arm], first[arm + 1]):
            share = shares[j]
            if outward[j] != 0.0:
                share = 1.0 if outward[j] > 0.0 else -1.0
            speed = v_rows[at[arm], j]
            wrong = share * worst[1, j]
            if drift >= 0.0:
                drifted[j] += min(max(share - drifted[j], -drift), drift)
                share = drifted[j]
                wrong = min(max(wrong, -abs(speed)), abs(speed))
            q[j] = q_rows[at[arm], j] + share * worst[0, j]
            v[j] = speed + wrong


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
        n = len(truth.velocity)
        self._signs = truth.rng.choice([-1.0, 1.0], n)
        self._worst = np.stack([truth.position_error, truth.velocity_error])
        self._nowhere, self._drifted = np.zeros(n), np.zeros(n)
        self._quiet = truth.styles.errors == "quiet"
        self._tick = 0
        # No more cycles than substeps.
        ages = [truth.delays(f.sensing, len(q_rows)) for f in truth.figures]
        self._ages: Ints = (np.stack(ages, axis=1) / SUBSTEP + 1e-9).astype(np.int64)
        self._at = np.zeros(len(first) - 1, dtype=np.int64)
        self._q, self._v = np.zeros(n), np.zeros(n)

    def measure(
        self, tick: int, cycle: int, outward: Floats
    ) -> tuple[Floats, Floats, Sequence[float]]:
        """What arrives for a cycle.

        Args:
            tick: Substep of the cycle.
            cycle: Its number.
            outward: Gradient of the least distance, shape (n,).

        Returns:
            Positions and velocities, each shape (n,), overwritten by the next call,
            and the stamp of each arm [s].
        """
        truth, drift = self._truth, -1.0
        if self._quiet:
            drift = DRIFT * (tick - self._tick) * SUBSTEP
            self._tick = tick
        measured(
            tick,
            self._ages[cycle],
            self._at,
            self._q_rows,
            self._v_rows,
            self._first,
            truth.errors(cycle, self._signs),
            self._worst,
            outward if truth.follows else self._nowhere,
            drift,
            self._drifted,
            self._q,
            self._v,
        )
        return self._q, self._v, [at * SUBSTEP for at in self._at.tolist()]
