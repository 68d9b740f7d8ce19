"""Overreach: how far the fitted surface stands off the surface it encloses."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pairs import measure
from armguard.geometry.shapes import Box, PlacedShape, shape_row
from armguard.kernel import kernel
from armguard.robot.fitting.hausdorff import directions

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def overreaches(
    triangles: Floats, shapes: Sequence[PlacedShape], spacing: float
) -> list[float]:
    """Largest distance of each primitive's share of the surface to the triangles [m].

    Sampled, and then made a bound: no point of the surface is farther from a sample
    than the spacing, and a distance grows no faster than one goes.

    Args:
        triangles: Corners of the enclosed surface, shape (n, 3, 3) [m].
        shapes: Primitives whose union is the fitted surface.
        spacing: Largest distance of a surface point to a sample [m].
    """
    rows = np.array([shape_row(s.shape, s.pose.matrix()) for s in shapes])
    kinds = np.array([int(s.shape.kind) for s in shapes], dtype=np.int32)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    found = []
    for k, placed in enumerate(shapes):
        samples = surface_samples(placed, spacing)
        distance = farthest(k, samples, rows, kinds, triangles, low, high)
        found.append(float(distance) + spacing if distance > 0.0 else 0.0)
    return found


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
    low: Floats,
    high: Floats,
) -> float:
    """Largest distance to the triangles of the samples no other primitive covers [m].

    Args:
        own: The primitive the samples are of.
        samples: Points, shape (k, 3) [m].
        rows: Rows of all primitives, shape (p, 16).
        kinds: Their kinds, shape (p,).
        triangles: Corners, shape (n, 3, 3) [m].
        low: Lower corners of the triangles' boxes, shape (n, 3) [m].
        high: Upper corners, shape (n, 3) [m].
    """
    point = np.zeros(16)
    witness = np.zeros(10)
    worst = 0.0
    last = 0
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
        best2 = triangle_distance2(x, y, z, triangles[last])
        for t in range(triangles.shape[0]):
            if best2 <= worst * worst:
                break
            dx = max(low[t, 0] - x, 0.0, x - high[t, 0])
            dy = max(low[t, 1] - y, 0.0, y - high[t, 1])
            dz = max(low[t, 2] - z, 0.0, z - high[t, 2])
            if dx * dx + dy * dy + dz * dz < best2:
                d2 = triangle_distance2(x, y, z, triangles[t])
                if d2 < best2:
                    best2, last = d2, t
        worst = max(worst, sqrt(best2))
    return worst


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
