"""Triangles in a binary tree of boxes, and distances to them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel

Floats = NDArray[np.float64]

# Most triangles of a leaf [-].
LEAF = 4


class TriangleTree(NamedTuple):
    """A complete binary tree: node 1 is the root, node k has children 2k and 2k + 1.

    Attributes:
        triangles: Corners by leaf, the same number for each; some triangles are there
            twice, shape (n, 3, 3) [m].
        boxes: Lower and upper corner of the box of each node, shape (2 · leaves, 6);
            row 0 is unused [m].
    """

    triangles: Floats
    boxes: Floats


def triangle_tree(triangles: Floats) -> TriangleTree:
    """The tree of some triangles: all nodes of a level are halved along one axis.

    Args:
        triangles: Corners, shape (n, 3, 3) with n >= 1 [m].
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    middle = a + b + c
    extent = np.ptp(middle, axis=0)
    depth = max(int(np.ceil(np.log2(len(triangles) / LEAF))), 0)
    size = -(-len(triangles) // 2**depth)
    order = np.arange(2**depth * size) * len(triangles) // (2**depth * size)
    for level in range(depth):
        axis = int(extent.argmax())
        extent[axis] /= 2.0
        groups = order.reshape(2**level, -1)
        half = groups.shape[1] // 2
        halves = middle[groups, axis].argpartition(half - 1, axis=1)
        order = np.take_along_axis(groups, halves, axis=1)
    order = order.ravel()
    low = np.minimum(np.minimum(a, b), c)[order]
    high = np.maximum(np.maximum(a, b), c)[order]
    box = np.concatenate([low, -high], axis=1).reshape(2**depth, size, 6).min(axis=1)
    levels = [box]
    while len(box) > 1:
        box = np.minimum(box[::2], box[1::2])
        levels.append(box)
    boxes = np.concatenate([np.zeros((1, 6)), *levels[::-1]])
    boxes[:, 3:] *= -1.0
    return TriangleTree(np.ascontiguousarray(triangles[order]), boxes)


@kernel
def box_distance2(x: float, y: float, z: float, box: Floats) -> float:
    """Squared distance of a point to a box [m²]."""
    dx = max(box[0] - x, 0.0, x - box[3])
    dy = max(box[1] - y, 0.0, y - box[4])
    dz = max(box[2] - z, 0.0, z - box[5])
    return float(dx * dx + dy * dy + dz * dz)


@kernel
def near_leaf(x: float, y: float, z: float, boxes: Floats) -> int:
    """A leaf near a point: at each node the child whose box is nearer."""
    node = 1
    while 2 * node < boxes.shape[0]:
        node *= 2
        left = box_distance2(x, y, z, boxes[node])
        if box_distance2(x, y, z, boxes[node + 1]) < left:
            node += 1
    return node


@kernel
def next_node(node: int) -> int:
    """The node after a node and all below it; 1 at the end."""
    node += 1
    while node % 2 == 0:
        node //= 2
    return node


@kernel
def leaf_triangles(leaf: int, triangles: Floats, boxes: Floats) -> tuple[int, int]:
    """Indices of a leaf's first triangle, and of the one after its last."""
    leaves = boxes.shape[0] // 2
    size = triangles.shape[0] // leaves
    return size * (leaf - leaves), size * (leaf - leaves + 1)


@kernel
def leaf_distance2(
    x: float, y: float, z: float, leaf: int, triangles: Floats, boxes: Floats
) -> float:
    """Squared distance of a point to the triangles of a leaf [m²]."""
    best2 = np.inf
    first, last = leaf_triangles(leaf, triangles, boxes)
    for t in range(first, last):
        best2 = min(best2, triangle_distance2(x, y, z, triangles[t]))
    return best2


@kernel
def triangle_distance2(x: float, y: float, z: float, t: Floats) -> float:
    """Squared distance of a point to a triangle [m²].

    References:
        Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
    """
    abx, aby, abz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    acx, acy, acz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    px, py, pz = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    d1 = abx * px + aby * py + abz * pz
    d2 = acx * px + acy * py + acz * pz
    ab2 = abx * abx + aby * aby + abz * abz
    ac2 = acx * acx + acy * acy + acz * acz
    abac = abx * acx + aby * acy + abz * acz
    det = ab2 * ac2 - abac * abac
    v = ac2 * d1 - abac * d2
    w = ab2 * d2 - abac * d1
    if det > 1e-18 * ab2 * ac2 and v >= 0.0 and w >= 0.0 and v + w <= det:
        v, w = v / det, w / det
        ex, ey, ez = (
            px - v * abx - w * acx,
            py - v * aby - w * acy,
            pz - v * abz - w * acz,
        )
        return float(ex * ex + ey * ey + ez * ez)
    best = edge_distance2(px, py, pz, abx, aby, abz)
    best = min(best, edge_distance2(px, py, pz, acx, acy, acz))
    third = edge_distance2(
        px - abx, py - aby, pz - abz, acx - abx, acy - aby, acz - abz
    )
    return float(min(best, third))


@kernel
def edge_distance2(
    px: float, py: float, pz: float, ux: float, uy: float, uz: float
) -> float:
    """Squared distance of a point to the segment from the origin along u [m²]."""
    uu = ux * ux + uy * uy + uz * uz
    t = (px * ux + py * uy + pz * uz) / uu if uu > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    x, y, z = px - t * ux, py - t * uy, pz - t * uz
    return x * x + y * y + z * z
