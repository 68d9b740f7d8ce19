"""Distances and depths of cores, searched for: slow, and with no cases to get wrong.

Cores that overlap: the width of the difference body A - B along a unit n is
h_A(n) + h_B(-n); the least one is the depth. Every width that is found is a proof that
the depth is no greater. Polytopes: the facets of the difference, by qhull. Curved
cores: many directions, then descents from the best.

Cores that are apart, where the answered normal does not prove the answer: the nearest
point of A - B to the origin as the nearest point of ever better simplices, in extended
precision. All subsets of a simplex are tried at every step.
"""

from itertools import combinations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from accuracy.bodies import Array, Bodies, length, separation, unit

# Directions looked at, descents from them, and their steps [-].
DIRECTIONS = 600
DESCENTS = 4
ROUNDS = 60
TRIALS = 8

# Facets whose width is computed in extended precision: those least in the common [-].
KEPT = 24

# A difference body with an extent below this share of the largest is flat [-].
FLAT = 1e-14


def fibonacci(count: int) -> Array:
    """Directions spread evenly over the sphere, shape (count, 3)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


SPREAD = fibonacci(DIRECTIONS)


def width(a: Bodies, b: Bodies, n: Array) -> Array:
    """Widths of the difference of grown bodies along n (k, m, 3): (k, m)."""
    return -separation(a, b, n)


def least_width(a: Bodies, b: Bodies, answered: Array) -> Array:
    """The least width found, in extended precision: (n,).

    Args:
        a: Bodies A, in extended precision.
        b: Bodies B.
        answered: Normals that were answered, shape (n, 3): one more direction to try.
    """
    ways = np.concatenate([answered[:, None], own_directions(a, b)], axis=1)
    if a.corners is not None and b.corners is not None:
        least = width(a, b, unit(ways)).min(axis=1)
        for k in range(len(least)):
            one, other = a.pick([k]), b.pick([k])
            facets = facet_normals(one, other)[None]
            rough = width(
                one.as_type(float), other.as_type(float), facets.astype(float)
            )
            facets = facets[:, np.argsort(rough[0])[:KEPT]]
            least[k] = min(least[k], width(one, other, facets).min())
        return least
    return descended(a, b, ways)


def own_directions(a: Bodies, b: Bodies) -> Array:
    """Directions the bodies have themselves: axes, and the line of centres."""
    ways = [(b.origin - a.origin)[:, None], (a.origin - b.origin)[:, None]]
    for body in (a, b):
        if body.rows[0, 7:16].any():
            axes = np.moveaxis(body.axes, 2, 1)
            ways += [axes, -axes]
        if body.corners is not None and body.corners.shape[1] == 3:
            n = np.cross(body.corners[:, 1], body.corners[:, 2])[:, None]
            ways += [n, -n]
        if body.corners is not None and body.corners.shape[1] == 2:
            for axis in np.eye(3):
                n = np.cross(body.corners[:, 1], axis)[:, None]
                ways += [n, -n]
    return np.concatenate(ways, axis=1)


def facet_normals(a: Bodies, b: Bodies) -> Array:
    """Unit normals of the facets of A - B for one pair, shape (m, 3); both of a flat.

    Qhull's tolerances are absolute, so it works on the body stretched to the same
    extent along its principal axes; normals go back by the inverse transposed.
    """
    offset = (a.origin - b.origin)[0]
    points = (a.corners[0][:, None] - b.corners[0][None]).reshape(-1, 3) + offset
    centred = (points - points.mean(axis=0)).astype(float)
    _, _, axes = np.linalg.svd(centred, full_matrices=True)
    extent = np.ptp(centred @ axes.T, axis=0)
    if not extent[2] > FLAT * extent[0]:
        flat = axes[2].astype(np.longdouble)
        return unit(np.stack([flat, -flat]))
    stretched = centred @ axes.T / extent
    try:
        hull = ConvexHull(stretched)
    except QhullError:
        hull = ConvexHull(stretched, qhull_options="QJ")
    normals = (hull.equations[:, :3] / extent) @ axes
    corners = points[hull.simplices]
    exact = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    exact = exact * np.sign((exact * normals).sum(axis=1))[:, None]
    return np.concatenate([unit(normals.astype(np.longdouble)), unit(exact)])


def descended(a: Bodies, b: Bodies, ways: Array) -> Array:
    """Least width by search: sweep, keep distinct best directions, descend."""
    fast_a, fast_b = a.as_type(np.float64), b.as_type(np.float64)
    count = len(a.rows)
    sweep = np.broadcast_to(SPREAD, (count, DIRECTIONS, 3))
    ways = np.concatenate([unit(ways.astype(float)), sweep], axis=1)
    found = width(fast_a, fast_b, ways)
    starts = [ways[:, 0]]
    left = found.copy()
    for _ in range(DESCENTS):
        best = np.take_along_axis(ways, left.argmin(axis=1)[:, None, None], axis=1)
        starts.append(best[:, 0])
        left[(ways * best).sum(axis=2) > 0.9] = np.inf
    n = np.stack(starts, axis=1)
    value = width(fast_a, fast_b, n)
    rng = np.random.default_rng(0)
    step = np.full(value.shape, 0.2)
    for _ in range(ROUNDS):
        moves = rng.normal(size=(*value.shape, TRIALS, 3))
        trial = unit(n[:, :, None] + step[..., None, None] * moves)
        flat = trial.reshape(count, -1, 3)
        values = width(fast_a, fast_b, flat).reshape(*value.shape, TRIALS)
        k = values.argmin(axis=2)
        best = np.take_along_axis(values, k[..., None], axis=2)[..., 0]
        better = best < value
        chosen = np.take_along_axis(trial, k[..., None, None], axis=2)[:, :, 0]
        n = np.where(better[..., None], chosen, n)
        value = np.where(better, best, value)
        step = np.where(better, 1.5 * step, 0.5 * step)
    final = np.concatenate([unit(ways[:, :1]), n], axis=1).astype(np.longdouble)
    return width(a, b, unit(final)).min(axis=1)


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
