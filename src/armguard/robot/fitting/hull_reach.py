"""How far a hull reaches beyond the mesh it holds: into its dents and between parts."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.kernel import kernel
from armguard.robot.fitting.proof import quartered
from armguard.robot.fitting.triangle_tree import (
    box_distance2,
    leaf_triangles,
    near_leaf,
    next_node,
    triangle_distance2,
    triangle_tree,
)

Floats = NDArray[np.float64]

# The bound is no larger than what was found by more than this share of it, or by this
# much, whichever is larger.
SHARE = 0.03
SLACK = 2e-4  # [m]

# Halvings, and pieces at a time, after which the bound is left as it is [-].
DEPTH = 12
PIECES = 20_000


def hull_reach(faces: Floats, triangles: Floats) -> float:
    """Bound on the distance of a hull's surface to the mesh it holds [m].

    Branch and bound. The distance to one triangle is convex, so over a piece of a face
    it is largest at a corner; the triangle for which that is least gives a bound. Where
    a face of the hull is a face of the mesh, that is 0 at once.

    Args:
        faces: Triangles of the hull's surface, shape (m, 3, 3) [m].
        triangles: Triangles of the mesh, shape (n, 3, 3) [m].
    """
    tree = triangle_tree(triangles)
    left = np.ascontiguousarray(faces)
    found = 0.0
    for level in range(DEPTH + 1):
        bounds = np.zeros((len(left), 2))
        bound_pieces(left, *tree, bounds)
        found = max(found, float(bounds[:, 0].max(initial=0.0)))
        enough = found + max(SHARE * found, SLACK)
        open_ = bounds[:, 1] > enough
        if not open_.any():
            return enough if found > 0.0 else float(bounds[:, 1].max(initial=0.0))
        if level == DEPTH or 4 * int(open_.sum()) > PIECES:
            break
        left = quartered(left[open_])
    return float(bounds[:, 1].max())


@kernel(inline=False, entry=True)
def bound_pieces(
    pieces: Floats, triangles: Floats, boxes: Floats, bounds: Floats
) -> None:
    """Least and greatest the largest distance of a piece to the mesh can be.

    Args:
        pieces: Corners, shape (k, 3, 3) [m].
        triangles: Triangles of a `TriangleTree`, shape (n, 3, 3) [m].
        boxes: Its boxes, shape (2 · leaves, 6) [m].
        bounds: Overwritten, shape (k, 2) [m].
    """
    at = array_at(stack(3), (3,), np.float64)
    for k in range(pieces.shape[0]):
        piece = pieces[k]
        at[:] = np.inf
        x = (piece[0, 0] + piece[1, 0] + piece[2, 0]) / 3.0
        y = (piece[0, 1] + piece[1, 1] + piece[2, 1]) / 3.0
        z = (piece[0, 2] + piece[1, 2] + piece[2, 2]) / 3.0
        most = leaf_reach2(piece, near_leaf(x, y, z, boxes), triangles, boxes, at)
        node = 1
        while True:
            nearer, reach = False, 0.0
            for c in range(3):
                x, y, z = piece[c, 0], piece[c, 1], piece[c, 2]
                apart = box_distance2(x, y, z, boxes[node])
                nearer = nearer or apart < at[c]
                reach = max(reach, apart)
            if nearer or reach < most:
                if 2 * node < boxes.shape[0]:
                    node *= 2
                    continue
                most = min(most, leaf_reach2(piece, node, triangles, boxes, at))
            node = next_node(node)
            if node == 1:
                break
        bounds[k, 0] = sqrt(max(at[0], at[1], at[2]))
        bounds[k, 1] = sqrt(most)


@kernel
def leaf_reach2(
    piece: Floats, leaf: int, triangles: Floats, boxes: Floats, at: Floats
) -> float:
    """Least over the triangles of a leaf of a piece's largest distance, squared [m²].

    Args:
        piece: Corners, shape (3, 3) [m].
        leaf: The leaf.
        triangles: Triangles of a `TriangleTree`, shape (n, 3, 3) [m].
        boxes: Its boxes, shape (2 · leaves, 6) [m].
        at: Least squared distance of each corner, lowered, shape (3,) [m²].
    """
    most = np.inf
    first, last = leaf_triangles(leaf, triangles, boxes)
    for t in range(first, last):
        reach = 0.0
        for c in range(3):
            x, y, z = piece[c, 0], piece[c, 1], piece[c, 2]
            square = triangle_distance2(x, y, z, triangles[t])
            at[c] = min(at[c], square)
            reach = max(reach, square)
        most = min(most, reach)
    return most
