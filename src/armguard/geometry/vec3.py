"""Vectors of three numbers as tuples: readable maths that compiles to registers."""

from math import sqrt

from armguard.kernel import kernel

Vec3 = tuple[float, float, float]


@kernel
def add(a: Vec3, b: Vec3) -> Vec3:
    """A + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def sub(a: Vec3, b: Vec3) -> Vec3:
    """A - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def norm(a: Vec3) -> float:
    """Length."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@kernel(entry=True)
def extent(a: Vec3) -> float:
    """Sum of the sizes of its numbers: a length good enough for a tolerance."""
    return abs(a[0]) + abs(a[1]) + abs(a[2])


@kernel
def scaled(s: float, a: Vec3) -> Vec3:
    """S · a."""
    return (s * a[0], s * a[1], s * a[2])


@kernel
def along(a: Vec3, s: float, u: Vec3) -> Vec3:
    """A + s · u."""
    return (a[0] + s * u[0], a[1] + s * u[1], a[2] + s * u[2])


@kernel
def any_perpendicular(u: Vec3) -> Vec3:
    """A unit vector at right angles to u, the same one every time; z for u = 0."""
    x, y, z = abs(u[0]), abs(u[1]), abs(u[2])
    if x <= y and x <= z:
        n = (0.0, -u[2], u[1])
    elif y <= z:
        n = (u[2], 0.0, -u[0])
    else:
        n = (-u[1], u[0], 0.0)
    length = norm(n)
    if length > 0.0:
        return scaled(1.0 / length, n)
    return (0.0, 0.0, 1.0)
