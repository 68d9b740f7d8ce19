"""Where triangles come from: a file, or arrays of vertices and faces."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.bounded import is_file
from armguard.errors import MeshError
from armguard.robot.meshes import check_corners, load_triangles
from armguard.robot.model import MeshFile
from armguard.scene.meshes.stl import BLOCK, binary_stl_blocks, binary_stl_count

Floats = NDArray[np.float64]

MeshInput = str | Path | tuple[ArrayLike, ArrayLike]

Progress = Callable[[str, int, int], None]

# Triangles a mesh may have unless the caller says otherwise. In a guard each takes
# about half a kilobyte, so this many are some 5 GB.
MAX_TRIANGLES = 10_000_000

# The same for a mesh of a scene file; it may ask for as many as `MAX_TRIANGLES`.
MAX_TRIANGLES_OF_FILE = 2_000_000


@dataclass(frozen=True, slots=True)
class TriangleSource:
    """Triangles that have not been read yet.

    Attributes:
        name: What messages call the mesh.
        count: How many triangles.
        blocks: Reads them: an iterator of arrays of shape (n, 3, 3) [m].
    """

    name: str
    count: int
    blocks: Callable[[], Iterator[Floats]]

    def read(self, progress: Progress | None = None) -> Iterator[Floats]:
        """Triangles block by block, shape (n, 3, 3) [m].

        Args:
            progress: Called with what is done, the block's number and their count,
                if there are several.

        Raises:
            MeshError: A corner is not finite.
        """
        total = -(-self.count // BLOCK)
        done = 0
        for number, block in enumerate(self.blocks(), start=1):
            if progress is not None and total > 1:
                progress(f"reading {self.name}", number, total)
            finite = np.isfinite(block).all(axis=(1, 2))
            if not finite.all():
                bad = int(np.flatnonzero(~finite)[0])
                raise MeshError(
                    f"mesh '{self.name}' has a corner that is not finite, in triangle "
                    f"{done + bad}; mend the mesh"
                )
            check_corners(self.name, block)
            done += len(block)
            yield block

    def triangles(self, progress: Progress | None = None) -> Floats:
        """All triangles, shape (count, 3, 3) [m].

        Raises:
            MeshError: A corner is not finite.
        """
        return np.concatenate(list(self.read(progress)))


def open_mesh(
    mesh: MeshInput,
    *,
    scale: float | Sequence[float] = 1.0,
    max_triangles: int = MAX_TRIANGLES,
) -> TriangleSource:
    """A mesh, ready to be read.

    Binary STL is only looked at; other formats are small or have to be read as a whole.

    Args:
        mesh: A file, or vertices of shape (v, 3) [m] and faces of shape (n, 3).
        scale: Factor, or one for each axis [-].
        max_triangles: More than this many are refused.

    Raises:
        MeshError: The mesh cannot be read, is empty, not finite or too large.
    """
    factors = checked_scale(scale)
    if isinstance(mesh, str | Path):
        source = open_file(Path(mesh), factors)
    else:
        source = open_arrays(mesh, factors)
    if source.count == 0:
        raise MeshError(f"mesh '{source.name}' has no triangle")
    if source.count > max_triangles:
        raise MeshError(
            f"mesh '{source.name}' has {source.count:,} triangles; the limit is "
            f"{max_triangles:,}: raise `max_triangles`, at about half a kilobyte of "
            "memory each, or make the mesh coarser"
        )
    return source


def checked_scale(scale: float | Sequence[float]) -> Floats:
    """Factors of the three axes, shape (3,) [-].

    Raises:
        MeshError: One is zero or not finite.
    """
    values = scale if isinstance(scale, Sequence) else (scale,) * 3
    if len(values) != 3 or not all(isfinite(v) and v != 0.0 for v in values):
        raise MeshError(
            f"mesh scale is {scale}; it must be a number other than 0, or three"
        )
    return np.array(values, dtype=np.float64)


def open_file(path: Path, factors: Floats) -> TriangleSource:
    """A mesh file."""
    if not is_file(path):
        raise MeshError(f"mesh '{path.name}' is not there: {path} is no file")
    try:
        count = binary_stl_count(path) if path.suffix.lower() == ".stl" else None
    except OSError as error:
        raise MeshError(
            f"mesh '{path.name}' cannot be read: {error.strerror}"
        ) from None
    if count is not None:
        return TriangleSource(
            path.name, count, lambda: binary_stl_blocks(path, count, factors)
        )
    triangles = load_triangles(MeshFile(path)) * factors
    return TriangleSource(path.name, len(triangles), lambda: in_blocks(triangles))


def open_arrays(arrays: tuple[ArrayLike, ArrayLike], factors: Floats) -> TriangleSource:
    """A mesh in memory.

    Raises:
        MeshError: A shape is wrong, or a face names a vertex that is not there.
    """
    name = "(vertices, faces)"
    vertices = np.asarray(arrays[0], dtype=np.float64)
    faces = np.asarray(arrays[1])
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise MeshError(f"mesh vertices have shape {vertices.shape}; it must be (v, 3)")
    if faces.size == 0:
        return TriangleSource(name, 0, lambda: iter(()))
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise MeshError(
            f"mesh faces are {faces.dtype} of shape {faces.shape}; they must be whole "
            "numbers of shape (n, 3)"
        )
    low, high = int(faces.min()), int(faces.max())
    if low < 0 or high >= len(vertices):
        raise MeshError(
            f"mesh faces name vertex {low if low < 0 else high}; there are "
            f"{len(vertices)}, from 0 on"
        )
    scaled = vertices * factors
    return TriangleSource(
        name,
        len(faces),
        lambda: (scaled[faces[k : k + BLOCK]] for k in range(0, len(faces), BLOCK)),
    )


def in_blocks(triangles: Floats) -> Iterator[Floats]:
    """Triangles in memory, block by block."""
    for start in range(0, len(triangles), BLOCK):
        yield triangles[start : start + BLOCK]
