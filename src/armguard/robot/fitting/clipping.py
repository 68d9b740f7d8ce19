"""Cutting triangles by a plane, so that both sides keep their exact share."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def cut(triangles: Floats, normal: Floats, offset: float) -> tuple[Floats, Floats]:
    """Triangles on both sides of a plane; those that straddle it are cut in three.

    Args:
        triangles: Corners, shape (n, 3, 3) [m].
        normal: Normal of the plane, shape (3,).
        offset: normal · x of the plane [m].

    Returns:
        Triangles with normal · x <= offset, and the others.
    """
    side = triangles @ normal - offset
    below = (side <= 0.0).all(axis=1)
    above = (side >= 0.0).all(axis=1) & ~below
    lower, upper = [triangles[below]], [triangles[above]]
    for triangle, s in zip(
        triangles[~below & ~above], side[~below & ~above], strict=True
    ):
        # Turn the triangle so that its first corner is alone on its side.
        alone = next(k for k in range(3) if (s[k] > 0.0) != (s[k - 1] > 0.0)
                     and (s[k] > 0.0) != (s[k - 2] > 0.0))  # fmt: skip
        p, a, b = (triangle[(alone + k) % 3] for k in range(3))
        sp, sa, sb = (s[(alone + k) % 3] for k in range(3))
        on_a, on_b = p + sp / (sp - sa) * (a - p), p + sp / (sp - sb) * (b - p)
        tip = np.array([[p, on_a, on_b]])
        rest = np.array([[on_a, a, b], [on_a, b, on_b]])
        (upper if sp > 0.0 else lower).append(tip)
        (lower if sp > 0.0 else upper).append(rest)
    return np.concatenate(lower), np.concatenate(upper)
