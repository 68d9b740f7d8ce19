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
    """A boundary in the plane that covers the torus, in the order it was followed.

    Attributes:
        points: Its points, shape (n, 2) [rad].
        period: Vector of the lattice after which it repeats itself; zero if it is
            closed, shape (2,) [rad].
        side: 1 with the obstacle to the left, -1 with it to the right.
    """

    points: Floats
    period: Floats
    side: int

    @property
    def closed(self) -> bool:
        """Whether it is closed in the plane."""
        return not self.period.any()

    @property
    def around_arm(self) -> bool:
        """Whether it is closed and the arm is inside."""
        return self.closed and self._counter_clockwise == (self.side < 0)

    @property
    def _counter_clockwise(self) -> bool:
        """Whether it is closed and its inside is to the left."""
        ends = np.roll(self.points, -1, axis=0)
        return self.closed and bool(cross(self.points, ends).sum() > 0.0)

    def free_side(self, points: Floats) -> Bools:
        """Which points (n, 2) are on the arm's side, shape (n,)."""
        line = np.concatenate([self.points, self.points[:1] + self.period])
        along = np.array([1.0, 0.0])
        if not self.closed:
            shifts = np.arange(-PERIODS, PERIODS + 1)[:, None, None]
            line = (self.points + shifts * self.period).reshape(-1, 2)
            along = self.period / np.hypot(*self.period)
            # Every point has one like it beside the first period.
            count = (points - self.points[0]) @ along / np.hypot(*self.period)
            points = points - np.round(count)[:, None] * self.period
        axes = np.column_stack([along, (-along[1], along[0])])
        net = np.array([crossings(p, line @ axes) for p in points @ axes])
        # Of a counter-clockwise curve all that is outside is to the right.
        return np.asarray((net + self._counter_clockwise > 0) == (self.side > 0))


def crossings(point: Floats, line: Floats) -> int:
    """Crossings of a line (n, 2) with the ray upwards from a point.

    Returns:
        How many lead to the right, less those that lead to the left.
    """
    a, b = line[:-1], line[1:]
    right = (b[:, 0] > point[0]).astype(np.int64) - (a[:, 0] > point[0])
    return int((right * (cross(a - point, b - point) * right < 0.0)).sum())


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products of vectors (n, 2), shape (n,)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
