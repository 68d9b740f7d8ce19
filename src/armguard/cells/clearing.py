"""Occupied cells through which an image looks, also where it frees no whole cell.

What hit a cell was seen by the pixels that cover it. Once these see farther, it is
gone, though other parts of the cell are outside of the view or at its border.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.cells.state import Claims, Look
from armguard.cells.view import places_of

Floats = NDArray[np.float64]

# Corners and middle of a cell [cells].
POINTS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
POINTS = np.concatenate([POINTS, np.zeros((1, 3))])


def pass_occupied(image: NDArray[np.float32], claims: Claims, out: Look) -> None:
    """Pass the occupied cells of which an image sees the middle and looks past.

    Every corner in the view has to be in a valid pixel that is farther than the cell.

    Args:
        image: Depths, shape (rows, columns) [m].
        claims: Claims of the map.
        out: The frame, with its camera.
    """
    lattice: Any = claims.lattice
    words = np.flatnonzero(claims.occupied.words)
    if not len(words):
        return
    bits = np.unpackbits(
        claims.occupied.words[words].view(np.uint8).reshape(-1, 8), axis=1,
        bitorder="little",
    )  # fmt: skip
    row, bit = np.nonzero(bits)
    cell = float(lattice["cell"])
    middles = lattice["low"] + cell * (
        places_of(words[row], bit, int(lattice["blocks"])) + 0.5
    )
    seen = looks_past(middles, cell, image, out)
    passed = np.zeros(len(words), dtype=np.uint64)
    np.bitwise_or.at(passed, row[seen], np.uint64(1) << bit[seen].astype(np.uint64))
    notes: Any = out.notes
    fresh = (out.hits[words] | out.passes[words] == 0) & (passed != 0)
    count, more = int(notes["touched"]), words[fresh]
    out.touched[count : count + len(more)] = more
    notes["touched"] = count + len(more)
    out.passes[words] |= passed


def pass_only_occupied(claims: Claims, out: Look) -> None:
    """Of the cells that a frame passes leave those that are occupied.

    Args:
        claims: Claims of the map.
        out: The frame.
    """
    notes: Any = out.notes
    words = out.touched[: int(notes["touched"])]
    out.passes[words] &= claims.occupied.words[words]


def looks_past(
    middles: Floats, cell: float, image: NDArray[np.float32], look: Look
) -> NDArray[np.bool_]:
    """Whether an image looks past cells, shape (n,).

    Args:
        middles: Their middles, world, shape (n, 3) [m].
        cell: Their edge [m].
        image: Depths, shape (rows, columns) [m].
        look: The frame, with its camera.
    """
    camera: Any = look.camera
    points = middles[:, None] + cell * POINTS - camera["origin"]
    local = points @ np.asarray(camera["axes"]).T
    depth = local[..., 2]
    ahead = depth > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        at = local[..., :2] / depth[..., None] * camera["focal"] + camera["centre"]
    at = np.where(ahead[..., None], np.rint(at), -1.0)
    rows, columns = image.shape
    within = (at >= 0).all(axis=2) & (at[..., 0] < columns) & (at[..., 1] < rows)
    j, i = (np.where(within, at[..., k], 0.0).astype(np.int64) for k in (0, 1))
    farthest = depth.max(axis=1)
    past = image[i, j] > farthest[:, None]
    near = ahead.all(axis=1) & (farthest <= float(camera["reach"]))
    return np.asarray(near & within[:, -1] & (past | ~within).all(axis=1))
