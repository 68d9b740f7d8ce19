"""Cache of separating axes: normals of pairs that were measured beyond the margin.

The convex solver takes ten times as long as a formula, and most of its pairs are beyond
the margin, cycle after cycle. The normal of an earlier cycle usually still separates
them: two support points prove it. A reported pair is always measured without the cache,
so no answer depends on it.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pairs import has_closed_form_at
from armguard.geometry.separating_plane import separation
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel

Floats = NDArray[np.float64]

# Lines of the cache; a pair has one line, and overwrites that of another pair [-].
PLANE_COUNT = 2048

# Relative round-off of a separation [-].
ROUND_OFF = 1e-13


@kernel
def line_of(i: int, j: int) -> int:
    """Line of a pair of primitives in the cache."""
    return int((i * 7919 + j) % PLANE_COUNT)


@kernel
def key_of(i: int, j: int) -> int:
    """Key of a pair in its line; never 0, which marks an empty line."""
    return int((i + 1) * 2147483648 + j)


@kernel
def is_apart(i: int, j: int, look: float, w: Workspace) -> bool:
    """Whether a stored normal proves that a pair is beyond the distance `look` [m]."""
    kinds, rows = w.world.kinds, w.world.rows
    if has_closed_form_at(kinds[i], kinds[j]):
        return False
    line = line_of(i, j)
    if w.planes[line] != key_of(i, j):
        return False
    normal = (w.normals[line, 0], w.normals[line, 1], w.normals[line, 2])
    gap = separation(kinds[i], rows[i], kinds[j], rows[j], normal)
    size = gap
    for k in range(1, 4):
        size += abs(rows[i, k]) + abs(rows[j, k])
    return bool(gap > look + ROUND_OFF * size)


@kernel
def remember_plane(i: int, j: int, w: Workspace, witness: Floats) -> None:
    """Store the normal of a pair that was measured beyond the margin."""
    if has_closed_form_at(w.world.kinds[i], w.world.kinds[j]):
        return
    line = line_of(i, j)
    w.planes[line] = key_of(i, j)
    for k in range(3):
        w.normals[line, k] = witness[7 + k]
