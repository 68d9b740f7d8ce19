"""Kernels about rays and points beside the primitives of a scene."""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.cells.masks import depth_at
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import Vec3, add, along, cross, dot, norm, scaled, sub
from armguard.kernel import kernel

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SPHERE, BOX = int(ShapeKind.SPHERE), int(ShapeKind.BOX)

# A ray that comes this near to a surface is at it [m].
AT_SURFACE = 1e-3

# Distance up to which the nearest primitive of a point counts [m].
NEAREST_WITHIN = 1.0

# Growth of bounds against rounding [m].
ROUND_OFF = 1e-9

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
        if bodies[i] >= 0:
            place_row(kinds[i], local[i], T_world[bodies[i]], out[i])
            continue
        for k in range(out.shape[1]):
            out[i, k] = local[i, k]


@kernel
def way_into(
    kind: int, row: Floats, origin: Vec3, way: Vec3, first: float, last: float,
    ball: Floats, out: Floats,
) -> float:  # fmt: skip
    """Distance along a ray at which it enters a shape, infinite if it does not.

    The distance to a convex shape is convex along a ray: once it rises, it falls no
    more. The ray begins outside the shape.

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


@kernel
def cone_about(ways: Floats) -> tuple[Vec3, float, float]:
    """Axis of a cone about directions, cosine and sine of its half angle.

    Of directions without a common side the cone is all space.

    Args:
        ways: Unit vectors, shape (n, 3).
    """
    total = (0.0, 0.0, 0.0)
    for n in range(ways.shape[0]):
        total = add(total, (ways[n, 0], ways[n, 1], ways[n, 2]))
    length, least = norm(total), 1.0
    if not length > 0.0:
        return (0.0, 0.0, 1.0), -1.0, 0.0
    axis = scaled(1.0 / length, total)
    for n in range(ways.shape[0]):
        least = min(least, dot(axis, (ways[n, 0], ways[n, 1], ways[n, 2])))
    if not least > 0.0:
        return axis, -1.0, 0.0
    return axis, least, sqrt(max(1.0 - least * least, 0.0))


@kernel
def is_beside(
    aside: Vec3, radius: float, axis: Vec3, cosine: float, sine: float
) -> bool:
    """Whether a ball lies outside a cone of less than 90 degrees about an axis.

    Args:
        aside: From the tip of the cone to the middle of the ball [m].
        radius: Radius of the ball [m].
        axis: Axis of the cone, a unit vector.
        cosine: Cosine of its half angle; all space is inside below 0.
        sine: Sine of it.
    """
    if cosine < 0.0:
        return False
    ahead = dot(aside, axis)
    across = sqrt(max(dot(aside, aside) - ahead * ahead, 0.0))
    # Distance from the side of the cone, in the plane of the axis and the middle.
    return across * cosine - ahead * sine > radius + ROUND_OFF


@kernel(inline=False)
def cast_into(
    i: int, origin: Vec3, ways: Floats, kind: int, row: Floats, ball: Floats,
    out: Floats,
) -> None:  # fmt: skip
    """Where rays from one point enter a primitive before what they meet so far.

    Args:
        i: Number of the primitive.
        origin: Where the rays begin [m].
        ways: Their directions, unit vectors, shape (n, 3).
        kind: ShapeKind.
        row: Its row, shape (16,).
        ball: Middle and radius of a ball about it, shape (4,) [m].
        out: See `cast`; of a ray that meets none so far the distance up to which it is
            followed.
    """
    centre = array_at(stack(16), (16,), np.float64)
    found = array_at(stack(10), (10,), np.float64)
    centre[:] = 0.0
    # A ray that begins in a shape does not enter it.
    if depth_at(kind, row, origin, centre, found)[0] <= AT_SURFACE:
        return
    aside, radius = sub((ball[0], ball[1], ball[2]), origin), ball[3]
    for n in range(ways.shape[0]):
        way, first = (ways[n, 0], ways[n, 1], ways[n, 2]), 0.0
        if radius < inf:
            ahead = dot(aside, way)
            across = dot(aside, aside) - ahead * ahead
            if across > radius * radius:
                continue
            half = sqrt(radius * radius - max(across, 0.0))
            if ahead + half < 0.0 or ahead - half > out[n, 0]:
                continue
            first = max(ahead - half, 0.0)
        t = way_into(kind, row, origin, way, first, out[n, 0], centre, found)
        if t < out[n, 0]:
            out[n, 0], out[n, 1] = t, i


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
    start = (origin[0], origin[1], origin[2])
    axis, cosine, sine = cone_about(ways)
    for n in range(ways.shape[0]):
        out[n, 0], out[n, 1] = reach, -1.0
    for i in range(kinds.shape[0]):
        aside = sub((balls[i, 0], balls[i, 1], balls[i, 2]), start)
        if not is_beside(aside, balls[i, 3], axis, cosine, sine):
            cast_into(i, start, ways, kinds[i], rows[i], balls[i], out)
    for n in range(ways.shape[0]):
        if out[n, 1] < 0.0:
            out[n, 0] = inf


@kernel(inline=False, entry=True)
def over_zones(
    found: Floats, along_axis: Floats, errors: Floats, rays: int, out: Floats
) -> None:
    """Depths of zones by those of their rays.

    Args:
        found: Result of `cast`, for the rays zone by zone, shape (z · rays, 2).
        along_axis: Depth at distance 1 along each ray, shape (z · rays,).
        errors: How far each primitive may reach beyond its surface, shape (p,) [m].
        rays: Rays of a zone.
        out: See `Prediction`, overwritten, shape (z, 4).
    """
    for z in range(out.shape[0]):
        near, far, error, first = inf, -inf, 0.0, found[z * rays, 1]
        same = True
        for n in range(z * rays, (z + 1) * rays):
            depth, which = found[n, 0] * along_axis[n], int(found[n, 1])
            near, far = min(near, depth), max(far, depth)
            same &= found[n, 1] == first
            if which >= 0:
                error = max(error, errors[which])
        out[z, 0], out[z, 1] = near, far
        out[z, 2], out[z, 3] = first if same else -1.0, error


@kernel(inline=False, entry=True)
def touching(
    boxes: Floats, kinds: Ints, rows: Floats, balls: Floats, out: Bools
) -> None:
    """Which of some boxes touch a primitive.

    Args:
        boxes: Rows of the boxes, shape (n, 16).
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, shape (p, 16).
        balls: Middle and radius of a ball about each, shape (p, 4) [m].
        out: Whether each box does, overwritten, shape (n,).
    """
    found = array_at(stack(10), (10,), np.float64)
    for n in range(boxes.shape[0]):
        out[n] = False
        middle = (boxes[n, 1], boxes[n, 2], boxes[n, 3])
        radius = norm((boxes[n, 4], boxes[n, 5], boxes[n, 6])) + boxes[n, 0]
        for i in range(kinds.shape[0]):
            apart = norm(sub((balls[i, 0], balls[i, 1], balls[i, 2]), middle))
            if apart <= radius + balls[i, 3] and not out[n]:
                measure(BOX, boxes[n], kinds[i], rows[i], found)
                out[n] = found[0] <= 0.0


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
    ball = array_at(stack(16), (16,), np.float64)
    found = array_at(stack(10), (10,), np.float64)
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


@kernel
def write_derivatives(found: Floats, R: Floats, turned: Floats, out: Floats) -> None:
    """Write a distance and its derivatives by shift and turn of a point.

    Args:
        found: Witness row from the point to a primitive, shape (10,).
        R: Axes of the sensor in the world, by columns, shape (3, 3).
        turned: The point from the origin about which it turns, shape (3,) [m].
        out: Both, overwritten, shape (7,) or more.
    """
    out[0] = found[0]
    for k in range(3):
        out[1 + k] = -(found[7] * R[0, k] + found[8] * R[1, k] + found[9] * R[2, k])
    a, b = (turned[0], turned[1], turned[2]), (out[1], out[2], out[3])
    out[4], out[5], out[6] = cross(a, b)


@kernel(inline=False, entry=True)
def linearise(
    points: Floats, offset: Floats, R: Floats, origin: Floats, kinds: Ints,
    rows: Floats, balls: Floats, out: Floats,
) -> None:  # fmt: skip
    """Distances of a sensor's points to the nearest primitives, and their derivatives.

    Args:
        points: The points in the declared frame of the sensor, shape (n, 3) [m].
        offset: Rotation and shift [m] of the sensor from there, shape (4, 3).
        R: Axes of the declared frame in the world, by columns, shape (3, 3).
        origin: Its origin, shape (3,) [m].
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, shape (p, 16).
        balls: Middle and radius of a ball about each, shape (p, 4) [m].
        out: Of each point its signed distance, 0 without a primitive within 1 m [m];
            its derivatives by shift and turn of the offset; and the primitive, -1 for
            none, overwritten: the one found before is looked at first. Shape (n, 8).
    """
    ball = array_at(stack(16), (16,), np.float64)
    found = array_at(stack(10), (10,), np.float64)
    turned = array_at(stack(3), (3,), np.float64)
    ball[:] = 0.0
    for n in range(points.shape[0]):
        for k in range(3):
            turned[k] = (
                offset[k, 0] * points[n, 0]
                + offset[k, 1] * points[n, 1]
                + offset[k, 2] * points[n, 2]
            )
        x, y, z = add(
            (turned[0], turned[1], turned[2]),
            (offset[3, 0], offset[3, 1], offset[3, 2]),
        )
        for k in range(3):
            ball[1 + k] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z + origin[k]
        guess, best = int(out[n, 7]), NEAREST_WITHIN
        out[n] = 0.0
        out[n, 7] = -1.0
        for k in range(-1, kinds.shape[0]):
            i = guess if k < 0 else k
            if i < 0 or k == guess:
                continue
            apart = norm(
                sub(
                    (balls[i, 0], balls[i, 1], balls[i, 2]), (ball[1], ball[2], ball[3])
                )
            )
            if apart - balls[i, 3] >= best:
                continue
            measure(SPHERE, ball, kinds[i], rows[i], found)
            if found[0] < best:
                best = found[0]
                write_derivatives(found, R, turned, out[n])
                out[n, 7] = i
