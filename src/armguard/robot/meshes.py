"""Meshes on disk to triangles."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import MeshError
from armguard.robot.model import MeshFile

Floats = NDArray[np.float64]

FORMATS = (".stl", ".obj", ".dae", ".ply")


def load_triangles(mesh: MeshFile) -> Floats:
    """Triangles of a mesh file, in metres, with the file's own transforms applied.

    Args:
        mesh: The file and its scale.

    Returns:
        Corners, shape (n, 3, 3) [m].

    Raises:
        MeshError: The file cannot be read, is empty, or holds numbers that are none.
    """
    import trimesh

    name = mesh.path.name
    if mesh.path.suffix.lower() not in FORMATS:
        raise MeshError(
            f"mesh '{name}' is no {', '.join(FORMATS)}; convert it to one of these"
        )
    try:
        loaded: Any = trimesh.load(str(mesh.path), process=False)
    except Exception as error:  # each loader has its own errors
        raise MeshError(f"mesh '{name}' cannot be read: {error}") from None
    if isinstance(loaded, trimesh.Scene):
        loaded = loaded.to_mesh() if len(loaded.geometry) else None
    triangles = np.zeros((0, 3, 3))
    if loaded is not None and hasattr(loaded, "triangles"):
        triangles = np.array(loaded.triangles, dtype=np.float64)
    if len(triangles) == 0:
        raise MeshError(f"mesh '{name}' has no triangle")
    triangles *= np.array(mesh.scale)
    if not np.isfinite(triangles).all():
        raise MeshError(f"mesh '{name}' has a corner that is not finite")
    return triangles
