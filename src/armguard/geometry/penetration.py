"""Depth of two cores that overlap: the expanding polytope algorithm.

The shortest translation that separates A and B leads to the point of A - B's surface
nearest to the origin. A polytope inside A - B grows towards it, a support point a step:
its nearest face is a lower bound of the depth, and the width of A - B in any direction
an upper one.
"""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.box_separation import axis_of
from armguard.geometry.gjk import TOUCHING
from armguard.geometry.narrowest import descend, difference, narrowest
from armguard.geometry.polytope import (
    FLAT,
    Face,
    add_corner,
    face_that_sees,
    first_faces,
    nearest_face,
    nearest_point,
    normal_of,
    put_corner,
)
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
from armguard.record import records

Row = NDArray[np.float64]
Matrix = NDArray[np.float64]

# Room for corners and faces; a corner more is two faces more. So many of them go to
# the whole surface, see `focus` [-].
MOST_CORNERS = 100
WHOLE = 80
MOST_FACES = 2 * MOST_CORNERS + 8
MOST_EDGES = 3 * MOST_FACES

# Kind of an array of faces.
FACES = records(0, Face).dtype

# Numbers these take: the argument of `stack` has to be a constant [-].
CORNER_ROOM = 3 * MOST_CORNERS
FACE_ROOM = FACES.itemsize // 8 * MOST_FACES
EDGE_ROOM = 2 * MOST_EDGES

# Lower and upper bound may differ by this share of the largest number met [-].
PRECISION = 1e-11

# Farther outside than this share, the direction to the origin is worth more than the
# normals of faces [-].
OUTSIDE = 1e-7


@kernel(inline=False)
def core_depth(
    kind_a: int,
    a: Row,
    kind_b: int,
    b: Row,
    simplex: Matrix,
    count: int,
    v: Vec3,
    largest: float,
) -> tuple[float, Vec3]:
    """Depth of two cores that meet, or are so near that rounding hides whether they do.

    Args:
        kind_a: ShapeKind of A, not a half-space.
        a: Its row, shape (16,); world [m].
        kind_b: ShapeKind of B.
        b: Its row.
        simplex: The simplex in which the distance algorithm found the origin, shape
            (4, CORNER).
        count: How many corners it has.
        v: Its point nearest to the origin [m].
        largest: The largest number met so far [m].

    Returns:
        Length of the shortest translation that separates the cores, negative if they
        are apart [m], and the unit direction of B's.

    References:
        van den Bergen, 2001, Proximity queries and penetration depth computation.
    """
    corners = array_at(stack(CORNER_ROOM), (MOST_CORNERS, 3), np.float64)
    faces = array_at(stack(FACE_ROOM), (MOST_FACES,), FACES)
    edges = array_at(stack(EDGE_ROOM), (MOST_EDGES, 2), np.int64)
    for k in range(count):
        put_corner(corners, k, (simplex[k, 0], simplex[k, 1], simplex[k, 2]))
    used, flat_normal = spread_out(kind_a, a, kind_b, b, corners, count, largest)
    if used < 4 and norm(v) > TOUCHING * largest:
        return -norm(v), scaled(-1.0 / norm(v), v)
    if used < 4:
        # A - B has no volume: along its normal nothing has to be moved.
        return flat_depth(kind_a, a, kind_b, b, flat_normal)
    face_count = first_faces(corners, faces)
    best, normal = np.inf, (1.0, 0.0, 0.0)
    whole = True
    while True:
        if used >= WHOLE and whole:
            whole = False
            if faces[nearest_face(faces, face_count, normal, -2.0)].distance >= 0.0:
                best, normal = narrowest(
                    kind_a, a, kind_b, b, faces, face_count, best, normal
                )
        face = nearest_face(faces, face_count, normal, focus(used))
        if face < 0:
            # Nothing left to look at there.
            break
        lower, n = faces[face].distance, normal_of(faces[face])
        if lower < -OUTSIDE * largest:
            # The origin is outside: what is nearest may be an edge or a corner. Every
            # other time the face is asked all the same: it never fails to be moved.
            v = nearest_point(corners, faces, face_count)
            lower = -norm(v)
            if used % 2 == 0:
                n = scaled(1.0 / lower, v)
        w, _p = difference(kind_a, a, kind_b, b, n)
        width = dot(w, n)
        largest = max(largest, norm(w))
        if width < best:
            best, normal = width, n
        if not best - lower > PRECISION * largest:
            return best, normal
        if used == MOST_CORNERS:
            break
        put_corner(corners, used, w)
        seed = face_that_sees(faces, face_count, w)
        grown = add_corner(corners, used, faces, face_count, seed, edges, largest)
        if grown < 0:
            break
        face_count = grown
        used += 1
    if whole and lower >= 0.0:
        best, normal = narrowest(kind_a, a, kind_b, b, faces, face_count, best, normal)
    elif best < np.inf:
        best, normal = descend(kind_a, a, kind_b, b, best, normal)
    if best == np.inf:
        # No face could be measured: there is nothing to say.
        best, normal = np.nan, (np.nan, np.nan, np.nan)
    return best, normal


@kernel
def flat_depth(kind_a: int, a: Row, kind_b: int, b: Row, n: Vec3) -> tuple[float, Vec3]:
    """Depth of two cores whose difference is flat, and the direction of B's way out.

    Args:
        kind_a: ShapeKind of A.
        a: Its row.
        kind_b: ShapeKind of B.
        b: Its row.
        n: Unit normal of the difference.
    """
    w, _p = difference(kind_a, a, kind_b, b, n)
    other, _p = difference(kind_a, a, kind_b, b, scaled(-1.0, n))
    up, down = dot(w, n), -dot(other, n)
    if up <= down:
        return up, n
    return down, scaled(-1.0, n)


@kernel(inline=False)
def spread_out(
    kind_a: int,
    a: Row,
    kind_b: int,
    b: Row,
    corners: Matrix,
    count: int,
    largest: float,
) -> tuple[int, Vec3]:
    """Add support points until there are four corners that span a volume.

    Returns:
        Four, and anything; or fewer if A - B is flat, and a unit normal of it.
    """
    tiny = FLAT * largest
    first = (corners[0, 0], corners[0, 1], corners[0, 2])
    axis = (1.0, 0.0, 0.0)
    if count == 1:
        far = 0.0
        for k in range(6):
            d = scaled(1.0 if k < 3 else -1.0, axis_of(k % 3))
            w, _p = difference(kind_a, a, kind_b, b, d)
            reach = norm(sub(w, first))
            if reach > far:
                far = reach
                put_corner(corners, 1, w)
        if not far > tiny:
            return 1, axis
        count = 2
    second = (corners[1, 0], corners[1, 1], corners[1, 2])
    axis = scaled(1.0 / norm(sub(second, first)), sub(second, first))
    side = any_perpendicular(axis)
    if count == 2:
        far = 0.0
        other = cross(axis, side)
        for k in range(6):
            angle = k * 1.0471975511965976
            d = add(scaled(cos(angle), side), scaled(sin(angle), other))
            w, _p = difference(kind_a, a, kind_b, b, d)
            out = sub(w, first)
            reach = norm(along(out, -dot(out, axis), axis))
            if reach > far:
                far = reach
                put_corner(corners, 2, w)
        if not far > tiny:
            return 2, side
        count = 3
    third = (corners[2, 0], corners[2, 1], corners[2, 2])
    n = cross(sub(second, first), sub(third, first))
    if not norm(n) > 0.0:
        return 2, side
    n = scaled(1.0 / norm(n), n)
    if count == 3:
        high, _p = difference(kind_a, a, kind_b, b, n)
        low, _p = difference(kind_a, a, kind_b, b, scaled(-1.0, n))
        above, below = dot(sub(high, first), n), -dot(sub(low, first), n)
        if not max(above, below) > tiny:
            return 3, n
        put_corner(corners, 3, high if above >= below else low)
    return 4, n


@kernel
def focus(used: int) -> float:
    """Cosine of the cone about the best direction in which faces are looked for.

    Where much of the surface is about as near, as in nested shapes, there are never
    corners enough for all of it: most of them go to the whole, the rest closer and
    closer to the best direction found from there.
    """
    if used < WHOLE:
        return -2.0
    if used < (WHOLE + MOST_CORNERS) // 2:
        return 0.99
    return 0.9999
