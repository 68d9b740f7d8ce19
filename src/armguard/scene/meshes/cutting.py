"""Cutting a mesh into convex pieces with coacd, in a process of its own.

coacd ends its process over a mesh it cannot cut; a guard must not end with it.
"""

import subprocess
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.errors import MeshError

Floats = NDArray[np.float64]

CHILD = Path(__file__).with_name("coacd_child.py")


def find_version() -> str | None:
    """Version of coacd, None if it is not installed."""
    try:
        return version("coacd")
    except PackageNotFoundError:
        return None


def coacd_version() -> str:
    """Version of coacd.

    Raises:
        MeshError: It is not installed.
    """
    found = find_version()
    if found is None:
        raise MeshError(
            "cutting a mesh into convex pieces needs coacd; install it with "
            "`pip install 'armguard[fit]'`, or give the mesh as 'hull' or 'triangles'"
        )
    return found


def cut_into_pieces(
    name: str, triangles: Floats, concavity: float, max_pieces: int | None
) -> list[Floats]:
    """Points of each convex piece, shape (k, 3) [m].

    Args:
        name: What messages call the mesh.
        triangles: Corners, shape (n, 3, 3) [m].
        concavity: Threshold of coacd [-].
        max_pieces: Pieces to stay below, None for as many as it takes.

    Raises:
        MeshError: coacd failed.
    """
    vertices, faces = welded(triangles)
    # In the unit box: tolerances are absolute.
    low = vertices.min(axis=0)
    size = float(np.ptp(vertices, axis=0).max())
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder, "mesh.npz"), Path(folder, "pieces.npz")
        np.savez(given, vertices=(vertices - low) / size, faces=faces)
        ended = subprocess.run(
            [
                *(sys.executable, "-P", str(CHILD), str(given), str(made)),
                *(str(concavity), str(-1 if max_pieces is None else max_pieces)),
            ],
            capture_output=True,
            text=True,
            check=False,
        )
        if ended.returncode != 0 or not made.is_file():
            said = ended.stderr.strip().splitlines()
            raise MeshError(
                f"coacd could not cut mesh '{name}' (exit code {ended.returncode}"
                + (f": {said[-1]}" if said else "")
                + "); fix the mesh, try another concavity, or give it as 'hull' or "
                "'triangles'"
            )
        with np.load(made) as held:
            pieces = [held[key] for key in held.files]
    return [points * size + low for points in pieces]


def welded(triangles: Floats) -> tuple[Floats, NDArray[np.int32]]:
    """Vertices and faces of triangles; those that are a line by their corners are left.

    Args:
        triangles: Corners, shape (n, 3, 3) [m].

    Returns:
        Vertices, shape (v, 3) [m], and faces, shape (m, 3).
    """
    vertices, inverse = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = inverse.reshape(-1, 3).astype(np.int32)
    a, b, c = faces.T
    return vertices, faces[(a != b) & (b != c) & (c != a)]
