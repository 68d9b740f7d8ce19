"""Triangles of what the check measures: rows of the tables, grown or not.

Every shape is a convex core grown by a radius, so one way draws them all: points whose
hull is the core, each with a small sphere around it, and the hull of that.
"""

import ctypes
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from armguard.geometry.core_support import core_support
from armguard.geometry.shapes import ShapeKind

Floats = NDArray[np.float64]
Faces = NDArray[np.int64]

# Points round a cylinder or a cone.
ROUND = 32

# Edge of the square that stands for a half-space [m].
GROUND = 4.0

# Thinner than this a core has no hull of its own and is given a little body [m].
THIN = 5e-4


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles.

    Attributes:
        vertices: Corners, shape (v, 3) [m].
        faces: Corners of each triangle, shape (f, 3).
    """

    vertices: Floats
    faces: Faces


@cache
def ball(subdivisions: int) -> Floats:
    """Directions all around, shape (d, 3)."""
    import trimesh

    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(sphere.vertices, dtype=np.float64)


def core_points(kind: int, row: Floats) -> Floats:
    """Points whose convex hull is, or closely is, the core of a primitive, (k, 3)."""
    origin, R = row[1:4], row[7:16].reshape(3, 3)
    if kind == ShapeKind.SPHERE:
        return origin[None]
    if kind == ShapeKind.CAPSULE:
        return np.stack([origin, row[4:7]])
    if kind == ShapeKind.TRIANGLE:
        return np.stack([origin, row[4:7], row[7:10]])
    if kind == ShapeKind.BOX:
        corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        local = corners * row[4:7]
    elif kind in (ShapeKind.CYLINDER, ShapeKind.CONE):
        local = np.concatenate(
            [ring(row[4], -row[5]), ring(row[6], row[5])],
        )
    elif kind == ShapeKind.ELLIPSOID:
        local = ball(3) * row[4:7]
    elif kind == ShapeKind.HULL:
        # All x, then all y, then all z, where the row says.
        count = int(row[5])
        numbers = (ctypes.c_double * (3 * count)).from_address(int(row[4]))
        local = np.array(numbers).reshape(3, count).T
    elif kind == ShapeKind.HALF_SPACE:
        return ground(origin, row[4:7])
    else:
        # Of what only its support function knows, the farthest points all around.
        far = [core_support(kind, row, tuple(d)) for d in ball(3).tolist()]
        return np.asarray(origin + np.array(far))
    return np.asarray(origin + local @ R.T, dtype=np.float64)


def ring(radius: float, height: float) -> Floats:
    """Points of a circle about z, shape (ROUND, 3)."""
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    flat = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.column_stack([flat, np.full(ROUND, height)])


def ground(origin: Floats, normal: Floats) -> Floats:
    """A slab below a plane, shape (8, 3)."""
    aside = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.cross(normal, aside)
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    half = GROUND / 2.0
    square = [a * half * x + b * half * y for a in (-1, 1) for b in (-1, 1)]
    return np.array([origin + p - d * normal for p in square for d in (0.0, 0.01)])


def mesh_of(kind: int, row: Floats, grown: float = 0.0) -> Mesh:
    """Triangles around a primitive.

    Args:
        kind: Its kind.
        row: Its row, in the frame the triangles are to be in, shape (16,).
        grown: How far they are to stay outside of its surface [m].
    """
    points = core_points(kind, row)
    radius = float(row[0]) + grown
    if radius > 0.0:
        around = ball(3 if len(points) <= 2 else 2 if len(points) <= 8 else 1)
        points = (points[:, None] + radius * around[None]).reshape(-1, 3)
    return hull_mesh(points)


def hull_mesh(points: Floats) -> Mesh:
    """Triangles of a convex hull, turned outwards."""
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=THIN) < 3:
        points = (points[:, None] + THIN * ball(0)[None]).reshape(-1, 3)
    hull = ConvexHull(points)
    vertices = points[hull.vertices]
    place = np.zeros(len(points), dtype=np.int64)
    place[hull.vertices] = np.arange(len(hull.vertices))
    faces = place[hull.simplices]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outward = hull.equations[:, :3]
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), outward) < 0.0
    faces[turned] = faces[turned][:, ::-1]
    return Mesh(vertices, faces)


def joined(meshes: list[Mesh]) -> Mesh:
    """Several as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate(
            [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
        ),
    )


def thinned(mesh: Mesh, most: int) -> Mesh:
    """The same with fewer triangles: corners in one cell of a grid become one.

    Args:
        mesh: What is drawn.
        most: Triangles it may have.
    """
    cell = 1e-3
    thin = mesh
    while len(thin.faces) > most:
        _, place, count = np.unique(
            np.round(mesh.vertices / cell).astype(np.int64),
            axis=0,
            return_inverse=True,
            return_counts=True,
        )
        vertices = np.zeros((len(count), 3))
        np.add.at(vertices, place.reshape(-1), mesh.vertices)
        faces = place.reshape(-1)[mesh.faces]
        a, b, c = faces.T
        kept = faces[(a != b) & (b != c) & (c != a)]
        thin = Mesh(vertices / count[:, None], kept)
        cell *= 1.5
    return thin
