"""The answer row of every pair kernel: distance, point on A, point on B, normal."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, along
from armguard.kernel import kernel

Row = NDArray[np.float64]

# Numbers in a witness row.
WITNESS_WIDTH = 10


@kernel
def write_witness(
    gap: float, p: Vec3, normal: Vec3, radius_a: float, radius_b: float, out: Row
) -> None:
    """Grow two cores by their radii and write the witness row.

    Args:
        gap: Signed distance of the cores [m].
        p: Witness point on the core of A; that of B is p + gap · normal [m].
        normal: Unit normal from A to B.
        radius_a: Radius A's core is grown by [m].
        radius_b: Radius B's core is grown by [m].
        out: Witness row, overwritten, shape (10,).
    """
    distance = gap - radius_a - radius_b
    on_a = along(p, radius_a, normal)
    out[0] = distance
    out[1], out[2], out[3] = on_a
    out[4], out[5], out[6] = along(on_a, distance, normal)
    out[7], out[8], out[9] = normal


@kernel
def turn_witness(out: Row) -> None:
    """Exchange the roles of A and B in a witness row."""
    for k in range(3):
        out[1 + k], out[4 + k] = out[4 + k], out[1 + k]
        out[7 + k] = -out[7 + k]
