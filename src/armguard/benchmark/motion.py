"""Motion for benchmarks: smooth, every joint at once, or only the last ones."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def sway(
    home: Floats, lower: Floats, upper: Floats, *, cycles: int, period: float
) -> Floats:
    """Every joint swings about home at its own pace, shape (cycles, n).

    Args:
        home: Where the swing is centred, shape (n,) [rad].
        lower: Limits kept, shape (n,) [rad].
        upper: Limits kept, shape (n,) [rad].
        cycles: Rows.
        period: Time between rows [s].
    """
    n = len(home)
    t = np.arange(cycles)[:, None] * period
    pace = 0.25 + 0.05 * (np.arange(n) * 7 % 11)
    phase = np.arange(n) * 0.9
    q = home + 0.35 * (np.sin(pace * t + phase) - np.sin(phase))
    return np.ascontiguousarray(np.clip(q, lower, upper))


def only_last(q: Floats, home: Floats, moving: int, arms: int) -> Floats:
    """The same motion with all but the last joints held at home.

    Args:
        q: Configurations, shape (k, n); the arms' joints one arm after the other.
        home: Where the others are held.
        moving: Links that move: the last of the first arm, then more of it, then the
            last of the second, and so on.
        arms: Number of arms.
    """
    held = np.tile(home, (len(q), 1))
    per_arm = q.shape[1] // arms
    left = moving
    for arm in range(arms):
        count = min(left, per_arm)
        end = (arm + 1) * per_arm
        held[:, end - count : end] = q[:, end - count : end]
        left -= count
    return held
