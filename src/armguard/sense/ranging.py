"""Kernels about rays, points and zones beside the primitives of a scene."""

from math import inf, sqrt

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.cells.masks import depth_at
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3, along, dot, norm, sub
from armguard.kernel import kernel

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]

BOX, SPHERE = int(ShapeKind.BOX), int(ShapeKind.SPHERE)

# A ray that comes this near to a surface is at it [m].
AT_SURFACE = 1e-3

# Steps along a ray, each as long as the distance to the shape. A ray that has not met a
# shape after so many only grazes it.
MOST_STEPS = 64


@kernel(inline=False, entry=True)
def place_rows(
    kinds: Ints, bodies: Ints, local: Floats, T_world: Floats, out: Floats
) -> None:
    """Rows of primitives in the world.

    Args:
        kinds: ShapeKind of each, shape (p,).
        bodies: Body that each rides on, -1 for the world, shape (p,).
        local: Their rows in the frame of the body, or in the world, shape (p, 16).
        T_world: Poses of the bodies, shape (b, 12).
        out: Rows in the world, overwritten, shape (p, 16).
    """
    for i in range(kinds.shape[0]):
        if bodies[i] < 0:
            out[i] = local[i]
        else:
            place_row(kinds[i], local[i], T_world[bodies[i]], out[i])


@kernel
def way_into(
    kind: int, row: Floats, origin: Vec3, way: Vec3, first: float, last: float,
    ball: Floats, out: Floats,
) -> float:  # fmt: skip
    """Distance along a ray at which it enters a shape, infinite if it does not.

    The distance to a convex shape is convex along a ray: once it rises, it falls no
    more. A ray that begins in the shape does not enter it.

    Args:
        kind: ShapeKind.
        row: Row of the shape, shape (16,).
        origin: Where the ray begins [m].
        way: Its direction, a unit vector.
        first: Distance before which it cannot enter [m].
        last: Distance up to which it is followed [m].
        ball: Row of a sphere, zero but for its centre, overwritten.
        out: Scratch, shape (10,).
    """
    if depth_at(kind, row, origin, ball, out)[0] <= AT_SURFACE:
        return inf
    t, before = first, inf
    for _ in range(MOST_STEPS):
        gap = depth_at(kind, row, along(origin, t, way), ball, out)[0]
        if gap <= AT_SURFACE:
            return t
        if not gap <= before:
            return inf
        t, before = t + gap, gap
        if t > last:
            return inf
    return inf


@kernel(inline=False, entry=True)
def cast(
    origin: Floats, ways: Floats, kinds: Ints, rows: Floats, balls: Floats,
    reach: float, out: Floats,
) -> None:  # fmt: skip
    """Where rays from one point enter the primitives.

    Args:
        origin: Where the rays begin, shape (3,) [m].
        ways: Their directions, unit vectors, shape (n, 3).
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, shape (p, 16).
        balls: Middle and radius of a ball about each, shape (p, 4) [m].
        reach: Distance up to which rays are followed [m].
        out: Of each ray the distance, infinite without a primitive, and the number of
            the primitive, -1 for none; overwritten, shape (n, 2) [m].
    """
    ball = numba.carray(stack(16), (16,), np.float64)
    found = numba.carray(stack(10), (10,), np.float64)
    ball[:] = 0.0
    start = (origin[0], origin[1], origin[2])
    for n in range(ways.shape[0]):
        way = (ways[n, 0], ways[n, 1], ways[n, 2])
        best, which = reach, -1
        for i in range(kinds.shape[0]):
            aside = sub((balls[i, 0], balls[i, 1], balls[i, 2]), start)
            radius, ahead = balls[i, 3], dot(aside, way)
            first = 0.0
            if radius < inf:
                across = dot(aside, aside) - ahead * ahead
                if across > radius * radius:
                    continue
                half = sqrt(radius * radius - max(across, 0.0))
                if ahead + half < 0.0 or ahead - half > best:
                    continue
                first = max(ahead - half, 0.0)
            t = way_into(kinds[i], rows[i], start, way, first, best, ball, found)
            if t < best:
                best, which = t, i
        out[n, 0] = best if which >= 0 else inf
        out[n, 1] = which


@kernel(inline=False, entry=True)
def touching(
    boxes: Floats, kinds: Ints, rows: Floats, balls: Floats, slack: Floats, out: Ints
) -> None:
    """The first primitive that each of some boxes comes near to.

    Args:
        boxes: Rows of the boxes, shape (n, 16).
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, shape (p, 16).
        balls: Middle and radius of a ball about each, shape (p, 4) [m].
        slack: How near to each, shape (n, p) [m].
        out: The primitives, -1 for none, overwritten, shape (n,).
    """
    found = numba.carray(stack(10), (10,), np.float64)
    for n in range(boxes.shape[0]):
        out[n] = -1
        middle = (boxes[n, 1], boxes[n, 2], boxes[n, 3])
        radius = norm((boxes[n, 4], boxes[n, 5], boxes[n, 6])) + boxes[n, 0]
        for i in range(kinds.shape[0]):
            apart = norm(sub((balls[i, 0], balls[i, 1], balls[i, 2]), middle))
            if apart > radius + balls[i, 3] + slack[n, i]:
                continue
            measure(BOX, boxes[n], kinds[i], rows[i], found)
            if found[0] <= slack[n, i]:
                out[n] = i
                break


@kernel(inline=False, entry=True)
def nearest(
    points: Floats, kinds: Ints, rows: Floats, balls: Floats, reach: float, out: Floats
) -> None:
    """The primitive that is nearest to each of some points.

    Args:
        points: The points, shape (n, 3) [m].
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, shape (p, 16).
        balls: Middle and radius of a ball about each, shape (p, 4) [m].
        reach: Distance up to which primitives count [m].
        out: Of each point the signed distance, infinite without a primitive, and the
            unit normal from the primitive to it; overwritten, shape (n, 4) [m].
    """
    ball = numba.carray(stack(16), (16,), np.float64)
    found = numba.carray(stack(10), (10,), np.float64)
    ball[:] = 0.0
    for n in range(points.shape[0]):
        point = (points[n, 0], points[n, 1], points[n, 2])
        best = reach
        out[n] = inf
        for i in range(kinds.shape[0]):
            apart = norm(sub((balls[i, 0], balls[i, 1], balls[i, 2]), point))
            if apart - balls[i, 3] >= best:
                continue
            ball[1], ball[2], ball[3] = point
            measure(SPHERE, ball, kinds[i], rows[i], found)
            if found[0] < best:
                best = found[0]
                out[n, 0] = best
                for k in range(3):
                    out[n, 1 + k] = -found[7 + k]
