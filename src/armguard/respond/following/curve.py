"""Curves on the torus of two joints, and the goals that they divide from an arm.

Joint positions are counted without wrapping: in the plane that covers the torus each
goal is a lattice of points. A closed curve of the torus is in that plane either closed,
or it repeats itself along a vector of the lattice. Both divide the plane.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

TURN = 2.0 * np.pi

# Periods of a curve on each side that are looked at.
PERIODS = 3


class Curve(NamedTuple):
    """A boundary in the plane that covers the torus.

    Attributes:
        points: Its points, shape (n, 2) [rad].
        period: Vector of the lattice after which it repeats itself; zero if it is
            closed, shape (2,) [rad].
        blocked: A point on the other side than the arm, shape (2,) [rad].
    """

    points: Floats
    period: Floats
    blocked: Floats

    @property
    def closed(self) -> bool:
        """Whether it is closed in the plane."""
        return not self.period.any()

    @property
    def around_arm(self) -> bool:
        """Whether it is closed and the arm is inside."""
        away = self.points.max(axis=0) + 1.0
        return self.closed and not self.free_side(away[None])[0]

    def free_side(self, points: Floats) -> Bools:
        """Which points (n, 2) are on the arm's side, shape (n,)."""
        if self.closed:
            line = np.concatenate([self.points, self.points[:1]])
        else:
            shifts = np.arange(-PERIODS, PERIODS + 1)
            line = np.concatenate([self.points + k * self.period for k in shifts])
        return np.array([crossings(self.blocked, p, line) % 2 == 1 for p in points])


def crossings(start: Floats, end: Floats, line: Floats) -> int:
    """How often a segment crosses a line of points, shape (n, 2)."""
    a, b = line[:-1], line[1:]
    apart = is_left(a, b, start) != is_left(a, b, end)
    return int((apart & (is_left(start, end, a) != is_left(start, end, b))).sum())


def is_left(a: Floats, b: Floats, c: Floats) -> Bools:
    """Whether c is to the left of the line from a to b."""
    d, e = b - a, c - a
    return np.asarray(d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0] > 0.0)
