"""A convex polytope that grows a corner at a time, in scratch matrices.

Corners are rows of three numbers. Its surface is always closed: a corner is added as a
whole, or not at all.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.simplex import on_triangle
from armguard.geometry.vec3 import Vec3, along, cross, dot, norm, scaled, sub
from armguard.kernel import kernel

Matrix = NDArray[np.float64]

# A face: its corners 0-2, unit normal outwards 3-5, distance of its plane 6, and
# whether it sees the new corner.
FACE = 8
SEES = 7

# Tolerances tried until the faces that see a corner are one patch [-].
ATTEMPTS = 8

# Corners nearer to a plane, line or point than this share count as in it [-].
FLAT = 1e-12


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
def put_corner(corners: Matrix, k: int, w: Vec3) -> None:
    """Write corner k."""
    corners[k, 0], corners[k, 1], corners[k, 2] = w


@kernel
def corner_at(corners: Matrix, k: int) -> Vec3:
    """Corner k of the polytope."""
    return (corners[k, 0], corners[k, 1], corners[k, 2])


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
