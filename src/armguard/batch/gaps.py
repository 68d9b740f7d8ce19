"""Signed distances in lanes; the formulas of `geometry.pairs`, eight at once.

Rows are an array of lanes, shape (8 · 16 · k,), where row i starts at 16 · 8 · i, or a
matrix of what is the same in all lanes, shape (k, 16). Their numbers are those of
`geometry.shapes.row`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.segments import PARALLEL_SIN2, POINT
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import WIDTH, either, least, load, most, root, size, splat

Floats = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
HALF_SPACE = int(ShapeKind.HALF_SPACE)


@kernel
def has_lanes(kind_a: int, kind_b: int) -> bool:
    """Whether a pair has a formula in lanes, for kind_a <= kind_b."""
    if kind_b == HALF_SPACE:
        return kind_a <= BOX
    return kind_b <= CAPSULE or (kind_a == SPHERE and kind_b == BOX)


@kernel
def entry(rows: Floats, i: int, k: int) -> Any:
    """Number k of row i, in lanes."""
    if rows.ndim == 2:
        return splat(rows[i, k])
    return load(rows, (i * ROW_WIDTH + k) * WIDTH)


@kernel
def lane_gap(kind_a: int, i: int, a: Floats, kind_b: int, j: int, b: Floats) -> Any:
    """Signed distances of row i of a and row j of b [m].

    For kind_a <= kind_b with `has_lanes`.
    """
    if kind_b == HALF_SPACE:
        return half_space_gap(kind_a, i, a, j, b)
    if kind_b == BOX:
        return sphere_box_gap(i, a, j, b)
    if kind_a == CAPSULE:
        return capsule_capsule_gap(i, a, j, b)
    if kind_b == CAPSULE:
        return sphere_capsule_gap(i, a, j, b)
    return sphere_sphere_gap(i, a, j, b)


@kernel
def sphere_sphere_gap(i: int, a: Floats, j: int, b: Floats) -> Any:
    """Signed distances of two spheres [m]."""
    x = entry(a, i, 1) - entry(b, j, 1)
    y = entry(a, i, 2) - entry(b, j, 2)
    z = entry(a, i, 3) - entry(b, j, 3)
    return root(x * x + y * y + z * z) - (entry(a, i, 0) + entry(b, j, 0))


@kernel
def clamped(x: Any) -> Any:
    """Each lane, kept within [0, 1]."""
    return least(most(x, 0.0), 1.0)


@kernel
def sphere_capsule_gap(i: int, a: Floats, j: int, b: Floats) -> Any:
    """Signed distances of a sphere and a capsule [m]."""
    x = entry(a, i, 1) - entry(b, j, 1)
    y = entry(a, i, 2) - entry(b, j, 2)
    z = entry(a, i, 3) - entry(b, j, 3)
    ux = entry(b, j, 4) - entry(b, j, 1)
    uy = entry(b, j, 5) - entry(b, j, 2)
    uz = entry(b, j, 6) - entry(b, j, 3)
    uu = ux * ux + uy * uy + uz * uz
    t = clamped((x * ux + y * uy + z * uz) / either(uu > 0.0, uu, 1.0))
    x = x - t * ux
    y = y - t * uy
    z = z - t * uz
    return root(x * x + y * y + z * z) - (entry(a, i, 0) + entry(b, j, 0))


@kernel
def capsule_capsule_gap(i: int, a: Floats, j: int, b: Floats) -> Any:
    """Signed distances of two capsules [m]; see `closest_on_segments`."""
    ux = entry(a, i, 4) - entry(a, i, 1)
    uy = entry(a, i, 5) - entry(a, i, 2)
    uz = entry(a, i, 6) - entry(a, i, 3)
    vx = entry(b, j, 4) - entry(b, j, 1)
    vy = entry(b, j, 5) - entry(b, j, 2)
    vz = entry(b, j, 6) - entry(b, j, 3)
    wx = entry(a, i, 1) - entry(b, j, 1)
    wy = entry(a, i, 2) - entry(b, j, 2)
    wz = entry(a, i, 3) - entry(b, j, 3)
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    uw = ux * wx + uy * wy + uz * wz
    vw = vx * wx + vy * wy + vz * wz
    per_uu = either(uu > POINT, 1.0 / either(uu > POINT, uu, 1.0), uu * 0.0)
    per_vv = either(vv > POINT, 1.0 / either(vv > POINT, vv, 1.0), vv * 0.0)
    det = uu * vv - uv * uv
    wide = det > PARALLEL_SIN2 * (uu * vv)
    s = either(wide, clamped((uv * vw - vv * uw) / either(wide, det, 1.0)), uu * 0.0)
    t = clamped((uv * s + vw) * per_vv)
    s = clamped((uv * t - uw) * per_uu)
    x = wx + s * ux
    y = wy + s * uy
    z = wz + s * uz
    t = clamped((vx * x + vy * y + vz * z) * per_vv)
    x = x - t * vx
    y = y - t * vy
    z = z - t * vz
    return root(x * x + y * y + z * z) - (entry(a, i, 0) + entry(b, j, 0))


@kernel
def along_axis(axis: int, x: Any, y: Any, z: Any, j: int, rows: Floats) -> Any:
    """Component of a vector along an axis of row j's frame."""
    return (
        x * entry(rows, j, 7 + axis)
        + y * entry(rows, j, 10 + axis)
        + z * entry(rows, j, 13 + axis)
    )


@kernel
def sphere_box_gap(i: int, a: Floats, j: int, b: Floats) -> Any:
    """Signed distances of a sphere and a box [m]."""
    x = entry(a, i, 1) - entry(b, j, 1)
    y = entry(a, i, 2) - entry(b, j, 2)
    z = entry(a, i, 3) - entry(b, j, 3)
    u = size(along_axis(0, x, y, z, j, b)) - entry(b, j, 4)
    v = size(along_axis(1, x, y, z, j, b)) - entry(b, j, 5)
    w = size(along_axis(2, x, y, z, j, b)) - entry(b, j, 6)
    inside = most(most(u, v), w)
    u = most(u, 0.0)
    v = most(v, 0.0)
    w = most(w, 0.0)
    outside = root(u * u + v * v + w * w)
    gap = either(inside > 0.0, outside, inside)
    return gap - (entry(a, i, 0) + entry(b, j, 0))


@kernel
def half_space_gap(kind_a: int, i: int, a: Floats, j: int, b: Floats) -> Any:
    """Signed distances of a sphere, a capsule or a box and a half-space [m]."""
    nx = entry(b, j, 4)
    ny = entry(b, j, 5)
    nz = entry(b, j, 6)
    height = (
        (entry(a, i, 1) - entry(b, j, 1)) * nx
        + (entry(a, i, 2) - entry(b, j, 2)) * ny
        + (entry(a, i, 3) - entry(b, j, 3)) * nz
    )
    if kind_a == CAPSULE:
        other = (
            (entry(a, i, 4) - entry(b, j, 1)) * nx
            + (entry(a, i, 5) - entry(b, j, 2)) * ny
            + (entry(a, i, 6) - entry(b, j, 3)) * nz
        )
        height = least(height, other)
    elif kind_a == BOX:
        height = height - (
            size(along_axis(0, nx, ny, nz, i, a)) * entry(a, i, 4)
            + size(along_axis(1, nx, ny, nz, i, a)) * entry(a, i, 5)
            + size(along_axis(2, nx, ny, nz, i, a)) * entry(a, i, 6)
        )
    return height - (entry(a, i, 0) + entry(b, j, 0))
