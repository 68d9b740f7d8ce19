"""How smooth a motion is: jerk, and how often it changes its mind."""

import numpy as np

from arrays import Bools, Floats

# Share of its acceleration a joint must speed up or slow down by to count [-].
COUNTS = 0.02

# What is ordered differs from what is asked for by more than this [rad/s or m/s].
DIFFERS = 1e-3


def jerk(v: Floats, dt: float) -> tuple[float, float]:
    """Root mean square and peak of the jerk of some joints [rad/s³].

    Args:
        v: Velocities by cycle, shape (c, k).
        dt: Period [s].
    """
    found = np.diff(v, 2, axis=0) / (dt * dt)
    if found.size == 0:
        return 0.0, 0.0
    return float(np.sqrt((found * found).mean())), float(np.abs(found).max())


def held_back(ordered: Floats, asked: Floats) -> Bools:
    """Cycles in which something else is ordered than what is asked for, shape (c,)."""
    found: Bools = (np.abs(ordered - asked) > DIFFERS).any(axis=1)
    return found


def chatter(ordered: Floats, acceleration: Floats, dt: float, where: Bools) -> float:
    """How often a joint's acceleration changes its sign where it is held back [1/s].

    Of the joint that does so most.

    Args:
        ordered: Velocities ordered, by cycle, shape (c, k).
        acceleration: Greatest accelerations, shape (k,).
        dt: Period [s].
        where: Cycles that count, shape (c,).
    """
    time = dt * float(where[1:].sum())
    if time < 50 * dt:
        return 0.0
    a = np.diff(ordered, axis=0) / dt
    most = 0
    for k in range(ordered.shape[1]):
        there = where[1:] & (np.abs(a[:, k]) > COUNTS * acceleration[k])
        signs = np.sign(a[there, k])
        most = max(most, int((signs[1:] != signs[:-1]).sum()))
    return most / time


def share_blocked(ordered: Floats, asked: Floats) -> float:
    """Share of the time in which less than a tenth of what is asked is ordered [-]."""
    size = (asked * asked).sum(axis=1)
    wants = size > 1e-8
    along = (ordered * asked).sum(axis=1)
    return float((along[wants] < 0.1 * size[wants]).mean()) if wants.any() else 0.0
