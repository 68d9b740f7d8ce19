"""A robot on its plan: how far it is, and how fast it may go on."""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.maps.line_cell import RATE, Job
from armguard.prove.tube import Tube

Floats = NDArray[np.float64]


@dataclass(slots=True)
class Lane:
    """A robot, and how far it is.

    Attributes:
        robot: Its name.
        plan: Name of the plan that it executes, or at an end of which it rests.
        place: Where on it, from its start [s].
        pace: Pace, as a share of the plan's [-].
        job: What it executes; None if it rests.
        tried: How many ways to begin a job would come too late.
        tries_at: Time before which they are not tried again [s].
        yields: Whether it is slower because of the other robot.
        lost: Whether the item of its job is missed.
        apart: Greatest distance of tool and item while this is gripped [m].
    """

    robot: str
    plan: str
    place: float = 0.0
    pace: float = 0.0
    job: Job | None = None
    tried: int = 0
    tries_at: float = -inf
    yields: bool = False
    lost: bool = False
    apart: float = 0.0

    @property
    def stop(self) -> float:
        """Where it can stop [s]."""
        return self.place + 0.5 * self.pace**2 / RATE


def curve_at(tube: Tube, time: float) -> tuple[Floats, Floats]:
    """Positions [rad or m] and velocities of a tube's curves, each shape (n,)."""
    k = int(np.searchsorted(tube.times, time, side="right")) - 1
    k = min(max(k, 0), len(tube.control) - 1)
    start, end = tube.times[k : k + 2]
    share, points = min(max((time - start) / (end - start), 0.0), 1.0), tube.control[k]
    # De Casteljau's scheme; the last two points are on the tangent.
    while len(points) > 2:
        points = points[:-1] + share * (points[1:] - points[:-1])
    rate = tube.degree * (points[1] - points[0]) / (end - start)
    return points[0] + share * (points[1] - points[0]), rate


def pace_before(left: float, dt: float) -> float:
    """Greatest pace from which a robot can stop in time [-].

    Args:
        left: Time of the plan that is left after which it has to rest [s].
        dt: Time until it can slow down [s].
    """
    if left == inf:
        return 1.0
    return RATE * (sqrt(dt * dt + 2.0 * max(left, 0.0) / RATE) - dt)
