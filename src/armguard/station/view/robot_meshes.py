"""How a robot looks: the visuals of its URDF, or what its collision geometry is."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError
from armguard.geometry.shapes import shape_row
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Cylinder, Link, MeshFile, RobotModel
from armguard.robot.packages import find_file
from armguard.robot.urdf_geometry import read_geometry
from armguard.robot.xml_source import Reader, read_xml
from armguard.scene.scene import SceneRobot
from armguard.station.view.surfaces import (
    Mesh,
    hull_mesh,
    joined,
    mesh_of,
    ring,
    thinned,
)

Floats = NDArray[np.float64]

# Triangles of a link that a tablet draws without effort.
MOST = 4000


def link_meshes(robot: SceneRobot) -> dict[str, Mesh]:
    """Triangles of each link that has any, in the link's frame, by its name.

    A link is drawn by its visuals; where it has none, or one that cannot be read, by
    its collision geometry.
    """
    seen = visuals_of(robot.model)
    found = {}
    for name, link in robot.model.links.items():
        parts = seen.get(name) or collisions_of(link)
        if parts:
            found[name] = thinned(joined(parts), MOST)
    return found


def plain_meshes(robot: SceneRobot) -> dict[str, Mesh]:
    """Triangles of each link's collision geometry, in the link's frame, by its name."""
    each = {name: collisions_of(link) for name, link in robot.model.links.items()}
    return {name: joined(parts) for name, parts in each.items() if parts}


def visuals_of(model: RobotModel) -> dict[str, list[Mesh]]:
    """Triangles of the visuals of a robot's file, by link."""
    if model.path is None:
        return {}
    reader = Reader(model.path.name)
    files = partial(find_file, urdf=model.path)
    found: dict[str, list[Mesh]] = {}
    for link in read_xml(model.path, "robot").iterchildren("link"):
        try:
            parts = [
                placed(
                    geometry_mesh(read_geometry(reader, element, files)),
                    reader.origin(element),
                )
                for element in link.iterchildren("visual")
            ]
        except ArmguardError:
            # How it looks decides nothing; its collision geometry will do.
            continue
        found[link.get("name")] = parts
    return found


def collisions_of(link: Link) -> list[Mesh]:
    """Triangles of a link's collision geometry."""
    return [
        placed(geometry_mesh(element.geometry), element.T_link_geometry)
        for element in link.collisions
    ]


def geometry_mesh(geometry: Any) -> Mesh:
    """Triangles of one geometry of a URDF, in its own frame."""
    if isinstance(geometry, MeshFile):
        triangles = load_triangles(geometry)
        vertices, place = np.unique(
            triangles.reshape(-1, 3), axis=0, return_inverse=True
        )
        return Mesh(vertices, place.reshape(-1, 3))
    if isinstance(geometry, Cylinder):
        ends = (-geometry.length / 2.0, geometry.length / 2.0)
        return hull_mesh(np.concatenate([ring(geometry.radius, z) for z in ends]))
    return mesh_of(int(geometry.kind), shape_row(geometry))


def placed(mesh: Mesh, T: Floats) -> Mesh:
    """Triangles in the frame that theirs stands in at T."""
    return Mesh(mesh.vertices @ T[:3, :3].T + T[:3, 3], mesh.faces)
