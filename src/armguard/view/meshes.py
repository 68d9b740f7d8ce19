"""Triangles of drawn shapes: primitives as the check measures them, links, visuals.

Every shape is a convex core grown by a radius, so one way draws them all: points whose
hull is the core, each with a small sphere around it, and the hull of that.
"""

from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.creation import icosphere
from trimesh.util import concatenate

from armguard.errors import ArmguardError
from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.core_support import core_support
from armguard.geometry.shapes import ShapeKind, shape_row
from armguard.plans.sweep import points_of
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Cylinder, Link, MeshFile, RobotModel
from armguard.robot.packages import find_file
from armguard.robot.urdf_geometry import read_geometry
from armguard.robot.xml_source import Reader, parse_xml, read_xml
from armguard.scene.scene import SceneRobot

Floats = NDArray[np.float64]

# Triangles of a link that a tablet draws without effort.
MOST = 4000

# Points round a cylinder or a cone.
ROUND = 32

# Edge of the square that is drawn for a half-space [m].
GROUND = 4.0

# Thinner than this a core has no hull and is given a little body [m].
THIN = 5e-4

BOX_CORNERS = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T


@cache
def directions(subdivisions: int) -> Floats:
    """Unit vectors all around, shape (d, 3)."""
    return np.array(icosphere(subdivisions=subdivisions).vertices, dtype=np.float64)


def core_points(kind: int, row: Floats) -> Floats:
    """Points whose convex hull is, or closely is, the core of a primitive, (k, 3)."""
    origin, R = row[1:4], row[7:16].reshape(3, 3)
    points = points_of(ShapeKind(kind), row)
    if points is not None:
        return points
    if kind == ShapeKind.HALF_SPACE:
        return ground(origin, row[4:7])
    if kind == ShapeKind.BOX:
        local = BOX_CORNERS * row[4:7]
    elif kind in (ShapeKind.CYLINDER, ShapeKind.CONE):
        local = rings(row[4], row[6], row[5])
    elif kind == ShapeKind.ELLIPSOID:
        local = directions(3) * row[4:7]
    else:
        # Of what only its support function knows, the farthest points all around.
        far = [core_support(kind, row, tuple(d)) for d in directions(3).tolist()]
        return np.asarray(origin + np.array(far))
    return np.asarray(origin + local @ R.T, dtype=np.float64)


def rings(lower: float, upper: float, half: float) -> Floats:
    """Points of two circles about z, at -half and half, of those radii [m]."""
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    x, y = np.cos(turn), np.sin(turn)
    ends = ((lower, -half), (upper, half))
    return np.concatenate(
        [np.column_stack([r * x, r * y, np.full(ROUND, z)]) for r, z in ends]
    )


def ground(origin: Floats, normal: Floats) -> Floats:
    """A slab below a plane, shape (8, 3)."""
    x = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    x /= np.linalg.norm(x)
    axes = np.stack([x, np.cross(normal, x), normal])
    size = np.array([GROUND / 2.0, GROUND / 2.0, 0.005])
    return np.asarray(origin + (BOX_CORNERS * size - [0.0, 0.0, 0.005]) @ axes)


def primitive_mesh(kind: int, row: Floats, grown: float = 0.0) -> Trimesh:
    """Triangles around a primitive.

    Args:
        kind: Its kind.
        row: Its row, in the frame the triangles are to be in, shape (16,).
        grown: Distance of the triangles from its surface [m].
    """
    points = core_points(kind, row)
    radius = float(row[0]) + grown
    if radius > 0.0:
        around = directions(3 if len(points) <= 2 else 2 if len(points) <= 8 else 1)
        points = (points[:, None] + radius * around[None]).reshape(-1, 3)
    return hull_mesh(points)


def hull_mesh(points: Floats) -> Trimesh:
    """Triangles of a convex hull, turned outwards."""
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=THIN) < 3:
        points = (points[:, None] + THIN * directions(0)[None]).reshape(-1, 3)
    hull = convex_hull(points)
    faces = np.searchsorted(np.sort(hull.vertices), hull.simplices)
    vertices = points[np.sort(hull.vertices)]
    a, b, c = vertices[faces.T]
    outward = hull.equations[:, :3]
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), outward) < 0.0
    faces[turned] = faces[turned, ::-1]
    return Trimesh(vertices, faces, process=False)


def thinned(mesh: Trimesh, most: int) -> Trimesh:
    """The same with fewer triangles: corners in one cell of a grid become one.

    Args:
        mesh: The drawn mesh.
        most: Triangles it may have.
    """
    cell, thin = 1e-3, mesh
    while len(thin.faces) > most:
        _, place, count = np.unique(
            np.round(mesh.vertices / cell).astype(np.int64),
            axis=0,
            return_inverse=True,
            return_counts=True,
        )
        sums = [np.bincount(place.reshape(-1), x) for x in mesh.vertices.T]
        faces = place.reshape(-1)[mesh.faces]
        kept = np.diff(np.sort(faces)).all(axis=1)
        thin = Trimesh(np.stack(sums, axis=1) / count[:, None], faces[kept])
        cell *= 1.5
    return thin


def link_meshes(robot: SceneRobot, visuals: bool = True) -> dict[str, Trimesh]:
    """Triangles of each link that has any, in the link's frame, by its name.

    Args:
        robot: The robot.
        visuals: Whether to draw links by their visuals; where a link has none, or one
            that cannot be read, and everywhere if not, by its collision geometry.
    """
    seen = visuals_of(robot.model) if visuals else {}
    found = {
        name: seen.get(name) or collisions_of(link)
        for name, link in robot.model.links.items()
    }
    return {
        name: thinned(concatenate(parts), MOST)
        for name, parts in found.items()
        if parts
    }


def visuals_of(model: RobotModel) -> dict[str, list[Trimesh]]:
    """Triangles of the visuals of a robot's file, by link."""
    if model.path is None:
        return {}
    reader = Reader(model.path.name)
    files = partial(find_file, urdf=model.path)
    found: dict[str, list[Trimesh]] = {}
    if model.expanded is None:
        root = read_xml(model.path, "robot")
    else:
        root = parse_xml(model.path, model.expanded, "robot")
    for link in root.iterchildren("link"):
        try:
            found[link.get("name")] = [
                geometry_mesh(read_geometry(reader, element, files)).apply_transform(
                    reader.origin(element)
                )
                for element in link.iterchildren("visual")
            ]
        except ArmguardError:
            # How it looks decides nothing; its collision geometry will do.
            continue
    return found


def collisions_of(link: Link) -> list[Trimesh]:
    """Triangles of a link's collision geometry."""
    return [
        geometry_mesh(element.geometry).apply_transform(element.T_link_geometry)
        for element in link.collisions
    ]


def geometry_mesh(geometry: Any) -> Trimesh:
    """Triangles of one geometry of a URDF, in its own frame."""
    if isinstance(geometry, MeshFile):
        corners = load_triangles(geometry).reshape(-1, 3)
        return Trimesh(corners, np.arange(len(corners)).reshape(-1, 3))
    if isinstance(geometry, Cylinder):
        radius = geometry.radius
        return hull_mesh(rings(radius, radius, geometry.length / 2.0))
    return primitive_mesh(int(geometry.kind), shape_row(geometry))
