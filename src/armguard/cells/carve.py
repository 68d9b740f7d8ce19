"""Free space in front of a depth image.

A cube of cells is free if every pixel whose area it may cover lies behind all of it.
The pixels are bounded by a rectangle about the projection of the cube's middle.
"""

import numpy as np

from armguard.address import array_at, stack
from armguard.cells.pyramid import Pyramid, pyramid_of
from armguard.cells.state import (
    ALL,
    BLOCK_SIDE,
    GROUP_SIDE,
    MEMBERS,
    WORD_SIDE,
    Camera,
    Look,
)
from armguard.cells.words import corner_of, member_corner, middle_of, place_of_block
from armguard.geometry.vec3 import Vec3, dot
from armguard.kernel import kernel
from armguard.lanes import bits, floor, item, least, load, most, pick, some
from armguard.table import LongVector, Vector, opener

# Growth of the rectangle and of the depth of a cube against rounding, in pixels and
# as a share of the depth [-].
SLACK = 1e-6

# Decisions about a cube.
HIDDEN = 0  # none of its cells is free
FREE = 1
MIXED = 2

# Half edges of a word and of a cell [cells].
HALF_WORD, HALF_CELL = 2.0, 0.5


look_of = opener(Look)


@kernel
def in_camera(camera: Camera, point: Vec3) -> Vec3:
    """A point of the world in the camera's frame [m]."""
    x = point[0] - camera.origin[0]
    y = point[1] - camera.origin[1]
    z = point[2] - camera.origin[2]
    return (
        camera.axes[0, 0] * x + camera.axes[0, 1] * y + camera.axes[0, 2] * z,
        camera.axes[1, 0] * x + camera.axes[1, 1] * y + camera.axes[1, 2] * z,
        camera.axes[2, 0] * x + camera.axes[2, 1] * y + camera.axes[2, 2] * z,
    )


@kernel
def depth_extent(camera: Camera, half: float) -> float:
    """Half the depth of a cube with this half edge [m]."""
    a, b, c = camera.axes[2, 0], camera.axes[2, 1], camera.axes[2, 2]
    return float(half * (abs(a) + abs(b) + abs(c)) * (1.0 + SLACK))


@kernel
def half_width(camera: Camera, k: int, slope: float, sway: float, half: float) -> float:
    """Half the width of a cube's projection, at depth 1 of its nearest point [pixels].

    The offset of a point from the line of sight through the middle is linear in its
    place in the cube, so it is greatest in a corner.

    Args:
        camera: The camera.
        k: 0 for the width along columns, 1 along rows.
        slope: Slope of the line of sight through the middle of a cube.
        sway: How much the slopes of several cubes differ from it.
        half: Half edge of each cube [m].
    """
    total = 0.0
    for axis in range(3):
        depth = camera.axes[2, axis]
        total += abs(camera.axes[k, axis] - slope * depth) + sway * abs(depth)
    return float(camera.focal[k] * half * total * (1.0 + SLACK))


@kernel
def side_of(camera: Camera, k: int, p: Pyramid) -> Vec3:
    """Normal, into the view, of a plane through the camera and a border of the image.

    Args:
        camera: The camera.
        k: 0 and 1 for the first and the last column, 2 and 3 for rows.
        p: The image.

    Returns:
        A vector of the camera's frame.
    """
    u, v = camera.centre[0] + 0.5, camera.centre[1] + 0.5
    if k == 0:
        return (camera.focal[0], 0.0, u)
    if k == 1:
        return (-camera.focal[0], 0.0, p.levels[0, 2] - u)
    if k == 2:
        return (0.0, camera.focal[1], v)
    return (0.0, -camera.focal[1], p.levels[0, 1] - v)


@kernel
def write_side_extents(p: Pyramid, out: Camera) -> None:
    """Write how far a cube with a half edge of 1 extends along the sides' normals."""
    for k in range(4):
        n = side_of(out, k, p)
        total = 0.0
        for axis in range(3):
            column = (out.axes[0, axis], out.axes[1, axis], out.axes[2, axis])
            total += abs(dot(n, column))
        out.side_extents[k] = total


@kernel
def is_beside(camera: Camera, middle: Vec3, half: float, p: Pyramid) -> bool:
    """Whether a cube lies beside the view; its middle is in the camera's frame [m]."""
    for k in range(4):
        if dot(side_of(camera, k, p), middle) + half * camera.side_extents[k] < 0.0:
            return True
    return False


@kernel
def level_for(width: float, p: Pyramid) -> int:
    """Least level whose tiles are at least this wide [pixels].

    Where there is none it is the last one, which has one tile.
    """
    k = 0
    while k + 1 < p.levels.shape[0] and width > (1 << k):
        k += 1
    return k


@kernel
def window_about(u: float, v: float, k: int, p: Pyramid) -> int:
    """Place of the window of level k about a point, from the image's corner [pixels].

    Of a point beside the image it is the window of the nearest tile.
    """
    tile = 1.0 / (1 << k)
    across = int(min(max(u * tile, 0.0), p.levels[k, 2] - 1.0))
    down = int(min(max(v * tile, 0.0), p.levels[k, 1] - 1.0))
    return int(p.levels[k, 0] + down * p.levels[k, 2] + across)


@kernel
def decide(
    camera: Camera, middle: Vec3, edge: float, p: Pyramid
) -> tuple[int, float, float]:
    """Whether all cells of a cube are free, or none can be.

    Args:
        camera: The camera.
        middle: Middle of the cube, world [m].
        edge: Its edge [m].
        p: The image.

    Returns:
        HIDDEN, FREE or MIXED; a depth that the pixels of the cube are not nearer than,
        and one that they are not farther than [m].
    """
    px, py, pz = in_camera(camera, middle)
    half = 0.5 * edge
    extent = depth_extent(camera, half)
    near, far = pz - extent, pz + extent
    if far <= 0.0 or near >= camera.reach or is_beside(camera, (px, py, pz), half, p):
        return HIDDEN, 0.0, 0.0
    if near <= 0.0:
        return MIXED, 0.0, camera.reach
    u = camera.focal[0] * px / pz + camera.centre[0] + 0.5
    v = camera.focal[1] * py / pz + camera.centre[1] + 0.5
    wide = half_width(camera, 0, px / pz, 0.0, half) / near + SLACK
    high = half_width(camera, 1, py / pz, 0.0, half) / near + SLACK
    rows, columns = p.levels[0, 1], p.levels[0, 2]
    k = level_for(max(wide, high), p)
    most = min(item(p.most_near, window_about(u, v, max(k, 2), p)), camera.reach)
    if near >= most:
        return HIDDEN, 0.0, 0.0
    least_depth = item(p.least_near, window_about(u, v, k, p))
    whole = u >= wide and u + wide <= columns and v >= high and v + high <= rows
    if whole and far < least_depth and far <= camera.reach:
        return FREE, least_depth, most
    return MIXED, least_depth, most


@kernel
def free_word(word: int, cells: np.uint64, out: Look) -> None:
    """Note cells of a word that were not noted yet."""
    out.passes[word] = cells
    out.touched[out.notes.touched] = word
    out.notes.touched += 1


@kernel
def window_start(low: float, high: float, count: int, span: int) -> tuple[float, float]:
    """First tiles of two windows that cover a range of tiles, in lanes."""
    first = least(most(floor(low), 0.0), count - 1.0)
    last = least(most(floor(high) - span, first), count - 1.0)
    return first, last


@kernel(inline=False)
def free_cells(
    middle: Vec3, nearest: float, farthest: float, cell: float, offsets: Vector,
    camera: Camera, p: Pyramid,
) -> np.uint64:  # fmt: skip
    """Cells of a word that are free, eight at a time.

    A cell's rectangle is covered by four windows of a fine level, or by four pixels.

    Args:
        middle: Middle of the word, world [m].
        nearest: Depth that its pixels are not nearer than [m].
        farthest: Depth that they are not farther than [m].
        cell: Edge of a cell [m].
        offsets: Cells of a word from its middle, camera frame, shape (192,): x of all,
            y of all, z of all [m].
        camera: The camera.
        p: The image.
    """
    px, py, pz = in_camera(camera, middle)
    extent = depth_extent(camera, HALF_CELL * cell)
    near = pz - depth_extent(camera, HALF_WORD * cell)
    free = np.uint64(0)
    if near <= 0.0:
        return free
    sway = half_width(camera, 0, px / pz, 0.0, HALF_WORD * cell)
    sway = sway / (camera.focal[0] * near)
    wide = half_width(camera, 0, px / pz, sway, HALF_CELL * cell) / near + SLACK
    sway = half_width(camera, 1, py / pz, 0.0, HALF_WORD * cell)
    sway = sway / (camera.focal[1] * near)
    high = half_width(camera, 1, py / pz, sway, HALF_CELL * cell) / near + SLACK
    widest = max(wide, high)
    # Two windows of three tiles cover a range of up to five tiles wherever it begins.
    k = 0 if widest < 0.5 else level_for(0.4 * widest, p)
    span = 0 if widest < 0.5 else 2
    depths = p.least if span == 0 else p.least_near
    # The window about a tile begins one tile before it.
    shift = 0.0 if span == 0 else 1.0
    first, tiles_down, tiles_across = p.levels[k, 0], p.levels[k, 1], p.levels[k, 2]
    rows, columns = p.levels[0, 1], p.levels[0, 2]
    per_pixel = 1.0 / (1 << k)
    for n in range(8):
        depth = load(offsets, 128 + 8 * n) + pz
        u = (load(offsets, 8 * n) + px) / depth * camera.focal[0]
        v = (load(offsets, 64 + 8 * n) + py) / depth * camera.focal[1]
        u, v = u + (camera.centre[0] + 0.5), v + (camera.centre[1] + 0.5)
        far = depth + extent
        inside = (u >= wide) & (u + wide <= columns) & (v >= high) & (v + high <= rows)
        inside = inside & (far <= camera.reach)
        found = bits(inside & (far < nearest))
        if not some(inside & (far >= nearest) & (far < farthest)):
            free |= np.uint64(found) << np.uint64(8 * n)
            continue
        a, b = window_start(
            (u - wide) * per_pixel, (u + wide) * per_pixel, tiles_across, span
        )
        c, d = window_start(
            (v - high) * per_pixel, (v + high) * per_pixel, tiles_down, span
        )
        a, b = (
            least(a + shift, tiles_across - 1.0),
            least(b + shift, tiles_across - 1.0),
        )
        c, d = least(c + shift, tiles_down - 1.0), least(d + shift, tiles_down - 1.0)
        upper, lower = c * tiles_across + first, d * tiles_across + first
        behind = least(
            least(pick(depths, upper + a), pick(depths, upper + b)),
            least(pick(depths, lower + a), pick(depths, lower + b)),
        )
        free |= np.uint64(bits(inside & (far < behind)) | found) << np.uint64(8 * n)
    return free


@kernel(inline=False)
def carve_group(
    group: int, corner: Vec3, cell: float, offsets: Vector, p: Pyramid, out: Look
) -> None:
    """Note the free cells of a group with a lower corner [m]."""
    edge = WORD_SIDE * cell
    for k in range(MEMBERS):
        middle = middle_of(member_corner(corner, edge, k), edge)
        found, nearest, farthest = decide(out.camera, middle, edge, p)
        if found == FREE:
            free_word((group << 6) + k, ALL, out)
        elif found == MIXED:
            free = free_cells(middle, nearest, farthest, cell, offsets, out.camera, p)
            if free != 0:
                free_word((group << 6) + k, free, out)


@kernel(inline=False)
def carve_block(
    block: int, corner: Vec3, cell: float, offsets: Vector, p: Pyramid, out: Look
) -> None:
    """Note the free cells of a block with a lower corner [m]."""
    edge = GROUP_SIDE * cell
    for k in range(MEMBERS):
        inner = member_corner(corner, edge, k)
        found = decide(out.camera, middle_of(inner, edge), edge, p)[0]
        group = (block << 6) + k
        if found == FREE:
            for word in range(group << 6, (group + 1) << 6):
                free_word(word, ALL, out)
        elif found == MIXED:
            carve_group(group, inner, cell, offsets, p, out)


@kernel
def write_offsets(camera: Camera, cell: float, out: Vector) -> None:
    """Write a word's cells from its middle, in the camera's frame; shape (192,)."""
    for k in range(64):
        x = cell * ((k & 3) - 1.5)
        y = cell * ((k >> 2 & 3) - 1.5)
        z = cell * ((k >> 4) - 1.5)
        for axis in range(3):
            row = camera.axes[axis]
            out[64 * axis + k] = row[0] * x + row[1] * y + row[2] * z


@kernel(inline=False, entry=True)
def carve(pyramid_lines: LongVector, look_lines: LongVector) -> None:
    """Note the cells that are free in front of an image, in a frame without any.

    Args:
        pyramid_lines: Lines of `Pyramid`.
        look_lines: Lines of `Look`: passes, and the list of words.
    """
    p, look = pyramid_of(pyramid_lines), look_of(look_lines)
    camera, lattice = look.camera, look.lattice
    offsets = array_at(stack(192), (192,), np.float64)
    write_offsets(camera, lattice.cell, offsets)
    write_side_extents(p, camera)
    edge = BLOCK_SIDE * lattice.cell
    for block in range(lattice.blocks * lattice.blocks * lattice.blocks):
        corner = corner_of(place_of_block(block, lattice.blocks), BLOCK_SIDE, lattice)
        if decide(camera, middle_of(corner, edge), edge, p)[0] != HIDDEN:
            carve_block(block, corner, lattice.cell, offsets, p, look)
