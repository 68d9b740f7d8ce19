"""Where triangles come from: a file, or arrays of vertices and faces.

A binary STL, of whatever size, is read in blocks: a header of 80 bytes, the count of
triangles, then 50 bytes a triangle.
"""

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

Floats = NDArray[np.float64]

MeshInput = str | Path | tuple[ArrayLike, ArrayLike]

Progress = Callable[[str, int, int], None]

# Triangles a mesh may have unless the caller says otherwise. In a guard each takes
# about half a kilobyte, so this many are some 5 GB.
MAX_TRIANGLES = 10_000_000

# The same for a mesh of a scene file; it may declare as many as `MAX_TRIANGLES`.
MAX_TRIANGLES_OF_FILE = 2_000_000

HEADER = 80
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])

# Triangles read at once: about 120 MB while they are turned into float64.
BLOCK = 1 << 20


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
            progress: Called with the step, the block's number and their count,
                if there are several.

        Raises:
            MeshError: A corner is not finite.
        """
        total = -(-self.count // BLOCK)
        done = 0
        for number, block in enumerate(self.blocks(), start=1):
            if progress is not None and total > 1:
                progress(f"reading {self.name}", number, total)
            check_corners(self.name, block, done)
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
    return in_memory(path.name, triangles, np.arange(len(triangles)))


def open_arrays(arrays: tuple[ArrayLike, ArrayLike], factors: Floats) -> TriangleSource:
    """A mesh in memory.

    Raises:
        MeshError: A shape is wrong, or a face names a vertex that is not there.
    """
    name = "(vertices, faces)"
    if len(arrays) != 2:
        raise MeshError(
            f"a mesh of {len(arrays)} arrays; give its vertices and its faces, as in "
            "add_mesh((vertices, faces), name)"
        )
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
    return in_memory(name, vertices * factors, faces)


def in_memory(name: str, rows: Floats, chosen: NDArray[np.integer]) -> TriangleSource:
    """Triangles in memory: those rows of an array that are chosen, block by block."""
    return TriangleSource(
        name,
        len(chosen),
        lambda: (rows[chosen[k : k + BLOCK]] for k in range(0, len(chosen), BLOCK)),
    )


def binary_stl_count(path: Path) -> int | None:
    """Triangles a binary STL holds, None if the file is text.

    The length decides between the two: files exist whose binary header begins with
    'solid', the first word of a text file.

    Raises:
        MeshError: It is neither: the count in its header and its length disagree.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(HEADER + 4)
    if len(head) == HEADER + 4:
        count = int.from_bytes(head[HEADER:], "little")
        if size == HEADER + 4 + count * RECORD.itemsize:
            return count
    if head.lstrip().startswith(b"solid"):
        return None
    if len(head) < HEADER + 4:
        raise MeshError(
            f"mesh '{path.name}' is {size} bytes long, too short for an STL; write it "
            "again"
        )
    held = (size - HEADER - 4) // RECORD.itemsize
    raise MeshError(
        f"mesh '{path.name}' announces {count:,} triangles and has room for {held:,}; "
        "it is cut off or no STL; write it again"
    )


def binary_stl_blocks(path: Path, count: int, factors: Floats) -> Iterator[Floats]:
    """Its triangles, block by block, each of shape (n, 3, 3) [m].

    Args:
        path: The file.
        count: Triangles in it.
        factors: Scale of each axis, shape (3,) [-].

    Raises:
        MeshError: The file ends early: it was changed meanwhile.
    """
    with path.open("rb") as file:
        file.seek(HEADER + 4)
        for start in range(0, count, BLOCK):
            wanted = min(BLOCK, count - start)
            records = np.fromfile(file, dtype=RECORD, count=wanted)
            if len(records) != wanted:
                raise MeshError(
                    f"mesh '{path.name}' ends after {start + len(records):,} of "
                    f"{count:,} triangles; write it again"
                )
            corners = records["corners"].astype(np.float64)
            corners *= factors
            yield corners
