"""A kernel about depths of a frame: which of them hit, and how far they free."""

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


@kernel
def slack_of(depth: float, view: Floats) -> float:
    """How far off a depth may be [m]; see `View.figures`."""
    d = min(depth, view[5])
    return float(view[0] + view[1] * (view[2] + view[3] * d + view[4] * d * d))


@kernel(inline=False, entry=True)
def split_depths(
    depth: Floats, firm: Bools, nothing: Bools, view: Floats, room: float,
    reach: float, out: Singles,
) -> None:  # fmt: skip
    """Depths that hit, and those up to which is looked through.

    Args:
        depth: Measured depths, NaN where none is, shape (n,) [m].
        firm: Which of them may free space, shape (n,).
        nothing: Where nothing is within range, shape (n,).
        view: See `View.figures`.
        room: What is left behind a depth that hits [m].
        reach: Depth up to which one hits, with that room and all it may be off [m].
        out: Both, NaN for none, overwritten, shape (2, n) [m].
    """
    for k in range(depth.shape[0]):
        slack = slack_of(depth[k], view)
        hits = depth[k] + slack + room <= reach
        out[0, k] = depth[k] if hits else np.nan
        past = max(depth[k] - slack, 0.0) if firm[k] else np.nan
        out[1, k] = view[5] if nothing[k] else past
