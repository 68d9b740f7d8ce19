"""The direction in which A - B is narrowest, where its surface is curved.

A polytope comes near a curved surface but slowly. Its width, by direction, is
smooth there, and a few Newton steps from the polytope's nearest faces do the rest.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.core_support import core_support
from armguard.geometry.polytope import Face, normal_of
from armguard.geometry.vec3 import (
    Vec3,
    add,
    along,
    any_perpendicular,
    cross,
    dot,
    norm,
    scaled,
    sub,
)
from armguard.kernel import kernel
from armguard.record import Records

Row = NDArray[np.float64]
Matrix = NDArray[np.float64]

# Faces a descent starts from, at most, and how far apart they are (cosine) [-].
STARTS = 128
DISTINCT = 0.9995

# Newton steps of a descent, halvings of one of them [-].
STEPS = 16
HALVINGS = 24

# Turn by which second derivatives are measured [rad].
PROBE = 1e-4


@kernel
def difference(kind_a: int, a: Row, kind_b: int, b: Row, n: Vec3) -> tuple[Vec3, Vec3]:
    """Support point of A - B in direction n, and the point of A it comes from."""
    on_a = core_support(kind_a, a, n)
    offset = (a[1] - b[1], a[2] - b[2], a[3] - b[3])
    return sub(add(on_a, offset), core_support(kind_b, b, scaled(-1.0, n))), on_a


@kernel(inline=False)
def narrowest(
    kind_a: int,
    a: Row,
    kind_b: int,
    b: Row,
    faces: Records[Face],
    face_count: int,
    width: float,
    normal: Vec3,
) -> tuple[float, Vec3]:
    """The least width, from the best direction and from every face that may have it.

    No direction is narrower than the plane of the face it goes through is far. So only
    faces nearer than the least width so far are asked.

    Args:
        kind_a: ShapeKind of A.
        a: Its row.
        kind_b: ShapeKind of B.
        b: Its row.
        faces: Faces of the polytope; their marks are written.
        face_count: How many there are.
        width: Least width so far [m].
        normal: Its direction.

    Returns:
        Width and direction.
    """
    width, normal = descend(kind_a, a, kind_b, b, width, normal)
    for k in range(face_count):
        faces[k].mark = 0
    for _ in range(STARTS):
        face, least = -1, width
        for k in range(face_count):
            if faces[k].distance < least and faces[k].mark == 0:
                face, least = k, faces[k].distance
        if face < 0:
            break
        n = normal_of(faces[face])
        for k in range(face_count):
            if dot(n, normal_of(faces[k])) > DISTINCT:
                faces[k].mark = 1
        faces[face].mark = 1
        w, _p = difference(kind_a, a, kind_b, b, n)
        found, turned = descend(kind_a, a, kind_b, b, dot(w, n), n)
        if found < width:
            width, normal = found, turned
    return width, normal


@kernel(inline=False)
def descend(
    kind_a: int, a: Row, kind_b: int, b: Row, width: float, n: Vec3
) -> tuple[float, Vec3]:
    """Turn a direction to where A - B is narrower, as far as that goes."""
    for _ in range(STEPS):
        e = any_perpendicular(n)
        f = cross(n, e)
        gu, gv = slope(kind_a, a, kind_b, b, n, e, f, (0.0, 0.0))
        if not gu * gu + gv * gv > 0.0:
            break
        uu, uv = slope(kind_a, a, kind_b, b, n, e, f, (PROBE, 0.0))
        vu, vv = slope(kind_a, a, kind_b, b, n, e, f, (0.0, PROBE))
        uu, uv, vu, vv = (
            (uu - gu) / PROBE,
            (uv - gv) / PROBE,
            (vu - gu) / PROBE,
            (vv - gv) / PROBE,
        )
        cross_term = 0.5 * (uv + vu)
        volume = uu * vv - cross_term * cross_term
        if uu > 0.0 and volume > 1e-6 * uu * vv:
            u = (cross_term * gv - vv * gu) / volume
            v = (cross_term * gu - uu * gv) / volume
        else:
            # Not bowl-shaped here: straight down.
            size = max(abs(uu), abs(vv), abs(width), 1e-300)
            u, v = -gu / size, -gv / size
        reach = sqrt(u * u + v * v)
        if reach > 0.5:
            u, v = 0.5 * u / reach, 0.5 * v / reach
        improved = False
        for _half in range(HALVINGS):
            turned = along(along(n, u, e), v, f)
            turned = scaled(1.0 / norm(turned), turned)
            w, _p = difference(kind_a, a, kind_b, b, turned)
            if dot(w, turned) < width:
                width, n = dot(w, turned), turned
                improved = True
                break
            u, v = 0.5 * u, 0.5 * v
        if not improved:
            break
    return width, n


@kernel
def slope(
    kind_a: int,
    a: Row,
    kind_b: int,
    b: Row,
    n: Vec3,
    e: Vec3,
    f: Vec3,
    at: tuple[float, float],
) -> tuple[float, float]:
    """Slope of the width of A - B along n + u e + v f at (u, v), by u and by v [m]."""
    u, v = at
    direction = along(along(n, u, e), v, f)
    w, _p = difference(kind_a, a, kind_b, b, direction)
    square = 1.0 + u * u + v * v
    length = sqrt(square)
    width = dot(w, direction) / (square * length)
    return dot(w, e) / length - width * u, dot(w, f) / length - width * v
