"""The nearest and the farthest two links come, searched by samples; proves nothing."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Configurations looked at first, and how many of the best are followed further.
SAMPLES = 512
KEPT = 24

# Rounds of following, and how many neighbours each of the kept is given in a round.
ROUNDS = 30
NEIGHBOURS = 8

# Spread of the neighbours in the first round and the last, share of the range [-].
WIDE = 0.25
NARROW = 0.001


def first_samples(lower: Floats, upper: Floats, rng: np.random.Generator) -> Floats:
    """Random configurations, half of them with some joints at a limit, shape (k, n)."""
    count = len(lower)
    q = rng.uniform(lower, upper, (SAMPLES, count))
    at_end = rng.random((SAMPLES, count)) < 0.3
    at_end[: SAMPLES // 2] = False
    ends = np.where(rng.random((SAMPLES, count)) < 0.5, lower, upper)
    return np.concatenate([[(lower + upper) / 2.0], np.where(at_end, ends, q)])


def least_found(
    value: Callable[[Floats], Floats],
    q: Floats,
    lower: Floats,
    upper: Floats,
    rng: np.random.Generator,
) -> tuple[Floats, float]:
    """Configuration with a small value, followed from the best samples, and the value.

    Args:
        value: Values of configurations, (k, n) to (k,).
        q: Samples, shape (k, n).
        lower: Least positions, shape (n,).
        upper: Greatest positions, shape (n,).
        rng: Of the neighbours.
    """
    found = value(q)
    best = np.argsort(found)[:KEPT]
    q, found = q[best], found[best]
    if len(lower) == 0:
        return q[0], float(found[0])
    for spread in np.geomspace(WIDE, NARROW, ROUNDS):
        steps = rng.normal(0.0, spread, (len(q), NEIGHBOURS, len(lower)))
        # Now one joint, now all: a valley may run along an axis.
        steps[:, ::2] *= rng.random(steps[:, ::2].shape) < 1.5 / len(lower)
        near = np.clip(q[:, None] + steps * (upper - lower), lower, upper)
        near = near.reshape(-1, len(lower))
        q, found = np.concatenate([q, near]), np.concatenate([found, value(near)])
        best = np.argsort(found)[:KEPT]
        q, found = q[best], found[best]
    return q[0], float(found[0])
