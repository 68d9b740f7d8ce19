"""Surfaces: triangles that stand still, as many as there are, in one array."""

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.errors import MeshError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import ROW_WIDTH
from armguard.scene.meshes.source import Progress, TriangleSource

Floats = NDArray[np.float64]

# Places of the corners in a triangle's row, see geometry/shapes/row.py.
CORNERS = slice(1, 10)

# Rows that are placed at once.
STRIDE = 1 << 15


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Triangles of a mesh, each a primitive of its own.

    Any soup will do: open, inside-out, with triangles that are a line or a point. A
    surface has no inside; what is within it is as far away as what is outside.

    Attributes:
        rows: Rows of the triangles in the frame of the object, shape (k, 16).
    """

    rows: Floats

    def __len__(self) -> int:
        """How many triangles."""
        return len(self.rows)

    @property
    def triangles(self) -> Floats:
        """Corners, a copy, shape (k, 3, 3) [m]."""
        return self.rows[:, CORNERS].reshape(-1, 3, 3)

    @classmethod
    def read(
        cls,
        source: TriangleSource,
        *,
        pose: Pose | None = None,
        rounding: float = 0.0,
        progress: Progress | None = None,
    ) -> "Surface":
        """The surface of a mesh.

        Args:
            source: Its triangles.
            pose: Frame of the mesh in the object's.
            rounding: Growth of every triangle on all sides [m].
            progress: Called with the step, the number and count of its steps.

        Raises:
            MeshError: A corner or the rounding is not finite.
        """
        if not (isfinite(rounding) and rounding >= 0.0):
            raise MeshError(
                f"mesh '{source.name}' rounding is {rounding} m; it must be finite "
                "and >= 0"
            )
        rows = np.zeros((source.count, ROW_WIDTH))
        rows[:, 0] = rounding
        done = 0
        for block in source.read(progress):
            rows[done : done + len(block), CORNERS] = block.reshape(-1, 9)
            done += len(block)
        if pose is not None:
            place_triangles(rows, pose.matrix(), rows)
        return cls(rows)


def place_triangles(rows: Floats, T: Floats, out: Floats) -> None:
    """Rows of triangles whose frame is at T.

    Args:
        rows: Their rows in that frame, shape (k, 16).
        T: The frame, shape (4, 4).
        out: Rows in the frame in which T is, overwritten, shape (k, 16); may be `rows`.
    """
    R, p = T[:3, :3], T[:3, 3]
    for start in range(0, len(rows), STRIDE):
        part = rows[start : start + STRIDE]
        placed = out[start : start + STRIDE]
        corners = part[:, CORNERS].reshape(-1, 3) @ R.T + p
        placed[:] = part
        placed[:, CORNERS] = corners.reshape(-1, 9)
