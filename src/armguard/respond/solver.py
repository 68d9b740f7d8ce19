"""The nearest velocity that keeps every row, by DAQP.

DAQP takes a NaN for nothing and judges rows in their own units: what goes in is finite
and of unit length, and what comes out is checked against every row and bound.
"""

import daqp
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# What a solution may break a unit row or a bound by [rad/s].
TOLERANCE = 1e-8

# Asked of the solver; its own check is by the rows' units, which are 1 here.
PRIMAL_TOLERANCE = 1e-9

# Iterations after which the program counts as unsolved; it has far fewer.
MOST_ITERATIONS = 300


def nearest_velocity(
    target: Floats, low: Floats, high: Floats, rows: Floats, limits: Floats
) -> Floats | None:
    """The velocity nearest to a target that keeps bounds and rows.

    Args:
        target: What is wanted, shape (n,).
        low: Least velocities, shape (n,).
        high: Greatest velocities, shape (n,).
        rows: Unit rows, shape (k, n).
        limits: What each row times the velocity must not exceed, shape (k,).

    Returns:
        The velocity, shape (n,); None if there is none, or none was found.
    """
    rows = np.ascontiguousarray(rows)
    finite = np.isfinite(target).all() and np.isfinite(rows).all()
    if not (finite and np.isfinite(limits).all()):
        return None
    n, k = len(target), len(limits)
    upper, lower = np.empty(n + k), np.empty(n + k)
    upper[:n], upper[n:] = high, limits
    lower[:n], lower[n:] = low, -np.inf
    found, _, flag, _ = daqp.solve(
        np.eye(n),
        -target,
        rows,
        upper,
        lower,
        primal_tol=PRIMAL_TOLERANCE,
        iter_limit=MOST_ITERATIONS,
    )
    if flag < 1 or not keeps(found, low, high, rows, limits):
        return None
    velocity: Floats = np.clip(found, low, high)
    return velocity


def keeps(v: Floats, low: Floats, high: Floats, rows: Floats, limits: Floats) -> bool:
    """Whether a velocity is finite and keeps bounds and rows."""
    return bool(
        (v >= low - TOLERANCE).all()
        and (v <= high + TOLERANCE).all()
        and (rows @ v <= limits + TOLERANCE).all()
    )
