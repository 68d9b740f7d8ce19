"""Capsule against box, sharp or rounded. Conventions: see docs/conventions.md."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.box_frame import (
    clamp_to_box,
    to_box,
    turn_from_box,
    turn_to_box,
)
from armguard.geometry.box_separation import PLANE_SIN, axis_of
from armguard.geometry.contact import contact_gap
from armguard.geometry.segment_box import nearest_to_box
from armguard.geometry.vec3 import (
    Vec3,
    add,
    along,
    cross,
    dot,
    norm,
    scaled,
    sub,
)
from armguard.geometry.witness import write_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]


@kernel
def capsule_box(a: Row, b: Row, out: Row) -> None:
    """Signed distance between a capsule and a box, with witness points and normal.

    Args:
        a: Capsule row, shape (16,); world [m].
        b: Box row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.

    Guarantees:
        Of several ways out of equal length the first is taken: faces x, y, z, then
        the directions at right angles to axis and edge.
    """
    half = (b[4], b[5], b[6])
    start = (a[1], a[2], a[3])
    p = to_box(b, start)
    u = turn_to_box(b, (a[4] - a[1], a[5] - a[2], a[6] - a[3]))
    t = nearest_to_box(p, u, half)
    on_axis = along(p, t, u)
    apart = sub(clamp_to_box(on_axis, half), on_axis)
    gap = norm(apart)
    if not gap <= contact_gap(norm(half) + norm(u), start, (b[1], b[2], b[3])):
        normal = scaled(1.0 / gap, apart)
    else:
        inside, outward = way_out(p, u, half)
        # Outside by a hair the distance is good, only its direction is not.
        gap = gap if inside > 0.0 else inside
        # Where the axis touches the box once it has been moved out: the witness.
        t = nearest_to_box(along(p, -gap, outward), u, half)
        on_axis = along(p, t, u)
        normal = scaled(-1.0, outward)
    world = add(turn_from_box(b, on_axis), (b[1], b[2], b[3]))
    write_witness(gap, world, turn_from_box(b, normal), a[0], b[0], out)


@kernel(inline=False)
def way_out(p: Vec3, u: Vec3, half: Vec3) -> tuple[float, Vec3]:
    """Shortest translation that takes a segment out of a box it crosses.

    The Minkowski difference is a zonotope of four generators; its face normals are the
    three of the box and the three at right angles to the segment and an edge.

    Returns:
        Minus the length of the translation [m], and its direction.
    """
    best = -inf
    outward = (1.0, 0.0, 0.0)
    middle = along(p, 0.5, u)
    for k in range(6):
        n = axis_of(k % 3)
        if k >= 3:
            n = cross(n, u)
            length = norm(n)
            if length <= PLANE_SIN * norm(u):
                continue
            n = scaled(1.0 / length, n)
        side = dot(n, middle)
        shadow = 0.5 * abs(dot(n, u)) + (
            half[0] * abs(n[0]) + half[1] * abs(n[1]) + half[2] * abs(n[2])
        )
        gap = abs(side) - shadow
        if not gap <= best + 1e-15:
            best = gap
            outward = n if side >= 0.0 else scaled(-1.0, n)
    return best, outward
