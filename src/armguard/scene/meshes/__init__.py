"""Meshes in a scene: as triangles, as a hull, or as convex pieces."""

from armguard.scene.meshes.pieces import (
    MeshForm,
    convex_pieces,
    mesh_hull,
    mesh_parts,
)
from armguard.scene.meshes.source import (
    MAX_TRIANGLES,
    MeshInput,
    Progress,
    TriangleSource,
    open_mesh,
)
from armguard.scene.meshes.surface import Surface

__all__ = [
    "MAX_TRIANGLES",
    "MeshForm",
    "MeshInput",
    "Progress",
    "Surface",
    "TriangleSource",
    "convex_pieces",
    "mesh_hull",
    "mesh_parts",
    "open_mesh",
]
