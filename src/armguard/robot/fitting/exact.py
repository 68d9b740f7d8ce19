"""The second, exact stage of a link's geometry: hulls of meshes, true cylinders."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from armguard.geometry import shapes as convex
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Hull, PlacedShape
from armguard.robot.fitting.hull_reach import (
    DEPTH,
    SHARE,
    SLACK,
    bound_pieces,
    hull_reach,
)
from armguard.robot.fitting.proof import inside, quartered, uncovered
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Cylinder, Link, MeshFile

Floats = NDArray[np.float64]

# A mesh of more triangles is bounded region by region, each with the triangles near it.
DENSE = 12_000

# Largest radius of a first piece of a hull's surface, and edge of a region [m].
PIECE = 0.008
REGION = 0.02

# Pieces at a time after which the bound is left as it is.
MOST_PIECES = 200_000

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
            triangles = load_triangles(geometry)
            hull = Hull(points=triangles.reshape(-1, 3))
            reach = dent_depth(hull_faces(hull), triangles)
            found.append(PlacedShape(hull, pose, reach))
        elif isinstance(geometry, Cylinder):
            cylinder = convex.Cylinder(radius=geometry.radius, height=geometry.length)
            found.append(PlacedShape(cylinder, pose))
        else:
            found.append(PlacedShape(geometry, pose))
    return tuple(found)


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
    points = np.unique(faces.reshape(-1, 3), axis=0)
    held = np.zeros(len(points), dtype=np.bool_)
    for placed in shapes:
        held |= inside(placed, points)
    return not held.all()


def dent_depth(faces: Floats, triangles: Floats) -> float:
    """Bound on the distance of a hull's surface to the mesh it holds [m].

    The bound of `hull_reach`, by the same branch and bound. Over a dense mesh it is
    found region by region of the surface: each is compared only with the triangles that
    may be nearest to one of its points, and left out as soon as its distance to the
    mesh's corners shows that it cannot raise the bound.

    Args:
        faces: Triangles of the hull's surface, shape (m, 3, 3) [m].
        triangles: Triangles of the mesh, shape (n, 3, 3) [m].
    """
    if len(triangles) <= DENSE:
        return hull_reach(faces, triangles)
    left, radius = faces, radii(faces)
    while (radius > PIECE).any():
        wide = radius > PIECE
        left = np.concatenate([left[~wide], quartered(left[wide])])
        radius = radii(left)
    corners = cKDTree(np.unique(triangles.reshape(-1, 3), axis=0))
    found = 0.0
    for level in range(DEPTH + 1):
        most = corners.query(left.mean(axis=1))[0] + radii(left)
        found = bound_regions(left, triangles, most, found)
        enough = found + max(SHARE * found, SLACK)
        open_ = most > enough
        if not open_.any():
            return enough
        if level == DEPTH or 4 * int(open_.sum()) > MOST_PIECES:
            break
        left = quartered(left[open_])
    return float(most.max())


def bound_regions(
    pieces: Floats, triangles: Floats, most: Floats, found: float
) -> float:
    """Bound the distances of pieces to a mesh, region by region.

    Args:
        pieces: Corners, shape (k, 3, 3) [m].
        triangles: Triangles of the mesh, shape (n, 3, 3) [m].
        most: Bounds on the pieces' distances, shape (k,); lowered [m].
        found: Largest distance of a corner that is known [m].

    Returns:
        The largest distance of a corner, `found` included [m].
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    cells = np.floor(pieces.mean(axis=1) / REGION).astype(np.int64)
    _, region = np.unique(cells, axis=0, return_inverse=True)
    region = region.ravel()
    greatest = np.zeros(int(region.max()) + 1)
    np.maximum.at(greatest, region, most)
    for k in np.argsort(-greatest, kind="stable"):
        own = np.flatnonzero((region == k) & (most > found + max(SHARE * found, SLACK)))
        if len(own) == 0:
            continue
        ends = pieces[own].reshape(-1, 3)
        reach = most[own].max()
        near = (low <= ends.max(axis=0) + reach).all(axis=1)
        near &= (high >= ends.min(axis=0) - reach).all(axis=1)
        bounds = np.zeros((len(own), 2))
        bound_pieces(pieces[own], triangles[near], low[near], high[near], bounds)
        found = max(found, float(bounds[:, 0].max()))
        most[own] = np.minimum(most[own], bounds[:, 1])
    return found


def radii(pieces: Floats) -> Floats:
    """Largest distance of each triangle's corners to their mean, shape (n,) [m]."""
    offset = pieces - pieces.mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.norm(offset, axis=2).max(axis=1))


def hull_faces(hull: Hull) -> Floats:
    """Triangles of a hull's surface, shape (n, 3, 3) [m]; of a flat one, its plane."""
    vertices = hull.vertices
    try:
        return np.asarray(vertices[ConvexHull(vertices).simplices])
    except (QhullError, ValueError):
        # Flat, or fewer than four vertices: a fan holds the whole of it.
        last = len(vertices) - 1
        fan = [(0, k, min(k + 1, last)) for k in range(last)] or [(0, 0, 0)]
        return np.asarray(vertices[np.array(fan)])
