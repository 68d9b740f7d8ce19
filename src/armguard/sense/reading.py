"""A kernel about depths of a frame: which of them hit, and how far they free."""

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


@kernel
def slack_of(depth: float, noise: Floats) -> float:
    """How far off a depth may be [m]; see `split_depths`."""
    d = min(depth, noise[5])
    return float(noise[0] + noise[1] * (noise[2] + noise[3] * d + noise[4] * d * d))


@kernel(inline=False, entry=True)
def split_depths(
    depth: Floats, firm: Bools, nothing: Bools, noise: Floats, room: float,
    reach: float, out: Singles,
) -> None:  # fmt: skip
    """Depths that hit, and those up to which is looked through.

    Args:
        depth: Measured depths, NaN where none is, shape (n,) [m].
        firm: Which of them may free space, shape (n,).
        nothing: Where nothing is within range, shape (n,).
        noise: How far off each may be beside its noise; how many standard deviations
            that may be, its three coefficients, and the depth beyond which it no more
            grows, shape (6,).
        room: What is left behind a depth that hits [m].
        reach: Depth up to which one hits, with that room and all it may be off [m].
        out: Both, NaN for none, overwritten, shape (2, n) [m].
    """
    for k in range(depth.shape[0]):
        slack = slack_of(depth[k], noise)
        hits = depth[k] + slack + room <= reach
        out[0, k] = depth[k] if hits else np.nan
        past = max(depth[k] - slack, 0.0) if firm[k] else np.nan
        out[1, k] = noise[5] if nothing[k] else past
