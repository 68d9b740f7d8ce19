"""Cores that are apart: a proof from both sides, in extended precision.

Any unit n separates the cores by -h_A(n) - h_B(-n) at least; two points of the cores
are an upper bound. What the witness points stick out of their cores is added to it, so
the true distance is between the two bounds whatever was answered.
"""

import numpy as np

from accuracy.bodies import Array, Bodies, length
from armguard.geometry import ShapeKind


def separation(a: Bodies, b: Bodies, n: Array) -> Array:
    """Separation of grown bodies along unit directions n (k, m, 3): (k, m)."""
    offset = (b.origin - a.origin)[:, None]
    cores = (n * offset).sum(axis=2) - a.support(n) - b.support(-n)
    return cores - (a.radius + b.radius)[:, None]


def half_space_separation(a: Bodies, b: Bodies) -> Array:
    """The same for half-spaces B, which separate along their normal only: (n,)."""
    up = b.rows[:, None, 4:7]
    up = up / length(up)[..., None]
    offset = (a.origin - b.origin)[:, None]
    return ((up * offset).sum(axis=2) - a.support(-up))[:, 0] - a.radius - b.radius


def witness_bound(
    a: Bodies, b: Bodies, out: Array, n: Array
) -> tuple[Array, Array, Array]:
    """Upper bounds on the distance, from witness points.

    Args:
        a: Bodies A.
        b: Bodies B.
        out: Witness rows, shape (n, 10), in extended precision.
        n: Their normals, made unit vectors in that precision.

    Returns:
        The bounds, and how far the points on A and on B are outside, (n,) each [m].
    """
    core_a = out[:, 1:4] - a.radius[:, None] * n - a.origin
    core_b = out[:, 4:7] + b.radius[:, None] * n - b.origin
    between = length(core_b + (b.origin - a.origin) - core_a)
    out_a = a.sticks_out(core_a[:, None])[:, 0]
    if b.kind == ShapeKind.HALF_SPACE:
        up = b.rows[:, 4:7] / length(b.rows[:, 4:7])[:, None]
        out_b = np.maximum((core_b * up).sum(axis=1), 0)
    else:
        out_b = b.sticks_out(core_b[:, None])[:, 0]
    return between + out_a + out_b - a.radius - b.radius, out_a, out_b
