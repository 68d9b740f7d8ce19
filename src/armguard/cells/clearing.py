"""Occupied cells through which an image looks, also where it frees no whole cell.

What hit a cell was seen by the pixels that cover it. Once these see farther, it is
gone, though other parts of the cell are outside of the view or at its border.
"""

from math import sqrt

import numpy as np

from armguard.cells.carve import in_camera, look_of
from armguard.cells.evidence import claims_of
from armguard.cells.state import WORD_SIDE, Camera, Claims, Look, Singles
from armguard.cells.words import (
    bit,
    corner_of,
    middle_of,
    place_of_word,
    touch,
)
from armguard.geometry.vec3 import Vec3
from armguard.kernel import kernel
from armguard.lanes import lowest
from armguard.table import LongVector

# Distance of a cube's corner from its middle, in edges [-].
CORNER = 0.5 * sqrt(3.0)


@kernel
def pixel_at(point: Vec3, rows: int, columns: int, camera: Camera) -> int:
    """Number of the pixel that sees a point, by rows, -1 beside the image.

    Args:
        point: The point in the camera's frame, before the camera [m].
        rows: Rows of the image.
        columns: Its columns.
        camera: The camera.
    """
    u = np.rint(point[0] / point[2] * camera.focal[0] + camera.centre[0])
    v = np.rint(point[1] / point[2] * camera.focal[1] + camera.centre[1])
    if not (0.0 <= u < columns and 0.0 <= v < rows):
        return -1
    return int(v) * columns + int(u)


@kernel
def looks_past(
    middle: Vec3, cell: float, rows: int, image: Singles, camera: Camera
) -> bool:
    """Whether an image sees the middle of a cell and looks past all of it.

    Args:
        middle: The middle, world [m].
        cell: Edge of the cell [m].
        rows: Rows of the image.
        image: Depths by rows, shape (rows · columns,) [m].
        camera: The camera.
    """
    columns = image.shape[0] // rows
    here = in_camera(camera, middle)
    if not here[2] > 0.0:
        return False
    pixel = pixel_at(here, rows, columns, camera)
    if pixel < 0:
        return False
    seen, farthest = image[pixel], here[2]
    for k in range(8):
        corner = (
            middle[0] + cell * ((k >> 2) - 0.5),
            middle[1] + cell * ((k >> 1 & 1) - 0.5),
            middle[2] + cell * ((k & 1) - 0.5),
        )
        at = in_camera(camera, corner)
        farthest = max(farthest, at[2])
        if not at[2] > 0.0:
            return False
        pixel = pixel_at(at, rows, columns, camera)
        # An invalid pixel is NaN, and no cell is before it.
        if pixel >= 0 and not image[pixel] >= seen:
            seen = image[pixel]
            if not seen > 0.0:
                return False
    return bool(farthest < seen and farthest <= camera.reach)


@kernel
def may_be_seen(
    middle: Vec3, radius: float, rows: int, columns: int, camera: Camera
) -> bool:
    """Whether a ball may be within the view and before its reach; middle is world."""
    x, y, z = in_camera(camera, middle)
    if z + radius <= 0.0 or z - radius > camera.reach:
        return False
    for k in range(2):
        side, focal = (x if k == 0 else y), camera.focal[k]
        low = camera.centre[k] + 0.5
        high = (columns if k == 0 else rows) - low
        if focal * side + low * z < -radius * sqrt(focal * focal + low * low):
            return False
        if high * z - focal * side < -radius * sqrt(focal * focal + high * high):
            return False
    return True


@kernel(inline=False)
def pass_word(word: int, rows: int, image: Singles, claims: Claims, out: Look) -> None:
    """Pass the occupied cells of a word that an image looks past."""
    lattice, camera = claims.lattice, out.camera
    cell = lattice.cell
    place = place_of_word(word, lattice.blocks)
    edge = WORD_SIDE * cell
    middle, radius = (
        middle_of(corner_of(place, WORD_SIDE, lattice), edge),
        CORNER * edge,
    )
    if not may_be_seen(middle, radius, rows, image.shape[0] // rows, camera):
        return
    cells, passed = claims.occupied.words[word], np.uint64(0)
    while cells != 0:
        k = lowest(cells)
        cells = cells & (cells - np.uint64(1))
        at = (
            lattice.low[0] + cell * (WORD_SIDE * place[0] + (k & 3) + 0.5),
            lattice.low[1] + cell * (WORD_SIDE * place[1] + (k >> 2 & 3) + 0.5),
            lattice.low[2] + cell * (WORD_SIDE * place[2] + (k >> 4) + 0.5),
        )
        if looks_past(at, cell, rows, image, camera):
            passed |= bit(k)
    if passed != 0:
        touch(word, out)
        out.passes[word] |= passed


@kernel(inline=False, entry=True)
def pass_occupied(
    rows: int, image: Singles, claims_lines: LongVector, look_lines: LongVector
) -> None:
    """Pass the occupied cells of which an image sees the middle and looks past.

    Every corner in the view has to be in a valid pixel that is farther than the cell.

    Args:
        rows: Rows of the image.
        image: Depths by rows, shape (rows · columns,) [m].
        claims_lines: Lines of `Claims`.
        look_lines: Lines of `Look`, with its camera.
    """
    claims, look = claims_of(claims_lines), look_of(look_lines)
    for block in range(claims.occupied.blocks.shape[0]):
        groups = claims.occupied.blocks[block]
        while groups != 0:
            group = (block << 6) + lowest(groups)
            groups = groups & (groups - np.uint64(1))
            words = claims.occupied.groups[group]
            while words != 0:
                pass_word((group << 6) + lowest(words), rows, image, claims, look)
                words = words & (words - np.uint64(1))


@kernel(inline=False, entry=True)
def pass_only_occupied(claims_lines: LongVector, look_lines: LongVector) -> None:
    """Of the cells that a frame passes leave those that are occupied.

    Args:
        claims_lines: Lines of `Claims`.
        look_lines: Lines of `Look`.
    """
    claims, look = claims_of(claims_lines), look_of(look_lines)
    for k in range(look.notes.touched):
        word = look.touched[k]
        look.passes[word] &= claims.occupied.words[word]
