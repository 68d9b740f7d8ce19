"""A link's surface in small convex parts, where its meshes are hollow.

A hull closes the hollows of a mesh, and two links may stay apart although the hull of
one overlaps the other. The hulls of a few neighbouring triangles follow the mesh. They
hold its surface and not what it encloses; `armguard.prove.search`
explains what that is worth.
"""

from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Hull, PlacedShape
from armguard.robot.meshes import load_triangles
from armguard.robot.model import FittedLink, Link, MeshFile

Floats = NDArray[np.float64]

# Parts of a link's meshes.
PARTS = 64

# Longest edge of a triangle before the parts are made, as a share of the mesh's size.
EDGE = 0.05


def surface_parts(link: Link, fit: FittedLink) -> tuple[PlacedShape, ...]:
    """Convex shapes that hold a link's surface; empty if it has no meshes.

    Args:
        link: The link.
        fit: Its shapes; the exact ones stand in the order of its collision elements.
    """
    meshes = [isinstance(e.geometry, MeshFile) for e in link.collisions]
    if not any(meshes):
        return ()
    found: list[PlacedShape] = []
    for element, exact in zip(link.collisions, fit.exact, strict=True):
        if not isinstance(element.geometry, MeshFile):
            found.append(exact)
            continue
        pose = Pose.from_matrix(element.T_link_geometry)
        parts = cut(fine_triangles(element.geometry), max(PARTS // sum(meshes), 1))
        found += [PlacedShape(Hull(points=part), pose) for part in parts]
    return tuple(found)


def fine_triangles(mesh: MeshFile) -> Floats:
    """Triangles of a mesh, divided until none is long, shape (n, 3, 3) [m]."""
    from trimesh.remesh import subdivide_to_size

    triangles = load_triangles(mesh)
    points = triangles.reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    faces = np.arange(len(points)).reshape(-1, 3)
    vertices, faces = subdivide_to_size(points, faces, EDGE * size, max_iter=20)
    corners: Floats = np.asarray(vertices, dtype=np.float64)[faces]
    return corners


def cut(triangles: Floats, parts: int) -> list[Floats]:
    """Corners of neighbouring triangles, the part with the largest hull halved first.

    Args:
        triangles: Triangles, shape (n, 3, 3) [m].
        parts: How many parts to make at most.
    """
    waiting = [(-hull_volume(triangles), 0, triangles)]
    made = 1
    while len(waiting) < parts and len(waiting[0][2]) > 1:
        _, _, part = heappop(waiting)
        middles = part.mean(axis=1)
        away = middles - middles.mean(axis=0)
        _, _, axes = np.linalg.svd(away, full_matrices=False)
        order = np.argsort(away @ axes[0])
        for half in (order[: len(order) // 2], order[len(order) // 2 :]):
            heappush(waiting, (-hull_volume(part[half]), made, part[half]))
            made += 1
    return [part.reshape(-1, 3) for _, _, part in waiting]


def hull_volume(triangles: Floats) -> float:
    """Volume of the hull of triangles; 0 if they are flat [m³]."""
    hull = convex_hull(triangles.reshape(-1, 3))
    return 0.0 if hull is None else float(hull.volume)
