"""The farthest point of a core in a direction: all a convex solver needs to know."""

from math import inf, nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, call_support, pointer, stack
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, dot, norm, scaled, sub
from armguard.kernel import kernel
from armguard.lanes import WIDTH, either, load, mask, splat, store

Row = NDArray[np.float64]
Matrix = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
TRIANGLE = int(ShapeKind.TRIANGLE)
CYLINDER = int(ShapeKind.CYLINDER)
CONE = int(ShapeKind.CONE)
ELLIPSOID = int(ShapeKind.ELLIPSOID)
HULL = int(ShapeKind.HULL)
SUPPORT = int(ShapeKind.SUPPORT)

# Bits of the lanes whose number has its first, second or third bit set.
ODD, SECOND, LAST = 0b10101010, 0b11001100, 0b11110000

# Vertices of a hull looked at together: what fits a small scratch [-].
BLOCK = 256


@kernel(entry=True)
def core_support(kind: int, row: Row, d: Vec3) -> Vec3:
    """Farthest point of a core in direction d, relative to the row's origin [m].

    Args:
        kind: ShapeKind; a half-space has no farthest point and gives NaN.
        row: Row of the primitive, shape (16,).
        d: Direction, of any length but 0.
    """
    return support_at(kind, row.ctypes.data, d)


@kernel
def core_middle(kind: int, row: Row) -> Vec3:
    """A point in the middle of a core, relative to the row's origin [m]."""
    if kind == CAPSULE:
        share = 0.5
        end = (row[4] - row[1], row[5] - row[2], row[6] - row[3])
    elif kind == TRIANGLE:
        share = 1.0 / 3.0
        end = (
            row[4] + row[7] - 2.0 * row[1],
            row[5] + row[8] - 2.0 * row[2],
            row[6] + row[9] - 2.0 * row[3],
        )
    else:
        return (0.0, 0.0, 0.0)
    return scaled(share, end)


@kernel(inline=False)
def support_at(kind: int, address: int, d: Vec3) -> Vec3:
    """The same, for a row by its address."""
    row = array_at(pointer(address), (ROW_WIDTH,), np.float64)
    if kind == SPHERE:
        return (0.0, 0.0, 0.0)
    if kind == CAPSULE:
        u = (row[4] - row[1], row[5] - row[2], row[6] - row[3])
        return u if dot(u, d) > 0.0 else (0.0, 0.0, 0.0)
    if kind == TRIANGLE:
        return triangle_support(row, d)
    x = row[7] * d[0] + row[10] * d[1] + row[13] * d[2]
    y = row[8] * d[0] + row[11] * d[1] + row[14] * d[2]
    z = row[9] * d[0] + row[12] * d[1] + row[15] * d[2]
    if kind == BOX:
        local = (
            row[4] if x >= 0.0 else -row[4],
            row[5] if y >= 0.0 else -row[5],
            row[6] if z >= 0.0 else -row[6],
        )
    elif kind == HULL:
        local = hull_support(row, x, y, z)
    elif kind == CYLINDER or kind == CONE:
        local = cone_support(row, x, y, z)
    elif kind == ELLIPSOID:
        local = ellipsoid_support(row, x, y, z)
    elif kind == SUPPORT:
        local = call_support(int(row[5]), int(row[4]), x, y, z)
    else:
        local = (nan, nan, nan)
    x, y, z = local
    return (
        row[7] * x + row[8] * y + row[9] * z,
        row[10] * x + row[11] * y + row[12] * z,
        row[13] * x + row[14] * y + row[15] * z,
    )


@kernel
def triangle_support(row: Row, d: Vec3) -> Vec3:
    """Farthest corner, relative to the first."""
    first = (row[1], row[2], row[3])
    u = sub((row[4], row[5], row[6]), first)
    v = sub((row[7], row[8], row[9]), first)
    along_u, along_v = dot(u, d), dot(v, d)
    if along_u > 0.0 and along_u >= along_v:
        return u
    if along_v > 0.0:
        return v
    return (0.0, 0.0, 0.0)


@kernel
def cone_support(row: Row, x: float, y: float, z: float) -> Vec3:
    """Farthest point of a cylinder or cone: on one of two rims.

    Along the axis the whole end face is farthest; its centre is taken.
    """
    out = sqrt(x * x + y * y)
    height = row[5]
    if row[6] * out + height * z >= row[4] * out - height * z:
        radius = row[6]
    else:
        radius = row[4]
        height = -height
    if not out > 0.0:
        return (0.0, 0.0, height)
    return (radius * x / out, radius * y / out, height)


@kernel
def ellipsoid_support(row: Row, x: float, y: float, z: float) -> Vec3:
    """Farthest point of an ellipsoid."""
    v = (row[4] * x, row[5] * y, row[6] * z)
    length = norm(v)
    if not length > 0.0:
        return (0.0, 0.0, 0.0)
    v = scaled(1.0 / length, v)
    return (row[4] * v[0], row[5] * v[1], row[6] * v[2])


@kernel
def hull_support(row: Row, x: float, y: float, z: float) -> Vec3:
    """Farthest vertex of a hull; of several, always the same one.

    Vertices are compared eight at a time, each with its like of the other half.
    """
    count = int(row[5])
    v = array_at(pointer(int(row[4])), (3 * count,), np.float64)
    best, highest, other_half = 0, -inf, 0
    for start in range(0, count, BLOCK):
        half = min(BLOCK, count - start) // 2
        if half >= WIDTH:
            k, height = highest_of_half(v, start, half, x, y, z)
            if height > highest:
                best, highest, other_half = start + k, height, half
            continue
        for k in range(half):
            i = start + k
            height = max(height_at(v, i, x, y, z), height_at(v, i + half, x, y, z))
            if height > highest:
                best, highest, other_half = i, height, half
    if height_at(v, best, x, y, z) < highest:
        best += other_half
    return (v[best], v[best + count], v[best + 2 * count])


@kernel
def height_at(v: Row, i: int, x: float, y: float, z: float) -> float:
    """Projection of vertex i of a hull on a direction."""
    count = v.shape[0] // 3
    return float(v[i] * x + v[i + count] * y + v[i + 2 * count] * z)


@kernel
def highest_of_half(
    v: Row, start: int, half: int, x: float, y: float, z: float
) -> tuple[int, float]:
    """The first of `half` pairs of vertices that reaches highest, and how high.

    Args:
        v: Coordinates x of all vertices, then y, then z [m].
        start: First vertex; the like of vertex i is i + half.
        half: Count of pairs, 8 or more.
        x: Direction.
        y: Direction.
        z: Direction.
    """
    count = v.shape[0] // 3
    found = array_at(stack(16), (2, WIDTH), np.float64)
    lane, top, place = lane_numbers(), splat(-inf), splat(0.0)
    for k in range(0, half, WIDTH):
        at = min(k, half - WIDTH)
        i = start + at
        j = i + half
        one = load(v, i) * x + load(v, i + count) * y + load(v, i + 2 * count) * z
        other = load(v, j) * x + load(v, j + count) * y + load(v, j + 2 * count) * z
        height = either(one >= other, one, other)
        higher = height > top
        top = either(higher, height, top)
        place = either(higher, lane + at, place)
    store(found[0], 0, top)
    store(found[1], 0, place)
    best = first_highest(found)
    return (int(found[1, best]), found[0, best])


@kernel
def lane_numbers() -> Any:
    """The number of each lane, from 0 on.

    Lanes of constants stay in registers. A vector that is read from memory right after
    its numbers were written there one by one has to wait for them.
    """
    nothing = splat(0.0)
    one = either(mask(ODD), splat(1.0), nothing)
    two = either(mask(SECOND), splat(2.0), nothing)
    return one + two + either(mask(LAST), splat(4.0), nothing)


@kernel
def first_highest(found: Matrix) -> int:
    """Lane with the greatest value, of several that with the least place.

    Args:
        found: Values and their places, shape (2, 8).
    """
    best = 0
    for k in range(1, WIDTH):
        if found[0, k] > found[0, best] or (
            found[0, k] == found[0, best] and found[1, k] < found[1, best]
        ):
            best = k
    return best
