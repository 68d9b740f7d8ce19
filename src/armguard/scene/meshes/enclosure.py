"""How well convex pieces enclose a mesh: what they miss, and how far they reach beyond.

Distances are those of the cycle's own kernels.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import Hull, ShapeKind, shape_row
from armguard.geometry.shapes.hull import distinct
from armguard.kernel import kernel
from armguard.robot.fitting.overreach import farthest
from armguard.robot.fitting.triangle_tree import triangle_tree

Floats = NDArray[np.float64]

SPHERE, HULL = int(ShapeKind.SPHERE), int(ShapeKind.HULL)

# Spacing of samples on a piece, as a share of the mesh's size [-].
SPACING = 0.01

# Growth for round-off in the distances that are compared, and the distance up to which
# two surfaces are the same, as shares of the mesh's size [-].
ROUND_OFF = 1e-9
SAME = 1e-6

# Pieces that meet at a cut count as overlapping if grown by this share [-].
SEAM = 1e-4


def growths(triangles: Floats, hulls: Sequence[Hull]) -> list[float]:
    """Growth of each hull that brings every vertex of a mesh into one of them [m].

    Args:
        triangles: Corners of the mesh, shape (n, 3, 3) [m].
        hulls: The pieces.
    """
    points, _ = distinct(triangles.reshape(-1, 3))
    rows = np.array([shape_row(hull) for hull in hulls])
    found = np.zeros(len(hulls))
    grow_to(points, rows, found)
    slack = ROUND_OFF * size_of(triangles)
    return [float(g) + slack if g > 0.0 else 0.0 for g in found]


def overreach(
    triangles: Floats, hulls: Sequence[Hull], grown: Sequence[float]
) -> list[float]:
    """How far each grown hull's share of their surface is from a mesh, at most [m].

    Measured at samples, plus their spacing; 0 where hull and mesh are one.

    Args:
        triangles: Corners of the mesh, shape (n, 3, 3) [m].
        hulls: The pieces.
        grown: How far each is grown [m].
    """
    size = size_of(triangles)
    if size == 0.0:
        return list(grown)
    rows = np.array([shape_row(hull) for hull in hulls])
    rows[:, 0] = np.asarray(grown) + SEAM * size
    kinds = np.full(len(hulls), HULL, dtype=np.int32)
    tree = triangle_tree(triangles)
    found = []
    for k, (hull, growth) in enumerate(zip(hulls, grown, strict=True)):
        samples = surface_samples(hull.vertices, SPACING * size)
        far = float(farthest(k, samples, rows, kinds, *tree))
        found.append(growth + (far + SPACING * size if far > SAME * size else 0.0))
    return found


def size_of(triangles: Floats) -> float:
    """Longest edge of the box around triangles [m]."""
    return float(np.ptp(triangles.reshape(-1, 3), axis=0).max())


def surface_samples(vertices: Floats, spacing: float) -> Floats:
    """Points on a hull's surface, none of it farther than `spacing` from one.

    A flat hull is sampled at its vertices alone.
    """
    # Scaled to the unit box: qhull's tolerances are absolute.
    scaled = (vertices - vertices.min(axis=0)) / np.ptp(vertices, axis=0).max()
    hull = convex_hull(scaled)
    if hull is None:
        return vertices
    faces = vertices[hull.simplices]
    edges = faces - np.roll(faces, 1, axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    steps = np.maximum(np.ceil(longest / spacing).astype(int), 1)
    found = []
    for n in np.unique(steps):
        u, v = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inside = u + v <= n
        weights = np.column_stack([u[inside], v[inside], (n - u - v)[inside]]) / n
        found.append((weights @ faces[steps == n]).reshape(-1, 3))
    return np.ascontiguousarray(np.concatenate(found))


@kernel(inline=False, entry=True)
def grow_to(points: Floats, rows: Floats, out: Floats) -> None:
    """Growth of each hull for the points that are nearest to it.

    Args:
        points: Points, shape (n, 3) [m].
        rows: Rows of the hulls, shape (k, 16).
        out: Growth of each, overwritten, shape (k,) [m].
    """
    point = array_at(stack(16), (16,), np.float64)
    witness = array_at(stack(10), (10,), np.float64)
    point[:] = 0.0
    out[:] = 0.0
    for i in range(points.shape[0]):
        point[1], point[2], point[3] = points[i, 0], points[i, 1], points[i, 2]
        nearest, least = 0, np.inf
        for k in range(rows.shape[0]):
            measure(SPHERE, point, HULL, rows[k], witness)
            if witness[0] < least:
                nearest, least = k, witness[0]
            if least <= 0.0:
                break
        out[nearest] = max(out[nearest], least)
