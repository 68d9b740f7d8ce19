"""Binary STL files, read in blocks: of whatever size, only one block is held at a time.

A header of 80 bytes, the count of triangles, then 50 bytes a triangle.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.errors import MeshError

Floats = NDArray[np.float64]

HEADER = 80
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])

# Triangles read at once: about 120 MB while they are turned into float64.
BLOCK = 1 << 20


def binary_stl_count(path: Path) -> int | None:
    """Triangles a binary STL holds, None if the file is text.

    The length tells the two apart: files exist whose binary header begins with
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
        f"mesh '{path.name}' tells of {count:,} triangles and has room for {held:,}; "
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
