"""Distance of two bodies, by their primitives or their exact shapes."""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.refine import measure_parts
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


@kernel(inline=False, entry=True)
def body_distance(
    first_a: int, end_a: int, first_b: int, end_b: int, lines: Longs, out: Floats
) -> None:
    """Witness row of two bodies at their present poses.

    Args:
        first_a: First primitive of A.
        end_a: Index after its last primitive.
        first_b: First primitive of B.
        end_b: Index after its last primitive.
        lines: Ledger of the workspace.
        out: Overwritten, shape (10,).
    """
    w = open_workspace(lines)
    kinds, rows = w.world.kinds, w.world.rows
    found = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    out[0] = np.inf
    for i in range(first_a, end_a):
        for j in range(first_b, end_b):
            measure(kinds[i], rows[i], kinds[j], rows[j], found)
            if not found[0] >= out[0]:
                for k in range(WITNESS_WIDTH):
                    out[k] = found[k]
    if w.exact_of[first_a, 1] == 0 and w.exact_of[first_b, 1] == 0:
        return
    # All primitives of a link share its exact shapes; those of an object are exact.
    last_a = first_a + 1 if w.exact_of[first_a, 1] > 0 else end_a
    last_b = first_b + 1 if w.exact_of[first_b, 1] > 0 else end_b
    outer = out[0]
    out[0] = np.inf
    for i in range(first_a, last_a):
        for j in range(first_b, last_b):
            measure_parts(i, j, w, found)
            if not found[0] >= out[0]:
                for k in range(WITNESS_WIDTH):
                    out[k] = found[k]
    if outer > out[0]:
        out[0] = outer
