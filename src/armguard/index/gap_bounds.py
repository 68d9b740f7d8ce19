"""Lower and upper bounds of the distance of a core to cells, for the audit.

Alternating projections give a pair of points, whose distance is the upper bound; the
direction between them separates the two sets by at least the lower bound. The code is
independent of the kernels that build the tree.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.cell_gap import cell_gap
from armguard.geometry.shapes import ShapeKind

Floats = NDArray[np.float64]

# Alternating projections end when no distance falls by more than this [m], or after
# this many steps; the bounds hold in any case.
SETTLED = 1e-12
STEPS = 400

ROUND = (ShapeKind.CYLINDER, ShapeKind.CONE)

# Kinds without a projection: the convex solver computes them, which has its own oracles
# (docs/accuracy.md).
ASKED = (ShapeKind.ELLIPSOID, ShapeKind.HULL, ShapeKind.SUPPORT)


def bracket_gaps(
    kind: int, row: Floats, low: Floats, high: Floats
) -> tuple[Floats, Floats]:
    """Lower and upper bounds of the distance of a core to cells, each shape (k,) [m].

    Args:
        kind: ShapeKind of the primitive.
        row: Row of the primitive, shape (16,).
        low: Lower corners of the cells, shape (k, 3) [m].
        high: Upper corners of the cells, shape (k, 3) [m].
    """
    if kind in ASKED:
        cells = zip(*closed(kind, row, low, high), strict=True)
        gaps = np.array([cell_gap(kind, row, *a, *b) for a, b in cells])
        return gaps, gaps
    if kind == ShapeKind.HALF_SPACE:
        n = row[4:7]
        deepest = np.where(n > 0.0, low, high)
        height = np.where(n != 0.0, n * np.where(n != 0.0, deepest, 0.0), 0.0).sum(1)
        gaps = np.maximum(height - n @ row[1:4], 0.0)
        return gaps, gaps
    inside = np.tile(row[1:4], (len(low), 1))
    upper = np.full(len(low), np.inf)
    for _ in range(STEPS):
        outside = np.minimum(np.maximum(inside, low), high)
        inside = nearest_in_core(kind, row, outside)
        before, upper = upper, lengths(outside - inside)
        if (before - upper).max(initial=0.0) < SETTLED:
            break
    length = np.where(upper > 0.0, upper, 1.0)[:, None]
    n = (outside - inside) / length
    # A cell is open where it has no bound; there the direction has no component.
    corner = np.where(n > 0.0, low, high)
    nearest_side = np.where(n != 0.0, n * np.where(n != 0.0, corner, 0.0), 0.0).sum(1)
    lower = nearest_side - core_reach(kind, row, n)
    return np.where(upper > 0.0, np.clip(lower, 0.0, upper), 0.0), upper


def closed(kind: int, row: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Cells with open sides closed, at an unchanged distance from a core [m]."""
    box = np.zeros(6)
    row_bounds(kind, row, 0.0, box)
    below = np.minimum(box[:3], np.where(np.isfinite(high), high, box[:3])) - 1.0
    above = np.maximum(box[3:], np.where(np.isfinite(low), low, box[3:])) + 1.0
    return np.where(np.isfinite(low), low, below), np.where(
        np.isfinite(high), high, above
    )


def core_reach(kind: int, row: Floats, n: Floats) -> Floats:
    """Support of a core in directions n, (k, 3), from the origin, shape (k,) [m]."""
    if kind == ShapeKind.SPHERE:
        return np.asarray(n @ row[1:4])
    if kind == ShapeKind.CAPSULE:
        return np.maximum(n @ row[1:4], n @ row[4:7])
    if kind == ShapeKind.TRIANGLE:
        return np.asarray((n @ row[1:10].reshape(3, 3).T).max(axis=1))
    local = n @ row[7:16].reshape(3, 3)
    if kind in ROUND:
        out = np.hypot(local[:, 0], local[:, 1])
        up = row[5] * local[:, 2]
        reach = np.maximum(row[4] * out - up, row[6] * out + up)
    else:
        reach = np.abs(local) @ row[4:7]
    return np.asarray(n @ row[1:4] + reach)


def nearest_in_core(kind: int, row: Floats, points: Floats) -> Floats:
    """Nearest points of a core, shape (k, 3) [m]."""
    if kind == ShapeKind.SPHERE:
        return np.broadcast_to(row[1:4], points.shape)
    if kind == ShapeKind.CAPSULE:
        return nearest_on_segment(row[1:4], row[4:7], points)
    if kind == ShapeKind.TRIANGLE:
        return nearest_on_triangle(row[1:10].reshape(3, 3), points)
    R = row[7:16].reshape(3, 3)
    local = (points - row[1:4]) @ R
    if kind in ROUND:
        local = nearest_in_cone(row[4], row[5], row[6], local)
    else:
        local = np.minimum(np.maximum(local, -row[4:7]), row[4:7])
    return np.asarray(row[1:4] + local @ R.T)


def lengths(vectors: Floats) -> Floats:
    """Lengths of vectors, shape (k,), in half the time of `np.linalg.norm`."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def nearest_on_segment(a: Floats, b: Floats, points: Floats) -> Floats:
    """Nearest points of a segment, shape (k, 3) [m]."""
    axis = b - a
    length2 = float(axis @ axis)
    along = (points - a) @ axis / length2 if length2 > 0.0 else np.zeros(len(points))
    along = np.minimum(np.maximum(along, 0.0), 1.0)
    return np.asarray(a + along[:, None] * axis)


def nearest_on_triangle(corners: Floats, points: Floats) -> Floats:
    """Nearest points of a triangle, shape (k, 3) [m]: of its plane, or of an edge."""
    a, b, c = corners
    found = nearest_on_segment(a, b, points)
    best = lengths(points - found)
    n = np.cross(b - a, c - a)
    candidates = [nearest_on_segment(b, c, points), nearest_on_segment(c, a, points)]
    area = float(n @ n)
    if area > 0.0:
        plane = points - np.multiply.outer((points - a) @ n / area, n)
        within = np.ones(len(points), dtype=np.bool_)
        for p, q in ((a, b), (b, c), (c, a)):
            within &= np.cross(q - p, plane - p) @ n >= 0.0
        candidates.append(np.where(within[:, None], plane, np.inf))
    for candidate in candidates:
        apart = lengths(points - candidate)
        nearer = apart < best
        found[nearer], best[nearer] = candidate[nearer], apart[nearer]
    return found


def nearest_in_cone(
    lower: float, height: float, upper: float, points: Floats
) -> Floats:
    """Nearest points of a truncated cone about z, shape (k, 3) [m].

    A trapezoid in the half-plane of axis and point: a point inside stays where it is.
    """
    r, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    outline = np.array([[0, -height], [lower, -height], [upper, height], [0, height]])
    flat = np.stack([r, z], axis=1)
    limit = lower + (upper - lower) * (z + height) / (2.0 * height)
    inside = (np.abs(z) <= height) & (r <= limit)
    found, best = flat.copy(), np.full(len(points), np.inf)
    for k in range(3):
        candidate = nearest_on_segment(outline[k], outline[k + 1], flat)
        apart = lengths(flat - candidate)
        nearer = ~inside & (apart < best)
        found[nearer], best[nearer] = candidate[nearer], apart[nearer]
    out = np.where(r > 0.0, found[:, 0] / np.where(r > 0.0, r, 1.0), 0.0)
    return np.stack([points[:, 0] * out, points[:, 1] * out, found[:, 1]], axis=1)
