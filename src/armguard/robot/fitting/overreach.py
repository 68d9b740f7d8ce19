"""Overreach: distance of the fitted surface from the surface it encloses."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import Box, PlacedShape, shape_row
from armguard.kernel import kernel
from armguard.robot.fitting.hausdorff import directions
from armguard.robot.fitting.triangle_tree import (
    TriangleTree,
    box_distance2,
    leaf_distance2,
    next_node,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def overreaches(
    tree: TriangleTree, shapes: Sequence[PlacedShape], spacing: float
) -> list[float]:
    """The overreach of each of some primitives [m]; see `overreach`."""
    return [overreach(tree, shapes, k, spacing) for k in range(len(shapes))]


def overreach(
    tree: TriangleTree, shapes: Sequence[PlacedShape], own: int, spacing: float
) -> float:
    """Largest distance of a primitive's share of the surface to the triangles [m].

    Sampled, and then made a bound: no point of the surface is farther from a sample
    than the spacing, and a distance grows no faster than one goes.

    Args:
        tree: The enclosed surface.
        shapes: Primitives whose union is the fitted surface.
        own: Index of the primitive.
        spacing: Largest distance of a surface point to a sample [m].
    """
    rows = np.array([shape_row(s.shape, s.pose.matrix()) for s in shapes])
    kinds = np.array([int(s.shape.kind) for s in shapes], dtype=np.int32)
    samples = surface_samples(shapes[own], spacing)
    distance = float(farthest(own, samples, rows, kinds, *tree))
    return distance + spacing if distance > 0.0 else 0.0


def surface_samples(placed: PlacedShape, spacing: float) -> Floats:
    """Points of a primitive's surface, none of it farther than `spacing` from one.

    A rounded core's surface is the core's surface moved out along its normals: patches
    of plane, of cylinder and of sphere.
    """
    row = shape_row(placed.shape, placed.pose.matrix())
    radius = row[0]
    if isinstance(placed.shape, Box):
        R, centre, half = row[7:16].reshape(3, 3), row[1:4], row[4:7]
    else:
        ends = (row[1:4], row[4:7] if placed.shape.kind == 1 else row[1:4])
        axis = ends[1] - ends[0]
        length = float(np.linalg.norm(axis))
        R = frame_along(axis)
        centre, half = (ends[0] + ends[1]) / 2.0, np.array([0.0, 0.0, length / 2.0])
    # The sphere part: even spacing; the covering radius of the spiral lattice is
    # below 2.6 / sqrt(n) of its radius.
    count = max(int(np.ceil((2.6 * radius / (0.7 * spacing)) ** 2)), 26)
    normals = np.concatenate([directions(count), faces_and_edges(radius, spacing)])
    pieces = []
    grids = [steps(h, 0.7 * spacing) for h in half]
    signs = np.where(normals >= 0.0, 1.0, -1.0)
    pieces.append(signs * half + radius * normals)
    for a in range(3):
        if half[a] <= 0.0:
            continue
        # Edges along axis a: the quarter cylinders, as full circles about the axis.
        around = normals[np.abs(normals[:, a]) < 1e-12]
        for x in grids[a]:
            offset = np.where(around >= 0.0, 1.0, -1.0) * half
            offset[:, a] = x
            pieces.append(offset + radius * around)
        b, c = (a + 1) % 3, (a + 2) % 3
        if half[b] <= 0.0:
            continue
        for side in (-1.0, 1.0):
            u, v = np.meshgrid(grids[a], grids[b], indexing="ij")
            patch = np.zeros((u.size, 3))
            patch[:, a], patch[:, b] = u.ravel(), v.ravel()
            patch[:, c] = side * (half[c] + radius)
            pieces.append(patch)
    return np.ascontiguousarray(centre + np.concatenate(pieces) @ R.T)


def steps(half: float, spacing: float) -> Floats:
    """Places from -half to half, at most `spacing` apart."""
    return np.linspace(-half, half, max(int(np.ceil(2.0 * half / spacing)), 1) + 1)


def faces_and_edges(radius: float, spacing: float) -> Floats:
    """Directions in the three coordinate planes, finely spaced, shape (k, 3)."""
    count = max(int(np.ceil(2.0 * np.pi * radius / spacing)), 8)
    count += -count % 4
    angle = np.arange(count) * 2.0 * np.pi / count
    c, s, z = np.cos(angle), np.sin(angle), np.zeros(count)
    c[np.abs(c) < 1e-12], s[np.abs(s) < 1e-12] = 0.0, 0.0
    return np.concatenate(
        [np.column_stack(v) for v in ((c, s, z), (z, c, s), (s, z, c))]
    )


def frame_along(axis: Floats) -> Floats:
    """A rotation whose z is along an axis, shape (3, 3)."""
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        return np.eye(3)
    z = axis / length
    helper = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


@kernel(inline=False, entry=True)
def farthest(
    own: int,
    samples: Floats,
    rows: Floats,
    kinds: Ints,
    triangles: Floats,
    boxes: Floats,
) -> float:
    """Largest distance to the triangles of the samples no other primitive covers [m].

    Args:
        own: The primitive the samples are of.
        samples: Points, shape (k, 3) [m].
        rows: Rows of all primitives, shape (p, 16).
        kinds: Their kinds, shape (p,).
        triangles: Triangles of a `TriangleTree`, shape (n, 3, 3) [m].
        boxes: Its boxes, shape (2 · leaves, 6) [m].
    """
    point = array_at(stack(16), (16,), np.float64)
    witness = array_at(stack(10), (10,), np.float64)
    point[:] = 0.0
    worst = 0.0
    last = boxes.shape[0] // 2
    for s in range(samples.shape[0]):
        x, y, z = samples[s, 0], samples[s, 1], samples[s, 2]
        point[1], point[2], point[3] = x, y, z
        covered = False
        for k in range(rows.shape[0]):
            if k != own:
                measure(0, point, kinds[k], rows[k], witness)
                if witness[0] < 0.0:
                    covered = True
                    break
        if covered:
            continue
        # The samples are in order: what is near to one is near to the next.
        best2 = leaf_distance2(x, y, z, last, triangles, boxes)
        node = 1
        while best2 > worst * worst:
            if box_distance2(x, y, z, boxes[node]) < best2:
                if 2 * node < boxes.shape[0]:
                    node *= 2
                    continue
                square = leaf_distance2(x, y, z, node, triangles, boxes)
                if square < best2:
                    best2, last = square, node
            node = next_node(node)
            if node == 1:
                break
        worst = max(worst, sqrt(best2))
    return worst
