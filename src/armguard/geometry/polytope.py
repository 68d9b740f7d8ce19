"""A convex polytope that grows a corner at a time, in scratch arrays.

Corners are rows of three numbers. Its surface is always closed: a corner is added as a
whole, or not at all.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.simplex import on_triangle
from armguard.geometry.vec3 import Vec3, along, cross, dot, norm, scaled, sub
from armguard.kernel import kernel
from armguard.record import Records, record

Matrix = NDArray[np.float64]
Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Marks of faces: the new corner is beneath the plane; above it; above it, and the face
# joins the patch that is replaced.
HIDDEN = 0
SEES = 1
IN_PATCH = 2

# Tolerances tried until the faces that see a corner are one patch [-].
ATTEMPTS = 8

# Corners nearer to a plane, line or point than this share count as in it [-].
FLAT = 1e-12


@record
class Face:
    """A face of the polytope.

    Attributes:
        corners: Its corners, shape (3,).
        normal: Its unit normal outwards, shape (3,) [-].
        distance: Distance of its plane from the origin [m].
        mark: Scratch: see HIDDEN; in `narrowest`, 1 if it need not be tested any more.
    """

    corners: Annotated[Longs, (3,)]
    normal: Annotated[Floats, (3,)]
    distance: float
    mark: int


@kernel
def first_faces(corners: Matrix, faces: Records[Face]) -> int:
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
def write_face(
    corners: Matrix, faces: Records[Face], at: int, i: int, j: int, k: int
) -> None:
    """Write a face whose corners go round counter-clockwise as seen from outside."""
    p, q, r = corner_at(corners, i), corner_at(corners, j), corner_at(corners, k)
    n = cross(sub(q, p), sub(r, p))
    length = norm(n)
    face = faces[at]
    face.corners[0], face.corners[1], face.corners[2] = i, j, k
    if length > 0.0:
        n = scaled(1.0 / length, n)
        distance = min(dot(n, p), dot(n, q), dot(n, r))
    else:
        # A face without area bounds nothing.
        distance = np.inf
    face.normal[0], face.normal[1], face.normal[2] = n
    face.distance = distance


@kernel
def normal_of(face: Face) -> Vec3:
    """Unit normal of a face, outwards."""
    return (face.normal[0], face.normal[1], face.normal[2])


@kernel
def put_corner(corners: Matrix, k: int, w: Vec3) -> None:
    """Write corner k."""
    corners[k, 0], corners[k, 1], corners[k, 2] = w


@kernel
def corner_at(corners: Matrix, k: int) -> Vec3:
    """Corner k of the polytope."""
    return (corners[k, 0], corners[k, 1], corners[k, 2])


@kernel
def nearest_face(faces: Records[Face], count: int, about: Vec3, cosine: float) -> int:
    """The face whose plane is nearest, the first of several; -1 if there is none.

    Args:
        faces: Faces.
        count: How many there are.
        about: A direction.
        cosine: Only faces whose normals are that near to it.
    """
    nearest, least = -1, np.inf
    for k in range(count):
        if faces[k].distance < least and dot(normal_of(faces[k]), about) > cosine:
            nearest, least = k, faces[k].distance
    return nearest


@kernel
def nearest_point(corners: Matrix, faces: Records[Face], count: int) -> Vec3:
    """The point of the polytope's surface nearest to the origin."""
    best = np.inf
    nearest = (0.0, 0.0, 0.0)
    for f in range(count):
        if faces[f].distance < 0.0:
            own = faces[f].corners
            p, q, r = (
                corner_at(corners, own[0]),
                corner_at(corners, own[1]),
                corner_at(corners, own[2]),
            )
            s, t, u, _v = on_triangle(p, q, r)
            v = along(along(scaled(s, p), t, q), u, r)
            if dot(v, v) < best:
                best, nearest = dot(v, v), v
    return nearest


@kernel
def face_that_sees(faces: Records[Face], count: int, w: Vec3) -> int:
    """The face beyond whose plane a corner lies farthest."""
    best, most = 0, -np.inf
    for f in range(count):
        height = dot(normal_of(faces[f]), w) - faces[f].distance
        if height > most:
            best, most = f, height
    return best


@kernel(inline=False)
def add_corner(
    corners: Matrix,
    new: int,
    faces: Records[Face],
    face_count: int,
    seed: int,
    edges: Longs,
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
        if faces[face].mark != IN_PATCH:
            face += 1
            continue
        left -= 1
        faces[face] = faces[left]
    if left + edge_count > faces.shape[0]:
        return -1
    for e in range(edge_count):
        write_face(corners, faces, left, edges[e, 0], edges[e, 1], new)
        left += 1
    return int(left)


@kernel
def mark_patch(
    faces: Records[Face], count: int, seed: int, w: Vec3, tolerance: float
) -> None:
    """Mark with IN_PATCH the faces that see w and join the seed edge by edge."""
    for f in range(count):
        height = dot(normal_of(faces[f]), w) - faces[f].distance
        faces[f].mark = SEES if height > tolerance else HIDDEN
    faces[seed].mark = IN_PATCH
    grows = True
    while grows:
        grows = False
        for f in range(count):
            if faces[f].mark != SEES:
                continue
            for g in range(count):
                if faces[g].mark == IN_PATCH and share_edge(faces[f], faces[g]):
                    faces[f].mark = IN_PATCH
                    grows = True
                    break


@kernel
def share_edge(a: Face, b: Face) -> bool:
    """Whether two faces have two corners in common."""
    common = 0
    for i in range(3):
        for j in range(3):
            common += a.corners[i] == b.corners[j]
    return bool(common >= 2)


@kernel
def border(faces: Records[Face], count: int, edges: Longs) -> int:
    """Write the border of the marked patch, as edges that go round it."""
    edge_count = 0
    for f in range(count):
        if faces[f].mark == IN_PATCH:
            for k in range(3):
                own = faces[f].corners
                edge_count = toggle_edge(edges, edge_count, own[k], own[(k + 1) % 3])
    return int(edge_count)


@kernel
def is_loop(edges: Longs, count: int) -> bool:
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
def toggle_edge(edges: Longs, count: int, i: int, j: int) -> int:
    """Note an edge of a removed face; one that two of them share is gone."""
    for e in range(count):
        if edges[e, 0] == j and edges[e, 1] == i:
            count -= 1
            edges[e, 0], edges[e, 1] = edges[count, 0], edges[count, 1]
            return count
    edges[count, 0], edges[count, 1] = i, j
    return count + 1
