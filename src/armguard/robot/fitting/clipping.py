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
    straddling = ~below & ~above
    positive = side[straddling] > 0.0
    # Each triangle is turned so that its first corner is alone on its side.
    up = positive.sum(axis=1) == 1
    alone = (positive == up[:, None]).argmax(axis=1)
    turned = (alone[:, None] + np.arange(3)) % 3
    p, a, b = np.moveaxis(
        np.take_along_axis(triangles[straddling], turned[:, :, None], axis=1), 1, 0
    )
    sp, sa, sb = np.take_along_axis(side[straddling], turned, axis=1).T[:, :, None]
    on_a, on_b = p + sp / (sp - sa) * (a - p), p + sp / (sp - sb) * (b - p)
    tips = np.stack([p, on_a, on_b], axis=1)
    rests = np.stack([[on_a, a, b], [on_a, b, on_b]]).transpose(2, 0, 1, 3)
    lower = triangles[below], tips[~up], rests[up].reshape(-1, 3, 3)
    upper = triangles[above], tips[up], rests[~up].reshape(-1, 3, 3)
    return np.concatenate(lower), np.concatenate(upper)
