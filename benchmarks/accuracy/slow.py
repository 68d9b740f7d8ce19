"""The distance of cores that are apart, found anew in extended precision.

For pairs whose answered normal does not prove the answer: the nearest point of A - B to
the origin as the nearest point of ever better simplices. All subsets of a simplex are
tried at every step; slow, with no case distinctions to get wrong.
"""

from itertools import combinations

import numpy as np

from accuracy.bodies import Array, Bodies, length, unit
from accuracy.certificate import separation

STEPS = 80

# Subsets of up to four corners, the smallest first.
SUBSETS = [c for k in range(1, 5) for c in combinations(range(4), k)]


def bounds(a: Bodies, b: Bodies, start: Array) -> tuple[Array, Array]:
    """Bounds on the signed distance of grown bodies whose cores are apart, (n,) each.

    Args:
        a: Bodies A, in extended precision.
        b: Bodies B.
        start: First directions from A to B, shape (n, 3).
    """
    count = len(a.rows)
    offset = b.origin - a.origin
    v = unit(start.astype(np.longdouble))
    corners = np.zeros((count, 4, 3), dtype=np.longdouble)
    used = np.zeros((count, 4), dtype=bool)
    lower = np.full(count, -np.inf, dtype=np.longdouble)
    upper = np.full(count, np.inf, dtype=np.longdouble)
    rows = np.arange(count)
    for _ in range(STEPS):
        n = unit(v)
        lower = np.maximum(lower, separation(a, b, n[:, None])[:, 0])
        w = offset + b.farthest(-n) - a.farthest(n)
        free = (~used).argmax(axis=1)
        corners[rows, free] = w
        used[rows, free] = True
        v, used, normal = nearest(corners, used)
        gap = length(v)
        upper = np.minimum(upper, gap)
        # The normal of a face stays exact when the gap is but round-off.
        for sign in (-1, 1):
            found = separation(a, b, sign * normal[:, None])[:, 0]
            lower = np.maximum(lower, found)
    return lower, upper - a.radius - b.radius


def nearest(corners: Array, used: Array) -> tuple[Array, Array, Array]:
    """Nearest points of simplices to the origin: all subsets are tried.

    Returns:
        The points, which corners they need, and unit normals of triangles that do.
    """
    best = np.full(len(corners), np.inf, dtype=np.longdouble)
    point = np.zeros((len(corners), 3), dtype=np.longdouble)
    needed = np.zeros_like(used)
    normal = np.zeros_like(point)
    normal[:, 2] = 1
    for subset in SUBSETS:
        p = corners[:, subset]
        weights = affine_weights(p)
        fits = used[:, subset].all(axis=1) & (weights > 0).all(axis=1)
        x = (weights[..., None] * p).sum(axis=1)
        if len(subset) == 4:
            x = np.zeros_like(x)
        square = np.where(fits, length(x), np.inf)
        better = square < best
        best = np.where(better, square, best)
        point = np.where(better[:, None], x, point)
        mask = np.isin(np.arange(4), subset)
        needed = np.where(better[:, None], mask, needed)
        if len(subset) == 3:
            face = unit(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
            normal = np.where(better[:, None], face, normal)
    return point, needed, normal


def affine_weights(p: Array) -> Array:
    """Weights of the point nearest to the origin in the affine hull of p (n, k, 3)."""
    k = p.shape[1]
    if k == 1:
        return np.ones(p.shape[:2], dtype=p.dtype)
    if k == 2:
        u = p[:, 1] - p[:, 0]
        square = (u * u).sum(axis=1)
        t = -(p[:, 0] * u).sum(axis=1) / np.where(square > 0, square, -1)
        return np.stack([1 - t, t], axis=1)
    if k == 3:
        a, b, c = p[:, 0], p[:, 1], p[:, 2]
        n = np.cross(b - a, c - a)
        parts = [np.cross(b, c), np.cross(c, a), np.cross(a, b)]
    else:
        a, b, c = (p[:, i] - p[:, 3] for i in range(3))
        n = np.cross(a, b)
        total = (n * c).sum(axis=1)
        total = np.where(total == 0, np.nan, total)
        d = -p[:, 3]
        first = (np.cross(b, c) * d).sum(axis=1) / total
        second = (np.cross(c, a) * d).sum(axis=1) / total
        third = (n * d).sum(axis=1) / total
        weights = np.stack([first, second, third, 1 - first - second - third], axis=1)
        return np.nan_to_num(weights, nan=-1.0)
    square = (n * n).sum(axis=1)
    square = np.where(square > 0, square, np.nan)
    weights = np.stack([(n * q).sum(axis=1) / square for q in parts], axis=1)
    return np.nan_to_num(weights, nan=-1.0)
