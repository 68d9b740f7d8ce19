"""Pair kernels: one pair, one file; kinds in rank order sphere < capsule < box."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pairs.box_box import box_box
from armguard.geometry.pairs.capsule_box import capsule_box
from armguard.geometry.pairs.capsule_capsule import capsule_capsule
from armguard.geometry.pairs.sphere_box import sphere_box
from armguard.geometry.pairs.sphere_capsule import sphere_capsule
from armguard.geometry.pairs.sphere_sphere import sphere_sphere
from armguard.geometry.shapes import ShapeKind
from armguard.geometry.witness import turn_witness
from armguard.kernel import kernel

Row = NDArray[np.float64]

SPHERE = int(ShapeKind.SPHERE)
CAPSULE = int(ShapeKind.CAPSULE)

# Every pair there is; tests, accuracy table and docs read it from here.
PAIR_KERNELS: dict[tuple[ShapeKind, ShapeKind], Callable[..., Any]] = {
    (ShapeKind.SPHERE, ShapeKind.SPHERE): sphere_sphere,
    (ShapeKind.SPHERE, ShapeKind.CAPSULE): sphere_capsule,
    (ShapeKind.SPHERE, ShapeKind.BOX): sphere_box,
    (ShapeKind.CAPSULE, ShapeKind.CAPSULE): capsule_capsule,
    (ShapeKind.CAPSULE, ShapeKind.BOX): capsule_box,
    (ShapeKind.BOX, ShapeKind.BOX): box_box,
}


@kernel
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
        measure_ranked(kind_b, b, kind_a, a, out)
        turn_witness(out)
    else:
        measure_ranked(kind_a, a, kind_b, b, out)


@kernel
def measure_ranked(kind_a: int, a: Row, kind_b: int, b: Row, out: Row) -> None:
    """The same, for kind_a <= kind_b."""
    if kind_a == CAPSULE:
        if kind_b == CAPSULE:
            capsule_capsule(a, b, out)
        else:
            capsule_box(a, b, out)
    elif kind_a == SPHERE:
        if kind_b == SPHERE:
            sphere_sphere(a, b, out)
        elif kind_b == CAPSULE:
            sphere_capsule(a, b, out)
        else:
            sphere_box(a, b, out)
    else:
        box_box(a, b, out)
