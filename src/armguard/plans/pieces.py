"""Convex pieces of swept volumes, their meshes and files of these."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError
from armguard.geometry.convex_hull import mesh_library

Floats = NDArray[np.float64]

# Kinds of files.
FORMATS = ("glb", "stl", "ply")


@dataclass(frozen=True)
class Piece:
    """A convex piece of a swept volume: all x with normals · x <= heights.

    Attributes:
        link: 'robot/link'.
        start: When the part begins that it holds the link's primitive in [s].
        end: When that ends [s].
        inside: A point within, shape (3,) [m].
        normals: Unit normals of its planes, shape (k, 3).
        heights: Their heights, shape (k,) [m].
    """

    link: str
    start: float
    end: float
    inside: Floats
    normals: Floats
    heights: Floats

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Whether points are within, shape (n,).

        Args:
            points: Shape (n, 3) [m].
        """
        return np.asarray((points @ self.normals.T <= self.heights).all(axis=1))

    @cached_property
    def corners(self) -> Floats:
        """Its corners, shape (m, 3) [m].

        Raises:
            ModelError: SciPy is not installed.
        """
        planes = np.column_stack((self.normals, -self.heights))
        cut = mesh_library("scipy.spatial").HalfspaceIntersection(planes, self.inside)
        return np.asarray(cut.intersections, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Span:
    """A time in which pieces of a link follow one another.

    Attributes:
        link: 'robot/link'.
        start: When it begins [s].
        end: When it ends [s].
    """

    link: str
    start: float
    end: float


def spans(pieces: Iterable[Piece]) -> list[Span]:
    """The times of pieces, joined where those of a link follow or overlap."""
    found: list[Span] = []
    for piece in sorted(pieces, key=lambda one: (one.link, one.start)):
        last = found[-1] if found else None
        if last is not None and last.link == piece.link and piece.start <= last.end:
            found[-1] = Span(last.link, last.start, max(last.end, piece.end))
        else:
            found.append(Span(piece.link, piece.start, piece.end))
    return sorted(found, key=lambda one: one.start)


def write_pieces(pieces: Iterable[Piece], path: Path) -> None:
    """Write a mesh of each link, which is all of its pieces: GLB, STL or PLY.

    A GLB file has a node for each link. Pieces overlap where they follow one another.

    Raises:
        TrajectoryError: The file is of another kind.
        ModelError: trimesh is not installed.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise TrajectoryError(
            f"'{path.name}' is no {', '.join(FORMATS)}; give a file of such a kind"
        )
    trimesh = mesh_library("trimesh")
    by_link: dict[str, list[Any]] = {}
    for piece in pieces:
        mesh = trimesh.convex.convex_hull(piece.corners)
        by_link.setdefault(piece.link, []).append(mesh)
    meshes = {link: trimesh.util.concatenate(own) for link, own in by_link.items()}
    made = trimesh.Scene(meshes)
    whole = made if kind == "glb" else made.to_mesh()
    path.write_bytes(whole.export(file_type=kind))
