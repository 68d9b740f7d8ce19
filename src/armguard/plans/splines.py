"""Curves that controllers make of waypoints, as Bernstein control points."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError
from armguard.prove.tube import elevated

Floats = NDArray[np.float64]

Interpolation = Literal["linear", "cubic", "quintic"]

# Degree of the curves of each interpolation.
DEGREES: dict[Interpolation, int] = {"linear": 1, "cubic": 3, "quintic": 5}


def control_points(
    times: Floats, q: Floats, v: Floats, a: Floats, kinds: NDArray[np.intp]
) -> Floats:
    """Control points of the curve between each two waypoints.

    A cubic has the positions and velocities of both, a quintic their accelerations too.

    Args:
        times: Times of the waypoints, rising, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad or m].
        v: Joint velocities, of that shape; not read where a line is wanted.
        a: Joint accelerations, of that shape; read for quintics only.
        kinds: Degree of each curve: 1, 3 or 5, shape (k - 1,).

    Returns:
        Shape (k - 1, d + 1, n), for the highest degree d of all.
    """
    step = np.diff(times)[:, None]
    first, last = q[:-1], q[1:]
    curves = {1: np.stack((first, last), axis=1)}
    if 3 in kinds:
        one, other = step * v[:-1] / 3.0, step * v[1:] / 3.0
        curves[3] = np.stack((first, first + one, last - other, last), axis=1)
    if 5 in kinds:
        one, other = step * v[:-1] / 5.0, step * v[1:] / 5.0
        bent, bends = step**2 * a[:-1] / 20.0, step**2 * a[1:] / 20.0
        second, fourth = first + 2.0 * one + bent, last - 2.0 * other + bends
        points = (first, first + one, second, fourth, last - other, last)
        curves[5] = np.stack(points, axis=1)
    highest = int(kinds.max())
    found = np.empty((len(kinds), highest + 1, q.shape[1]))
    for degree, control in curves.items():
        chosen = kinds == degree
        found[chosen] = elevated(control[chosen], highest)
    return found


def fitted_rates(source: str, times: Floats, q: Floats, degree: int) -> list[Floats]:
    """Velocities and accelerations of the smoothest spline that rests at both ends.

    Args:
        source: Where the waypoints are from.
        times: Their times, rising, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad or m].
        degree: 3 or 5.

    Raises:
        TrajectoryError: SciPy is missing.
    """
    try:
        from scipy.interpolate import make_interp_spline
    except ImportError:
        raise TrajectoryError(
            f"{source}: a spline through positions alone needs SciPy: pip install "
            "'armguard[meshes]', or give the waypoints velocities"
        ) from None
    rest = [(order, np.zeros(q.shape[1])) for order in range(1, degree // 2 + 1)]
    spline = make_interp_spline(times, q, k=degree, bc_type=(rest, rest))
    return [np.asarray(spline(times, order)) for order in (1, 2)]
