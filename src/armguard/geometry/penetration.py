"""Depth of two cores that overlap: the expanding polytope algorithm.

The shortest translation that separates A and B leads to the point of A - B's surface
nearest to the origin. A polytope inside A - B grows towards it, a support point a step:
its nearest face is a lower bound of the depth, and the width of A - B in any direction
an upper one.
"""

from math import cos, sin

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.geometry.box_separation import axis_of
from armguard.geometry.gjk import TOUCHING
from armguard.geometry.narrowest import descend, difference, narrowest
from armguard.geometry.simplex import on_triangle
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

Row = NDArray[np.float64]
Matrix = NDArray[np.float64]

# Room for corners and faces; a corner more is two faces more. So many of them go to
# the whole surface, see `focus` [-].
MOST_CORNERS = 100
WHOLE = 64
MOST_FACES = 2 * MOST_CORNERS + 8
MOST_EDGES = 3 * MOST_FACES

# A face: its corners 0-2, unit normal outwards 3-5, distance of its plane 6, and
# whether it sees the new corner.
FACE = 8
SEES = 7

# Tolerances tried until the faces that see a corner are one patch [-].
ATTEMPTS = 8

# Lower and upper bound may differ by this share of the largest number met [-].
PRECISION = 1e-11

# Farther outside than this share, the direction to the origin is worth more than the
# normals of faces [-].
OUTSIDE = 1e-7

# Corners nearer to a plane, line or point than this share count as in it [-].
FLAT = 1e-12


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
    """Depth of two cores that meet, or come so near that it is hard to tell.

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
    corners = numba.carray(stack(300), (100, 3), np.float64)
    faces = numba.carray(stack(1664), (208, FACE), np.float64)
    edges = numba.carray(stack(1248), (624, 2), np.float64)
    for k in range(count):
        put_corner(corners, k, (simplex[k, 0], simplex[k, 1], simplex[k, 2]))
    used, flat_normal = spread_out(kind_a, a, kind_b, b, corners, count, largest)
    if used < 4 and norm(v) > TOUCHING * largest:
        return -norm(v), scaled(-1.0 / norm(v), v)
    if used < 4:
        # A - B has no volume: along its normal nothing has to be moved.
        w, _p = difference(kind_a, a, kind_b, b, flat_normal)
        other, _p = difference(kind_a, a, kind_b, b, scaled(-1.0, flat_normal))
        up, down = dot(w, flat_normal), -dot(other, flat_normal)
        if up <= down:
            return up, flat_normal
        return down, scaled(-1.0, flat_normal)
    face_count = first_faces(corners, faces)
    best, normal = np.inf, (1.0, 0.0, 0.0)
    whole = True
    while True:
        if used >= WHOLE and whole:
            whole = False
            if faces[nearest_face(faces, face_count, normal, -2.0), 6] >= 0.0:
                best, normal = narrowest(
                    kind_a, a, kind_b, b, faces, face_count, best, normal
                )
        face = nearest_face(faces, face_count, normal, focus(used))
        if face < 0:
            # Nothing left to look at there.
            break
        lower = faces[face, 6]
        n = (faces[face, 3], faces[face, 4], faces[face, 5])
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
def nearest_point(corners: Matrix, faces: Matrix, count: int) -> Vec3:
    """The point of the polytope's surface nearest to the origin."""
    best = np.inf
    nearest = (0.0, 0.0, 0.0)
    for f in range(count):
        if faces[f, 6] < 0.0:
            i, j, k = int(faces[f, 0]), int(faces[f, 1]), int(faces[f, 2])
            p, q, r = (
                corner_at(corners, i),
                corner_at(corners, j),
                corner_at(corners, k),
            )
            s, t, u, _v = on_triangle(p, q, r)
            v = along(along(scaled(s, p), t, q), u, r)
            if dot(v, v) < best:
                best, nearest = dot(v, v), v
    return nearest


@kernel
def face_that_sees(faces: Matrix, count: int, w: Vec3) -> int:
    """The face over whose plane a corner stands out most."""
    best, most = 0, -np.inf
    for f in range(count):
        height = dot((faces[f, 3], faces[f, 4], faces[f, 5]), w) - faces[f, 6]
        if height > most:
            best, most = f, height
    return best


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
        if above >= below:
            put_corner(corners, 3, high)
        else:
            put_corner(corners, 3, low)
    return 4, n


@kernel
def put_corner(corners: Matrix, k: int, w: Vec3) -> None:
    """Write corner k."""
    corners[k, 0], corners[k, 1], corners[k, 2] = w


@kernel
def corner_at(corners: Matrix, k: int) -> Vec3:
    """Corner k of the polytope."""
    return (corners[k, 0], corners[k, 1], corners[k, 2])


@kernel(inline=False)
def write_face(corners: Matrix, faces: Matrix, at: int, i: int, j: int, k: int) -> None:
    """Write a face whose corners go round counter-clockwise as seen from outside."""
    p, q, r = corner_at(corners, i), corner_at(corners, j), corner_at(corners, k)
    n = cross(sub(q, p), sub(r, p))
    length = norm(n)
    faces[at, 0], faces[at, 1], faces[at, 2] = i, j, k
    if length > 0.0:
        n = scaled(1.0 / length, n)
        distance = min(dot(n, p), dot(n, q), dot(n, r))
    else:
        # A face without area bounds nothing.
        distance = np.inf
    faces[at, 3], faces[at, 4], faces[at, 5] = n
    faces[at, 6] = distance


@kernel
def first_faces(corners: Matrix, faces: Matrix) -> int:
    """The four faces of the first tetrahedron."""
    p = corner_at(corners, 0)
    u, v, w = (
        sub(corner_at(corners, 1), p),
        sub(corner_at(corners, 2), p),
        sub(corner_at(corners, 3), p),
    )
    if dot(cross(u, v), w) > 0.0:
        p, q = corner_at(corners, 1), corner_at(corners, 2)
        put_corner(corners, 1, q)
        put_corner(corners, 2, p)
    write_face(corners, faces, 0, 0, 1, 2)
    write_face(corners, faces, 1, 0, 3, 1)
    write_face(corners, faces, 2, 0, 2, 3)
    write_face(corners, faces, 3, 1, 3, 2)
    return 4


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


@kernel
def nearest_face(faces: Matrix, count: int, about: Vec3, cosine: float) -> int:
    """The face whose plane is nearest, the first of several; -1 if there is none.

    Args:
        faces: Faces.
        count: How many there are.
        about: A direction.
        cosine: Only faces whose normals are that near to it.
    """
    nearest, least = -1, np.inf
    for k in range(count):
        if faces[k, 6] < least:
            n = (faces[k, 3], faces[k, 4], faces[k, 5])
            if dot(n, about) > cosine:
                least = faces[k, 6]
                nearest = k
    return nearest


@kernel(inline=False)
def add_corner(
    corners: Matrix,
    new: int,
    faces: Matrix,
    face_count: int,
    seed: int,
    edges: Matrix,
    largest: float,
) -> int:
    """Replace the faces that see a new corner by faces that meet in it.

    In exact arithmetic these faces are one patch with one border. Round-off may decide
    differently for faces the corner lies in the plane of; then another tolerance is
    tried, so that the polytope stays closed whatever happens.

    Args:
        corners: Corners, the new one included.
        new: Its number.
        faces: Faces.
        face_count: How many there are.
        seed: A face that sees it.
        edges: Scratch for the border.
        largest: The largest number met [m].

    Returns:
        How many faces there are now; -1 if there is no way to add the corner.
    """
    w = (corners[new, 0], corners[new, 1], corners[new, 2])
    for attempt in range(ATTEMPTS):
        tolerance = FLAT * largest * (1.0 if attempt % 2 == 0 else -1.0)
        tolerance *= 10.0 ** (attempt // 2)
        mark_patch(faces, face_count, seed, w, tolerance)
        edge_count = border(faces, face_count, edges)
        if edge_count >= 3 and is_loop(edges, edge_count):
            break
    else:
        return -1
    face = 0
    left = face_count
    while face < left:
        if faces[face, SEES] != 2.0:
            face += 1
            continue
        left -= 1
        for k in range(FACE):
            faces[face, k] = faces[left, k]
    if left + edge_count > faces.shape[0]:
        return -1
    for e in range(edge_count):
        write_face(corners, faces, left, int(edges[e, 0]), int(edges[e, 1]), new)
        left += 1
    return int(left)


@kernel
def mark_patch(faces: Matrix, count: int, seed: int, w: Vec3, tolerance: float) -> None:
    """Mark with 2 the faces that see w and join the seed edge by edge."""
    for f in range(count):
        n = (faces[f, 3], faces[f, 4], faces[f, 5])
        faces[f, SEES] = 1.0 if dot(n, w) - faces[f, 6] > tolerance else 0.0
    faces[seed, SEES] = 2.0
    grows = True
    while grows:
        grows = False
        for f in range(count):
            if faces[f, SEES] != 1.0:
                continue
            for g in range(count):
                if faces[g, SEES] == 2.0 and share_edge(faces, f, g):
                    faces[f, SEES] = 2.0
                    grows = True
                    break


@kernel
def share_edge(faces: Matrix, f: int, g: int) -> bool:
    """Whether two faces have two corners in common."""
    common = 0
    for i in range(3):
        for j in range(3):
            common += faces[f, i] == faces[g, j]
    return bool(common >= 2)


@kernel
def border(faces: Matrix, count: int, edges: Matrix) -> int:
    """Write the border of the marked patch, as edges that go round it."""
    edge_count = 0
    for f in range(count):
        if faces[f, SEES] == 2.0:
            for k in range(3):
                i, j = faces[f, k], faces[f, (k + 1) % 3]
                edge_count = toggle_edge(edges, edge_count, i, j)
    return int(edge_count)


@kernel
def is_loop(edges: Matrix, count: int) -> bool:
    """Whether edges make one closed walk that meets no corner twice."""
    at = edges[0, 1]
    for _ in range(count - 1):
        follower = -1
        for e in range(count):
            if edges[e, 0] == at:
                if follower >= 0:
                    return False
                follower = e
        if follower <= 0:
            return False
        at = edges[follower, 1]
    return bool(at == edges[0, 0])


@kernel
def toggle_edge(edges: Matrix, count: int, i: float, j: float) -> int:
    """Note an edge of a removed face; one that two of them share is gone."""
    for e in range(count):
        if edges[e, 0] == j and edges[e, 1] == i:
            count -= 1
            edges[e, 0], edges[e, 1] = edges[count, 0], edges[count, 1]
            return count
    edges[count, 0], edges[count, 1] = i, j
    return count + 1
