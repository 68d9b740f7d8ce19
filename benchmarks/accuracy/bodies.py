"""Cores of convex shapes as the oracles see them: many of one kind at a time.

A row (see `armguard.geometry.shapes.row`) and, for a hull, its corners define a shape.
The formulas are written anew, in numpy and in any precision; a support *value* is all
they need, not the point.

Cores that are apart have a proof from both sides, in extended precision: any unit n
separates them by -h_A(n) - h_B(-n) at least; two points of the cores are an upper
bound. What the witness points stick out of their cores is added to it, so the true
distance is between the two bounds whatever was answered.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry import ShapeKind

Array = NDArray[Any]


@dataclass(frozen=True)
class Bodies:
    """Cores of one kind, n of them; points and directions are (n, m, 3).

    Attributes:
        kind: Their kind.
        rows: Their rows, shape (n, 16).
        corners: Points that span the core, relative to the origin and in the world's
            axes, shape (n, k, 3); none for curved cores.
        exponents: Of superellipsoids, shape (n,).
    """

    kind: ShapeKind
    rows: Array
    corners: Array | None
    exponents: Array

    @property
    def origin(self) -> Array:
        """Origins, shape (n, 3)."""
        return self.rows[:, 1:4]

    @property
    def radius(self) -> Array:
        """Radii the cores are grown by, shape (n,)."""
        return self.rows[:, 0]

    @property
    def sizes(self) -> Array:
        """The three sizes of a core, shape (n, 1, 3)."""
        return self.rows[:, None, 4:7]

    @property
    def axes(self) -> Array:
        """Axes of the frames as columns, shape (n, 3, 3)."""
        return self.rows[:, 7:16].reshape(-1, 3, 3)

    def to_frame(self, vectors: Array) -> Array:
        """World vectors in the frames' axes."""
        return np.einsum("nmj,njk->nmk", vectors, self.axes)

    def pick(self, indices: Any) -> "Bodies":
        """Some of them."""
        corners = None if self.corners is None else self.corners[indices]
        return Bodies(self.kind, self.rows[indices], corners, self.exponents[indices])

    def as_type(self, dtype: Any) -> "Bodies":
        """The same in another precision."""
        corners = None if self.corners is None else self.corners.astype(dtype)
        return Bodies(
            self.kind, self.rows.astype(dtype), corners, self.exponents.astype(dtype)
        )

    def support(self, d: Array) -> Array:
        """How far the cores reach along directions d, from their origins: (n, m)."""
        if self.corners is not None:
            return np.einsum("nmj,nkj->nmk", d, self.corners).max(axis=2)
        d = self.to_frame(d)
        if self.kind == ShapeKind.ELLIPSOID:
            return np.sqrt(((self.sizes * d) ** 2).sum(axis=2))
        if self.kind == ShapeKind.SUPPORT:
            dual = (self.exponents / (self.exponents - 1))[:, None]
            return power_norm(self.sizes * d, dual)
        lower, half, upper = np.moveaxis(self.sizes, 2, 0)
        across = np.sqrt(d[..., 0] ** 2 + d[..., 1] ** 2)
        return np.maximum(
            lower * across - half * d[..., 2], upper * across + half * d[..., 2]
        )

    def farthest(self, d: Array) -> Array:
        """Points of the cores farthest along directions d (n, 3), from the origins."""
        if self.corners is not None:
            best = np.einsum("nj,nkj->nk", d, self.corners).argmax(axis=1)
            return np.take_along_axis(self.corners, best[:, None, None], axis=1)[:, 0]
        d = self.to_frame(d[:, None])[:, 0]
        sizes = self.sizes[:, 0]
        if self.kind == ShapeKind.ELLIPSOID:
            local = sizes * unit(sizes * d)
        elif self.kind == ShapeKind.SUPPORT:
            dual = (self.exponents / (self.exponents - 1))[:, None]
            pull = np.abs(sizes * d) / power_norm(sizes * d, dual[:, 0])[:, None]
            local = np.copysign(sizes * pull ** (dual - 1), d)
        else:
            out = np.sqrt(d[:, 0] ** 2 + d[:, 1] ** 2)
            lower, half, upper = sizes.T
            above = upper * out + half * d[:, 2] >= lower * out - half * d[:, 2]
            rim = np.where(above, upper, lower) / np.where(out > 0, out, 1)
            local = np.stack(
                [rim * d[:, 0], rim * d[:, 1], np.where(above, half, -half)], axis=1
            )
        return np.einsum("nij,nj->ni", self.axes, local)

    def sticks_out(self, x: Array) -> Array:
        """Bound on how far points x, relative to the origins, are outside: (n, m)."""
        if self.kind == ShapeKind.SPHERE:
            return length(x)
        if self.kind == ShapeKind.CAPSULE:
            return outside_segment(x, 0 * x, self.corners[:, None, 1] + 0 * x)
        if self.kind == ShapeKind.TRIANGLE:
            return outside_triangle(x, self.corners)
        if self.kind == ShapeKind.HULL:
            return outside_hull(x, self.corners)
        x = self.to_frame(x)
        if self.kind == ShapeKind.BOX:
            return length(np.maximum(np.abs(x) - self.sizes, 0))
        if self.kind in (ShapeKind.ELLIPSOID, ShapeKind.SUPPORT):
            power = 0 * self.exponents + 2
            if self.kind == ShapeKind.SUPPORT:
                power = self.exponents
            return outside_ellipsoid(x, self.sizes, power[:, None])
        return outside_cone(x, self.sizes)


def length(x: Array) -> Array:
    """Lengths of vectors."""
    return np.sqrt((x * x).sum(axis=-1))


def unit(v: Array) -> Array:
    """Unit vectors; z where there is no direction."""
    size = length(v)[..., None]
    z = np.zeros(3, dtype=v.dtype)
    z[2] = 1
    return np.where(size > 0, v / np.where(size > 0, size, 1), z)


def power_norm(x: Array, power: Array) -> Array:
    """(sum |x|^p)^(1/p), without overflow."""
    x = np.abs(x)
    most = x.max(axis=-1)
    safe = np.where(most > 0, most, 1)
    total = ((x / safe[..., None]) ** power[..., None]).sum(axis=-1)
    return np.where(most > 0, most * total ** (1 / power), 0)


def outside_ellipsoid(x: Array, sizes: Array, power: Array) -> Array:
    """Bound on the distance of points from (super)ellipsoids: a way back that is known.

    Down the slope of the norm as far as Newton's method goes, and from there to the
    centre until the point is inside.
    """
    start, way = x, None
    best = np.full(x.shape[:-1], np.inf)
    for _ in range(6):
        reach = power_norm(x / sizes, power)
        # Shrunk to reach 1 the point is inside; that is how far it moves.
        left = length(x) * np.maximum(1 - 1 / np.maximum(reach, 1), 0)
        best = np.minimum(best, length(x - start) + left)
        ratio = np.abs(x / sizes) / np.where(reach > 0, reach, 1)[..., None]
        slope = np.copysign(ratio ** (power[..., None] - 1) / sizes, x)
        way = unit(slope) if way is None else way
        fall = (slope * way).sum(axis=-1)
        step = np.maximum(reach - 1, 0) / np.where(fall > 0, fall, 1)
        x = x - step[..., None] * way
    return np.asarray(best)


def outside_segment(x: Array, p: Array, q: Array) -> Array:
    """Distance of points from segments; for any parameter it is an upper bound."""
    u = q - p
    square = (u * u).sum(axis=-1)
    t = ((x - p) * u).sum(axis=-1) / np.where(square > 0, square, 1)
    return length(x - p - np.clip(t, 0, 1)[..., None] * u)


def outside_triangle(x: Array, corners: Array) -> Array:
    """Distance of points from triangles."""
    a, b, c = (corners[:, None, k] + 0 * x for k in range(3))
    least = np.minimum(
        np.minimum(outside_segment(x, a, b), outside_segment(x, b, c)),
        outside_segment(x, c, a),
    )
    n = np.cross(b - a, c - a)
    size = length(n)
    n = n / np.where(size > 0, size, 1)[..., None]
    over = size > 0
    for p, q in ((a, b), (b, c), (c, a)):
        over &= (np.cross(q - p, x - p) * n).sum(axis=-1) >= 0
    return np.where(over, np.abs(((x - a) * n).sum(axis=-1)), least)


def outside_cone(x: Array, sizes: Array) -> Array:
    """Distance of points from truncated cones, in their frames."""
    lower, half, upper = np.moveaxis(sizes, 2, 0)
    r = np.sqrt(x[..., 0] ** 2 + x[..., 1] ** 2)
    z = x[..., 2]
    point = np.stack([r, z, 0 * r], axis=-1)
    outline = [(0, -1), (lower, -1), (upper, 1), (0, 1)]
    ends = [np.stack([p + 0 * r, s * half + 0 * r, 0 * r], axis=-1) for p, s in outline]
    least = outside_segment(point, ends[0], ends[1])
    for p, q in pairwise(ends[1:]):
        least = np.minimum(least, outside_segment(point, p, q))
    # Inside by the height and the slant, without a division.
    side = (r - lower) * 2 * half - (z + half) * (upper - lower)
    return np.where((np.abs(z) <= half) & (side <= 0), 0, least)


def outside_hull(x: Array, corners: Array) -> Array:
    """Bound on the distance of points from hulls: weights of corners that come near."""
    from scipy.optimize import nnls

    out = np.zeros(x.shape[:2], dtype=x.dtype)
    for i in range(len(x)):
        for j in range(x.shape[1]):
            around = corners[i] - x[i, j]
            near = np.argsort(length(around))
            out[i, j] = length(around[near[0]])
            scale = float(np.abs(around).max())
            if out[i, j] == 0 or scale == 0:
                continue
            system = np.vstack([(around / scale).astype(float).T, np.ones(len(around))])
            try:
                weights = nnls(system, np.array([0.0, 0.0, 0.0, 1.0]))[0]
            except RuntimeError:
                continue
            for share in polished(around, weights):
                out[i, j] = min(out[i, j], length(share @ around))
    return out


def polished(around: Array, weights: Array) -> list[Array]:
    """Weights that sum to one, and the same after a step of least squares."""
    if not weights.sum() > 0:
        return []
    first = weights.astype(around.dtype) / weights.astype(around.dtype).sum()
    used = np.flatnonzero(weights > 0)
    if len(used) < 2:
        return [first]
    spread = around[used[1:]] - around[used[0]]
    rest = first @ around
    step = np.linalg.lstsq(spread.astype(float).T, -rest.astype(float), rcond=None)[0]
    second = first.copy()
    second[used[1:]] += step
    second[used[0]] -= second[used].sum() - 1
    return [first, second] if (second >= 0).all() else [first]


def gather(shapes: Sequence[Any], rows: Array) -> Bodies:
    """Bodies of shapes of one kind, in extended precision."""
    kind = shapes[0].kind
    rows = rows.astype(np.longdouble)
    count = len(rows)
    corners = None
    if kind == ShapeKind.SPHERE:
        corners = np.zeros((count, 1, 3), dtype=np.longdouble)
    elif kind == ShapeKind.CAPSULE:
        ends = rows[:, [[1, 2, 3], [4, 5, 6]]]
        corners = ends - ends[:, :1]
    elif kind == ShapeKind.TRIANGLE:
        ends = rows[:, [[1, 2, 3], [4, 5, 6], [7, 8, 9]]]
        corners = ends - ends[:, :1]
    elif kind == ShapeKind.BOX:
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        local = signs[None] * rows[:, None, 4:7]
        corners = turned(rows, local)
    elif kind == ShapeKind.HULL:
        most = max(len(s.vertices) for s in shapes)
        local = np.stack(
            [
                s.vertices[np.minimum(np.arange(most), len(s.vertices) - 1)]
                for s in shapes
            ]
        ).astype(np.longdouble)
        corners = turned(rows, local)
    exponents = np.full(count, 2, dtype=np.longdouble)
    if kind == ShapeKind.SUPPORT:
        exponents[:] = [s.exponent for s in shapes]
        # In the row stand addresses; the oracle wants the sizes.
        rows[:, 4:7] = [s.semi_axes for s in shapes]
    return Bodies(kind, rows, corners, exponents)


def turned(rows: Array, local: Array) -> Array:
    """Points in frames' axes as world vectors."""
    return np.einsum("nij,nkj->nki", rows[:, 7:16].reshape(-1, 3, 3), local)


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
