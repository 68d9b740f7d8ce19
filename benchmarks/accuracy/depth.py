"""Cores that overlap: the least width of the difference body A - B.

The width along a unit n is h_A(n) + h_B(-n); the least one is the depth. Every width
that is found is a proof that the depth is no greater. Polytopes: the facets of the
difference, by qhull. Curved cores: many directions, then descents from the best.
"""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from accuracy.bodies import Array, Bodies, unit
from accuracy.certificate import separation

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
