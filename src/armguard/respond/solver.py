"""Quadratic program by DAQP: nearest velocity that satisfies every row.

DAQP ignores a NaN, and its tolerance is in the units of each row. So all inputs are
finite and the rows have unit length, and the result is checked against every row and
bound.
"""

import daqp
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Greatest violation of a unit row or a bound by a solution [rad/s].
TOLERANCE = 1e-8

# Tolerance of the solver's own check, in the units of the rows, which have length 1.
PRIMAL_TOLERANCE = 1e-9

# Iterations after which the program counts as unsolved; it usually needs far fewer.
MOST_ITERATIONS = 300


def nearest_velocity(
    target: Floats, low: Floats, high: Floats, rows: Floats, limits: Floats
) -> Floats | None:
    """Velocity nearest to a target that satisfies bounds and rows.

    Args:
        target: Target velocities, shape (n,) [rad/s or m/s].
        low: Lower bounds of the velocities, shape (n,) [rad/s or m/s].
        high: Upper bounds of the velocities, shape (n,) [rad/s or m/s].
        rows: Constraint rows of unit length, shape (k, n).
        limits: Upper bounds of the products of row and velocity, shape (k,).

    Returns:
        The velocity, shape (n,); None if none exists or none was found.
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
    """Whether a velocity is finite and satisfies bounds and rows."""
    return bool(
        (v >= low - TOLERANCE).all()
        and (v <= high + TOLERANCE).all()
        and (rows @ v <= limits + TOLERANCE).all()
    )
