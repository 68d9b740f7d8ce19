"""Meshes on disk to triangles."""

import re
from io import BytesIO
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.bounded import read_bytes
from armguard.errors import MeshError
from armguard.geometry.convex_hull import mesh_library
from armguard.robot.model import MeshFile

Floats = NDArray[np.float64]

FORMATS = (".stl", ".obj", ".dae", ".ply")

# Largest mesh file that is read as a whole [byte].
MOST_MESH_BYTES = 50_000_000

# A line that no OBJ needs; cutting a face of many corners into triangles takes minutes.
LONG_LINE = re.compile(rb"[^\n]{10000}")

# Most triangles of such a file, and of a link: fitting takes 2 s for 80,000.
MOST_FACES = 300_000

# A corner farther out is an error of units or of the file [m].
MOST_COORDINATE = 1e6


def load_triangles(mesh: MeshFile) -> Floats:
    """Triangles of a mesh file, in metres, with the file's own transforms applied.

    Args:
        mesh: The file and its scale.

    Returns:
        Corners, shape (n, 3, 3) [m].

    Raises:
        ModelError: trimesh is not installed.
        MeshError: The file cannot be read, is empty or too large, has no area, or
            holds numbers that are no lengths.
    """
    trimesh = mesh_library("trimesh")
    name = mesh.path.name
    if mesh.path.suffix.lower() not in FORMATS:
        raise MeshError(
            f"mesh '{name}' is no {', '.join(FORMATS)}; convert it to one of these"
        )
    kind = mesh.path.suffix.lower().removeprefix(".")
    try:
        data = read_bytes(mesh.path, MOST_MESH_BYTES)
        if kind == "obj" and LONG_LINE.search(data):
            raise MeshError("a face has too many corners")
        # As bytes: with a path, the loader reads files that a mesh names as well.
        loaded: Any = trimesh.load(BytesIO(data), file_type=kind, process=False)
    except OSError as error:
        raise MeshError(
            f"mesh '{name}' cannot be read: {error.strerror or error}"
        ) from None
    except Exception as error:  # each loader has its own errors
        raise MeshError(f"mesh '{name}' cannot be read: {error}") from None
    if isinstance(loaded, trimesh.Scene):
        loaded = loaded.to_mesh() if len(loaded.geometry) else None
    triangles = np.zeros((0, 3, 3))
    if loaded is not None and hasattr(loaded, "triangles"):
        triangles = np.array(loaded.triangles, dtype=np.float64)
    if len(triangles) == 0:
        raise MeshError(f"mesh '{name}' has no triangle")
    if triangles.shape[1:] != (3, 3):
        raise MeshError(f"mesh '{name}' has vertices that are not 3 numbers")
    check_faces(name, len(triangles))
    triangles *= np.array(mesh.scale)
    check_corners(name, triangles)
    sides = triangles[:, 1:] - triangles[:, :1]
    if not np.cross(sides[:, 0], sides[:, 1]).any():
        raise MeshError(
            f"mesh '{name}' has no area: all of its {len(triangles):,} triangles are "
            "points or lines; write it again"
        )
    return triangles


def check_faces(name: str, count: int) -> None:
    """Refuse a mesh, or the meshes of a link, with too many triangles.

    Raises:
        MeshError: There are too many.
    """
    if count > MOST_FACES:
        raise MeshError(
            f"mesh '{name}' has {count:,} triangles; the limit is {MOST_FACES:,}: make "
            "it coarser"
        )


def check_corners(name: str, triangles: Floats, first: int = 0) -> None:
    """Refuse corners that are not finite, or too far away to be metres.

    Args:
        name: What messages call the mesh.
        triangles: Corners, shape (n, 3, 3) [m].
        first: Number of the first of them in the mesh.

    Raises:
        MeshError: There is one.
    """
    farthest = max(float(triangles.max()), -float(triangles.min()))
    if not isfinite(farthest):
        bad = first + int(np.isfinite(triangles).all(axis=(1, 2)).argmin())
        raise MeshError(
            f"mesh '{name}' has a corner that is not finite, in triangle {bad}; fix "
            "the mesh"
        )
    if farthest > MOST_COORDINATE:
        raise MeshError(
            f"mesh '{name}' has a corner at {farthest:.3g} m; the limit is "
            f"{MOST_COORDINATE:g} m: give `scale`, or write it again"
        )
