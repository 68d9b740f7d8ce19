"""Poses as the page wants them, and nodes that are only told what changed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def quaternion(R: Floats) -> Floats:
    """A rotation as the unit quaternion w, x, y, z, by Shepperd's method.

    Args:
        R: Rotation, shape (3, 3).
    """
    squares = np.array(
        [
            R[0, 0] + R[1, 1] + R[2, 2],
            R[0, 0] - R[1, 1] - R[2, 2],
            R[1, 1] - R[0, 0] - R[2, 2],
            R[2, 2] - R[0, 0] - R[1, 1],
        ]
    )
    largest = int(np.argmax(squares))
    w = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    sums = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    big = 1.0 + squares[largest]
    rows = (
        (big, *w),
        (w[0], big, sums[0], sums[1]),
        (w[1], sums[0], big, sums[2]),
        (w[2], sums[1], sums[2], big),
    )
    q = np.array(rows[largest])
    return np.asarray(q / np.linalg.norm(q))


class Placer:
    """Moves nodes, and sends nothing for one that is where it was.

    Args:
        nodes: Handles of nodes; None where a body has nothing to show.
    """

    def __init__(self, nodes: list[Any | None]) -> None:
        self._nodes = nodes
        self._shown = np.full((len(nodes), 12), np.nan)

    def move(self, poses: Floats) -> None:
        """Put the nodes where bodies are, rows of [R | p], shape (b, 12)."""
        for k in np.flatnonzero((poses != self._shown).any(axis=1)):
            node = self._nodes[k]
            if node is None:
                continue
            T = poses[k].reshape(3, 4)
            node.position = T[:, 3]
            node.wxyz = quaternion(T[:, :3])
        self._shown[:] = poses
