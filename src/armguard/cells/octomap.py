"""Trees of OctoMap: files with the ending `.bt`."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.bounded import read_bytes
from armguard.errors import CellMapError
from armguard.kernel import kernel
from armguard.table import Matrix

# Greatest size of a file [byte].
MOST_BYTES = 1 << 28

# Levels of a tree; its root has an edge of 2¹⁶ of the smallest cells, about the origin.
DEPTH = 16

# Two bits that a node has for each of its eight children.
FREE, OCCUPIED, DIVIDED = 1, 2, 3

Grid = NDArray[np.float32]


def read_leaves(path: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Leaves of a tree whose state is known.

    Args:
        path: The file.

    Returns:
        Lower corner and edge of each leaf, shape (n, 4) [m]; whether it is occupied.

    Raises:
        CellMapError: The file cannot be read, or it is no such tree.
    """
    try:
        data = read_bytes(path, MOST_BYTES)
    except OSError as error:
        raise CellMapError(f"cannot read '{path}': {error.strerror}") from None
    header, found, body = data.partition(b"\ndata\n")
    lines = header.decode("ascii", errors="replace").splitlines()
    words = dict(line.split(maxsplit=1) for line in lines if len(line.split()) == 2)
    try:
        resolution = float(words["res"])
    except (KeyError, ValueError):
        resolution = 0.0
    if not found or words.get("id") != "OcTree" or not 0.0 < resolution < np.inf:
        raise CellMapError(f"'{path}' is no binary tree of OctoMap, with id OcTree")
    leaves = leaves_of(np.frombuffer(body, dtype="<u2").tolist(), path)
    corners = (leaves[:, :4] - [*(2 ** (DEPTH - 1),) * 3, 0]) * resolution
    return corners, leaves[:, 4] == OCCUPIED


def leaves_of(nodes: list[int], path: Path) -> NDArray[np.int64]:
    """Lower corner, edge and state of each leaf, in its smallest cells.

    Args:
        nodes: Children of each divided node, in the order of the file.
        path: The file, for errors.

    Raises:
        CellMapError: A node is missing, or is divided too often.
    """
    leaves = []
    waiting = [(0, 0, 0, 1 << DEPTH)] if nodes else []
    for node in nodes:
        if not waiting:
            break
        x, y, z, edge = waiting.pop()
        half = edge // 2
        divided = []
        for k in range(8):
            state = node >> 2 * k & 3
            corner = (x + half * (k & 1), y + half * (k >> 1 & 1), z + half * (k >> 2))
            if state == DIVIDED:
                divided.append((*corner, half))
            elif state:
                leaves.append((*corner, half, state))
        if divided and half == 1:
            raise CellMapError(f"'{path}' has a node below level {DEPTH}")
        # The children of the first one follow it in the file.
        waiting += reversed(divided)
    if waiting:
        raise CellMapError(f"'{path}' ends before its last node")
    return np.array(leaves, dtype=np.int64).reshape(-1, 5)


@kernel
def overlap(low: float, high: float, k: int) -> float:
    """Length of a range within cell k [cells]."""
    return max(min(high, k + 1.0) - max(low, float(k)), 0.0)


@kernel(inline=False, entry=True)
def add_boxes(boxes: Matrix, out: Grid) -> None:
    """Add the share of each cell that boxes fill.

    Args:
        boxes: Lower corner and edge of each, shape (n, 4) [cells].
        out: Filled share of the cells, shape (side³,), by z, then y, then x.
    """
    side = round(out.shape[0] ** (1.0 / 3.0))
    for n in range(boxes.shape[0]):
        x, y, z, edge = boxes[n, 0], boxes[n, 1], boxes[n, 2], boxes[n, 3]
        for k in range(max(int(z), 0), min(int(np.ceil(z + edge)), side)):
            in_z = overlap(z, z + edge, k)
            for j in range(max(int(y), 0), min(int(np.ceil(y + edge)), side)):
                in_yz = in_z * overlap(y, y + edge, j)
                at = (k * side + j) * side
                for i in range(max(int(x), 0), min(int(np.ceil(x + edge)), side)):
                    out[at + i] += in_yz * overlap(x, x + edge, i)
