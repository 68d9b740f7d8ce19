"""Convex pieces kept on disk, by what they were made of."""

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import cache_home

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A convex piece of a mesh.

    Attributes:
        points: Points whose hull it is, shape (n, 3) [m].
        growth: How far the hull is grown so that every vertex of the mesh that is
            nearest to it lies inside [m].
        overreach: How far the grown hull reaches beyond the mesh [m].
    """

    points: Floats
    growth: float
    overreach: float


def piece_key(triangles: Floats, settings: Sequence[object]) -> str:
    """Hash of all that pieces depend on: geometry, settings, and this code."""
    digest = sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    digest.update(repr(tuple(settings)).encode())
    digest.update(triangles.tobytes())
    return digest.hexdigest()[:32]


def path_of(key: str) -> Path:
    """File of a mesh's pieces."""
    return cache_home() / "pieces" / f"{key}.npz"


def read_pieces(key: str) -> tuple[Piece, ...] | None:
    """Kept pieces; None if there are none, or none that can be read."""
    try:
        with np.load(path_of(key)) as held:
            ends = np.cumsum(held["counts"])[:-1]
            return tuple(
                Piece(points, float(growth), float(overreach))
                for points, growth, overreach in zip(
                    np.split(held["points"], ends),
                    held["growth"],
                    held["overreach"],
                    strict=True,
                )
            )
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None


def write_pieces(key: str, pieces: Sequence[Piece]) -> None:
    """Keep pieces; a cache that cannot be written is no reason to stop."""
    path = path_of(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            np.savez(
                file,
                points=np.concatenate([p.points for p in pieces]),
                counts=np.array([len(p.points) for p in pieces]),
                growth=np.array([p.growth for p in pieces]),
                overreach=np.array([p.overreach for p in pieces]),
            )
        Path(name).replace(path)
    except OSError:
        return
