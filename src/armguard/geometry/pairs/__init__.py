"""Pair kernels: one pair, one file; kinds in rank order, see `ShapeKind`."""

from math import nan

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, pointer
from armguard.geometry.pairs.box_box import box_box
from armguard.geometry.pairs.capsule_box import capsule_box
from armguard.geometry.pairs.capsule_capsule import capsule_capsule
from armguard.geometry.pairs.convex_convex import convex_convex
from armguard.geometry.pairs.convex_half_space import convex_half_space
from armguard.geometry.pairs.sphere_box import sphere_box
from armguard.geometry.pairs.sphere_capsule import sphere_capsule
from armguard.geometry.pairs.sphere_cone import sphere_cone
from armguard.geometry.pairs.sphere_ellipsoid import sphere_ellipsoid
from armguard.geometry.pairs.sphere_sphere import sphere_sphere
from armguard.geometry.pairs.sphere_triangle import sphere_triangle
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH, turn_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)
BOX = int(ShapeKind.BOX)
TRIANGLE = int(ShapeKind.TRIANGLE)
CYLINDER = int(ShapeKind.CYLINDER)
CONE = int(ShapeKind.CONE)
ELLIPSOID = int(ShapeKind.ELLIPSOID)
HALF_SPACE = int(ShapeKind.HALF_SPACE)


def has_closed_form(kind_a: int, kind_b: int) -> bool:
    """Whether a pair is measured by a formula; the others by the convex solver."""
    return bool(has_closed_form_at(int(kind_a), int(kind_b)))


@kernel(entry=True)
def has_closed_form_at(kind_a: int, kind_b: int) -> bool:
    """The same, for kernels."""
    low, high = min(kind_a, kind_b), max(kind_a, kind_b)
    return high <= BOX or high == HALF_SPACE or (low == SPHERE and high <= ELLIPSOID)


@kernel(entry=True)
def measure(kind_a: int, a: Row, kind_b: int, b: Row, out: Row) -> None:
    """Signed distance, witness points and normal of any two primitives.

    Args:
        kind_a: ShapeKind of A.
        a: Its row, shape (16,); world [m].
        kind_b: ShapeKind of B.
        b: Its row, shape (16,); world [m].
        out: Witness row, shape (10,), overwritten.
    """
    if kind_a > kind_b:
        measure_at(kind_b, b.ctypes.data, kind_a, a.ctypes.data, out.ctypes.data)
        turn_witness(out)
    else:
        measure_at(kind_a, a.ctypes.data, kind_b, b.ctypes.data, out.ctypes.data)


@kernel(separate=True)
def measure_at(kind_a: int, a: int, kind_b: int, b: int, out: int) -> None:
    """The same, for kind_a <= kind_b and arrays by their addresses.

    To hand three arrays over takes as long as the shorter formulas do.
    """
    row_a = array_at(pointer(a), (ROW_WIDTH,), np.float64)
    row_b = array_at(pointer(b), (ROW_WIDTH,), np.float64)
    witness = array_at(pointer(out), (WITNESS_WIDTH,), np.float64)
    measure_ranked(kind_a, row_a, kind_b, row_b, witness)


@kernel
def rows_are_numbers(a: Row, b: Row) -> bool:
    """Whether two rows hold numbers only: no NaN, nothing infinite."""
    total = 0.0
    for k in range(ROW_WIDTH):
        total += 0.0 * a[k] + 0.0 * b[k]
    return bool(total == 0.0)


@kernel
def measure_ranked(kind_a: int, a: Row, kind_b: int, b: Row, out: Row) -> None:
    """The same, for kind_a <= kind_b: which kernel knows the pair."""
    if kind_b <= BOX:
        if kind_a == CAPSULE:
            if kind_b == CAPSULE:
                capsule_capsule(a, b, out)
            else:
                capsule_box(a, b, out)
        elif kind_a == BOX:
            box_box(a, b, out)
        elif kind_b == SPHERE:
            sphere_sphere(a, b, out)
        elif kind_b == CAPSULE:
            sphere_capsule(a, b, out)
        else:
            sphere_box(a, b, out)
    elif not rows_are_numbers(a, b):
        # A comparison in a support function might lose sight of a NaN.
        for k in range(WITNESS_WIDTH):
            out[k] = nan
    elif kind_b == HALF_SPACE:
        convex_half_space(kind_a, a, b, out)
    elif kind_a == SPHERE and kind_b == TRIANGLE:
        sphere_triangle(a, b, out)
    elif kind_a == SPHERE and (kind_b == CYLINDER or kind_b == CONE):
        sphere_cone(a, b, out)
    elif kind_a == SPHERE and kind_b == ELLIPSOID:
        sphere_ellipsoid(a, b, out)
    else:
        convex_convex(kind_a, a, kind_b, b, out)
