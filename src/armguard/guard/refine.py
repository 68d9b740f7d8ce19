"""Second stage of the narrow phase: exact shapes where primitives are too near.

Links are measured by primitives that enclose them. The real link lies in the union of
its primitives and also in the union of its exact shapes, so the real distance of two
links is at least the distance of the primitives and at least that of the exact shapes:
the larger of the two is a valid lower bound.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.layout import NearRow, put_witness
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.table import Vector

Floats = NDArray[np.float64]

# A link has several primitives, so a pair of links is needed several times a cycle: its
# result is cached. Lines of the cache [-].
MEMO_SIZE = 512


@kernel(separate=True)
def refine_pair(i: int, j: int, near: NearRow, w: Workspace) -> None:
    """Replace a row's witness by that of the exact shapes, if they are farther apart.

    Args:
        i: Lower primitive of the pair.
        j: Higher primitive.
        near: The pair's row.
        w: The workspace.
    """
    first_a, count_a = w.exact_of[i, 0], w.exact_of[i, 1]
    first_b, count_b = w.exact_of[j, 0], w.exact_of[j, 1]
    if count_a == 0 and count_b == 0:
        return
    # Key of a side: its link's exact shapes, or the primitive, which is exact.
    key_a = first_a if count_a else -1 - i
    key_b = first_b if count_b else -1 - j
    line, cycle = w.memo[(key_a * 31 + key_b) % MEMO_SIZE], w.memory.cycle
    if line.cycle != cycle or line.key_a != key_a or line.key_b != key_b:
        measure_parts(i, j, w, line.witness[:])
        w.header.pairs_refined += 1.0
        line.key_a, line.key_b, line.cycle = key_a, key_b, cycle
    near.exact = line.witness[0]
    # A NaN replaces the distance, and so leads to a stop.
    if not near.exact <= near.distance:
        put_witness(line.witness, near)


@kernel(separate=True)
def measure_parts(i: int, j: int, w: Workspace, nearest: Vector) -> None:
    """Write the witness row of the nearest exact shapes of two primitives' links.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        w: The workspace.
        nearest: Overwritten, shape (10,).
    """
    row_a = array_at(stack(16), (ROW_WIDTH,), np.float64)
    row_b = array_at(stack(16), (ROW_WIDTH,), np.float64)
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    nearest[0] = np.inf
    for m in range(max(w.exact_of[i, 1], 1)):
        kind_a = exact_row(i, m, w, row_a)
        for n in range(max(w.exact_of[j, 1], 1)):
            kind_b = exact_row(j, n, w, row_b)
            measure(kind_a, row_a, kind_b, row_b, witness)
            if not witness[0] >= nearest[0]:
                for k in range(WITNESS_WIDTH):
                    nearest[k] = witness[k]
                if witness[0] != witness[0]:
                    return


@kernel
def exact_row(i: int, m: int, w: Workspace, row: Floats) -> int:
    """Write the world row of the m-th exact shape of a primitive's link.

    Returns:
        ShapeKind of that shape.
    """
    if w.exact_of[i, 1] == 0:
        for k in range(ROW_WIDTH):
            row[k] = w.world.rows[i, k]
        return int(w.world.kinds[i])
    e = w.exact_of[i, 0] + m
    body = w.bodies[i]
    if body >= 0:
        place_row(w.exact_kinds[e], w.exact_rows[e], w.T_world[body], row)
    else:
        for k in range(ROW_WIDTH):
            row[k] = w.exact_rows[e, k]
    return int(w.exact_kinds[e])
