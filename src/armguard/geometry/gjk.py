"""Distance of two cores that are apart: Gilbert, Johnson and Keerthi's algorithm."""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.core_support import core_middle, core_support
from armguard.geometry.simplex import (
    CORNER,
    Weights,
    reduce_simplex,
)
from armguard.geometry.vec3 import Vec3, add, dot, norm, scaled, sub
from armguard.kernel import kernel

Row = NDArray[np.float64]
Matrix = NDArray[np.float64]

# Steps after which the best answer so far is given; polytopes need about ten [-].
MOST_STEPS = 128

# The distance is proven to this share of itself, so the normal is as good whether cores
# are far or near, or to this share of the largest number that enters it [-].
PRECISION = 1e-9
ROUND_OFF = 1e-13

# Nearer than this share, a direction is mostly round-off; the cores count as met [-].
TOUCHING = 1e-10

# Nearer than this share, the direction to the nearest point is not sure enough [-].
CLOSE = 1e-3


@kernel(inline=False)
def gjk(
    kind_a: int, a: Row, kind_b: int, b: Row, shift: Vec3, simplex: Matrix
) -> tuple[float, float, Vec3, Vec3, bool, int, Weights, float]:
    """Nearest points of two cores, or that they meet.

    The nearest point v of A - B to the origin is approached by simplices of its
    support points. Each step proves a lower bound: no point of A - B is nearer than the
    plane through the last support point.

    Args:
        kind_a: ShapeKind of A, not a half-space.
        a: Its row, shape (16,); world [m].
        kind_b: ShapeKind of B.
        b: Its row.
        shift: Translation of B before anything is measured [m].
        simplex: Scratch, shape (4, CORNER); the last simplex when done.

    Returns:
        Distance of the simplex, which is no less than that of the cores [m]; a proven
        lower bound of it [m]; the nearest point of A - B; a unit vector from A to B,
        which of close cores is the one that proves the bound; whether the cores meet;
        how many corners the simplex has; their weights; the largest number met, for
        tolerances [m].

    References:
        Gilbert, Johnson, Keerthi, 1988. Stopping: van den Bergen, 1999, section 3.
    """
    offset = sub((a[1] - b[1], a[2] - b[2], a[3] - b[3]), shift)
    v = sub(add(core_middle(kind_a, a), offset), core_middle(kind_b, b))
    if not dot(v, v) > 0.0:
        v = (1.0, 0.0, 0.0)
    lower = 0.0
    proof = scaled(-1.0, v)
    square = dot(v, v)
    largest = np.sqrt(square)
    count = 0
    weights = (1.0, 0.0, 0.0, 0.0)
    inside = False
    for step in range(MOST_STEPS):
        on_a = core_support(kind_a, a, scaled(-1.0, v))
        on_b = core_support(kind_b, b, v)
        w = sub(add(on_a, offset), on_b)
        vv = dot(v, v)
        vw = dot(v, w)
        length = np.sqrt(vv)
        square = max(square, dot(w, w), dot(on_a, on_a), dot(on_b, on_b))
        largest = np.sqrt(square)
        if vw > lower * length or step == 0:
            # Of the directions tried, not the last one is kept but the best.
            lower = max(lower, vw / length)
            proof = scaled(-1.0, v)
        if step > 0 and not length - lower > PRECISION * length + ROUND_OFF * largest:
            break
        if repeats(simplex, count, w):
            break
        simplex[count, 0], simplex[count, 1], simplex[count, 2] = w
        simplex[count, 3], simplex[count, 4], simplex[count, 5] = on_a
        before = vv if step > 0 else np.inf
        count, weights, v, inside = reduce_simplex(simplex, count + 1)
        vv = dot(v, v)
        if inside or not vv > (TOUCHING * largest) ** 2:
            inside = True
            break
        if not vv < before:
            # Round-off: the simplex cannot come nearer.
            break
    length = norm(v)
    if vw != vw or largest != largest:
        length = lower = vw + largest
        v = (length, length, length)
        proof = v
    if not (lower > 0.0 and length < CLOSE * largest):
        proof = scaled(-1.0, v)
    if length > 0.0:
        proof = scaled(1.0 / norm(proof), proof)
    return length, min(lower, length), v, proof, inside, count, weights, largest


@kernel
def repeats(simplex: Matrix, count: int, w: Vec3) -> bool:
    """Whether a support point is a corner already: no progress is possible."""
    for k in range(count):
        if simplex[k, 0] == w[0] and simplex[k, 1] == w[1] and simplex[k, 2] == w[2]:
            return True
    return False


@kernel(inline=False)
def core_gap(kind_a: int, a: Row, kind_b: int, b: Row) -> float:
    """Proven lower bound on the distance of two cores, sharp to round-off [m]."""
    simplex = array_at(stack(24), (4, CORNER), np.float64)
    _gap, lower, _v, _proof, met, _count, _weights, _largest = gjk(
        kind_a, a, kind_b, b, (0.0, 0.0, 0.0), simplex
    )
    return 0.0 if met else float(lower)
