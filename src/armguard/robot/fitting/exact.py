"""The second, exact stage of a link's geometry: hulls of meshes, true cylinders."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from armguard.geometry import shapes as convex
from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Hull, PlacedShape
from armguard.geometry.shapes.hull import distinct
from armguard.robot.fitting.hull_reach import hull_reach
from armguard.robot.fitting.proof import inside, quartered, uncovered
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Cylinder, Link, MeshFile

Floats = NDArray[np.float64]

# Pieces of a hull's faces whose corners are tried before the proof.
TRIES = 10_000


def exact_shapes(link: Link) -> tuple[PlacedShape, ...]:
    """Collision geometry of a link as convex shapes; empty if it needs no fit.

    A mesh is represented by its convex hull, which holds the mesh; how far it reaches
    beyond it is the model error of the shape.
    """
    if not any(isinstance(e.geometry, Cylinder | MeshFile) for e in link.collisions):
        return ()
    found = []
    for element in link.collisions:
        pose = Pose.from_matrix(element.T_link_geometry)
        geometry = element.geometry
        if isinstance(geometry, MeshFile):
            data = load_triangles(geometry).tobytes()
            found.append(replace(mesh_hull(data), pose=pose))
        elif isinstance(geometry, Cylinder):
            cylinder = convex.Cylinder(radius=geometry.radius, height=geometry.length)
            found.append(PlacedShape(cylinder, pose))
        else:
            found.append(PlacedShape(geometry, pose))
    return tuple(found)


@lru_cache(maxsize=4)
def mesh_hull(triangles: bytes) -> PlacedShape:
    """Hull of a mesh, which links may share, with its model error.

    Args:
        triangles: Corners of the triangles, as bytes [m].
    """
    corners = np.frombuffer(triangles).reshape(-1, 3, 3)
    hull = Hull(points=corners.reshape(-1, 3))
    return PlacedShape(hull, model_error=hull_reach(hull_faces(hull), corners))


def hulls_are_contained(
    exact: Sequence[PlacedShape], shapes: Sequence[PlacedShape]
) -> bool:
    """Whether the whole surface of every hull is proven to lie in the primitives.

    Cylinders and the other shapes lie in their primitives by construction.
    """
    for placed in exact:
        if isinstance(placed.shape, Hull):
            T = placed.pose.matrix()
            faces = hull_faces(placed.shape) @ T[:3, :3].T + T[:3, 3]
            if sticks_out(faces, shapes) or len(uncovered(faces, shapes)):
                return False
    return True


def sticks_out(faces: Floats, shapes: Sequence[PlacedShape]) -> bool:
    """Whether a sampled point of the faces lies outside of all primitives.

    It refutes in milliseconds what a proof by subdivision gives up after seconds.
    """
    while len(faces) < TRIES:
        faces = quartered(faces)
    points, _ = distinct(faces.reshape(-1, 3))
    held = np.zeros(len(points), dtype=np.bool_)
    for placed in shapes:
        held |= inside(placed, points)
    return not held.all()


def hull_faces(hull: Hull) -> Floats:
    """Triangles of a hull's surface, shape (n, 3, 3) [m]; of a flat one, its plane."""
    vertices = hull.vertices
    whole = convex_hull(vertices)
    if whole is not None:
        return np.asarray(vertices[whole.simplices])
    # Flat, or fewer than four vertices: a fan holds the whole of it.
    last = len(vertices) - 1
    fan = [(0, k, min(k + 1, last)) for k in range(last)] or [(0, 0, 0)]
    return np.asarray(vertices[np.array(fan)])
