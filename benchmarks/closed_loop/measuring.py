"""Measurements for the guard: old, and a little wrong, within the declared figures."""

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np

from arrays import Floats, Ints
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Truth

# Errors that go unnoticed change from nothing to the largest in a quarter second [1/s].
DRIFT = 4.0


class Sensors(NamedTuple):
    """True states, and what was measured last.

    Attributes:
        q_rows: True positions at every substep, shape (k, n).
        v_rows: True velocities, the same.
        first: First joint of each arm, and n, shape (a + 1,).
        worst: Largest errors of positions and of velocities, shape (2, n).
        at: Substep of each arm's last measurement, shape (a,).
        drifted: Where errors are that drift, in shares of the largest, shape (n,).
        q: Measured positions, shape (n,).
        v: Measured velocities, shape (n,).
    """

    q_rows: Floats
    v_rows: Floats
    first: Ints
    worst: Floats
    at: Ints
    drifted: Floats
    q: Floats
    v: Floats


@numba.njit(cache=True)
def measured(s, tick, ages, shares, outward, drift):
    """Measure true states of the past with errors.

    Args:
        s: Sensors, written in place. Measurements of an arm arrive in their order.
        tick: Substep of the cycle.
        ages: How many substeps ago each arm was measured, shape (a,).
        shares: Errors in shares of the largest, shape (n,).
        outward: Errors go this way where it is not zero, shape (n,).
        drift: How far position errors may go at once, in shares of the largest, while
            resting joints seem to rest; < 0 for no bound.
    """
    for arm in range(len(s.at)):
        before = s.at[arm]
        s.at[arm] = max(tick - ages[arm], before)
        if s.at[arm] == before and tick > 0:
            # The same measurement as before.
            continue
        for j in range(s.first[arm], s.first[arm + 1]):
            share = shares[j]
            if outward[j] != 0.0:
                share = 1.0 if outward[j] > 0.0 else -1.0
            speed = s.v_rows[s.at[arm], j]
            wrong = share * s.worst[1, j]
            if drift >= 0.0:
                s.drifted[j] += min(max(share - s.drifted[j], -drift), drift)
                share = s.drifted[j]
                wrong = min(max(wrong, -abs(speed)), abs(speed))
            s.q[j] = s.q_rows[s.at[arm], j] + share * s.worst[0, j]
            s.v[j] = speed + wrong


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
        n = len(truth.velocity)
        self._signs = truth.rng.choice([-1.0, 1.0], n)
        worst = np.stack([truth.position_error, truth.velocity_error])
        at = np.zeros(len(first) - 1, dtype=np.int64)
        self._sensors = Sensors(q_rows, v_rows, first, worst, at, *np.zeros((3, n)))
        self._nowhere = np.zeros(n)
        self._quiet = truth.styles.errors == "quiet"
        self._tick = 0
        # No more cycles than substeps.
        ages = [truth.delays(f.sensing, len(q_rows)) for f in truth.figures]
        self._ages: Ints = (np.stack(ages, axis=1) / SUBSTEP + 1e-9).astype(np.int64)

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
        truth, s, drift = self._truth, self._sensors, -1.0
        if self._quiet:
            drift = DRIFT * (tick - self._tick) * SUBSTEP
            self._tick = tick
        shares = truth.errors(cycle, self._signs)
        way = outward if truth.follows else self._nowhere
        measured(s, tick, self._ages[cycle], shares, way, drift)
        return s.q, s.v, [at * SUBSTEP for at in s.at.tolist()]
