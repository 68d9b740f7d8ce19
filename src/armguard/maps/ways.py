"""Monotone ways through a grid of cells that are free or blocked.

Both plans only go on, each at its own pace or more slowly. A node of the grid is a
corner of cells. A step leads to the next node of one axis, or of both. A free cell is
free with its edges. No way leads between two blocked cells that share a corner only.
"""

from math import inf

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Nodes = NDArray[np.intp]

# Steps that differ by less take as long [steps].
ROUNDING = 1e-6


def edges_free(blocked: Bools) -> tuple[Bools, Bools]:
    """Whether steps along the first and along the second axis are free.

    A step along an edge is free if a cell on either side of it is.

    Args:
        blocked: Cells, shape (k, m).

    Returns:
        Shapes (k, m + 1) and (k + 1, m).
    """
    free = np.pad(~blocked, 1)
    first = free[1:-1, :-1] | free[1:-1, 1:]
    second = free[:-1, 1:-1] | free[1:, 1:-1]
    return first, second


def steps_to_end(blocked: Bools, waits: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Fewest steps from each node to the end; infinite where no way leads there.

    Args:
        blocked: Cells, shape (k, m).
        waits: What each step counts more in which the first, or the second, waits
            before its end.

    Returns:
        Shape (k + 1, m + 1).
    """
    (k, m), width = blocked.shape, blocked.shape[1] + 2
    first, second = edges_free(blocked)
    # A border of nodes that lead nowhere; rows and columns of the last nodes are whole.
    costs = np.full((3, k + 2, width), inf)
    costs[0, :k, :m][~blocked] = 1.0
    costs[1, :k, : m + 1][first] = 1.0
    costs[1, :k, :m] += waits[1]
    costs[2, : k + 1, :m][second] = 1.0
    costs[2, :k, :m] += waits[0]
    pinched = blocked[:-1, 1:] & blocked[1:, :-1]
    costs[:, 1:k, 1:m][:, pinched] = inf
    found = np.full((k + 2, width), inf)
    found[k, m] = 0.0
    flat = found.reshape(-1)
    both, one, other = costs.reshape(3, -1)
    for d in range(k + m - 1, -1, -1):
        low, high = max(0, d - m), min(k, d)
        # Nodes (i, d - i), and those that steps lead to.
        at = slice(low * width + d - low, high * width + d - high + 1, width - 1)
        ahead, aside = (slice(at.start + n, at.stop + n, width - 1) for n in (width, 1))
        across = slice(at.start + width + 1, at.stop + width + 1, width - 1)
        best = np.minimum(one[at] + flat[ahead], other[at] + flat[aside])
        np.minimum(best, both[at] + flat[across], out=flat[at])
    return found[:-1, :-1]


def steps_from_start(blocked: Bools) -> Floats:
    """Fewest steps from the start to each node; infinite where no way leads there."""
    return steps_to_end(blocked[::-1, ::-1])[::-1, ::-1]


def quickest(
    blocked: Bools, waits: tuple[float, float] = (0.0, 0.0), left: Floats | None = None
) -> Nodes | None:
    """The quickest way from the first node to the last, shape (n, 2); None without any.

    Args:
        blocked: Cells, shape (k, m).
        waits: See `steps_to_end`.
        left: What that found, if it is known.
    """
    if left is None:
        left = steps_to_end(blocked, waits)
    if not left[0, 0] < inf:
        return None
    first, _ = edges_free(blocked)
    (k, m), i, j, way = blocked.shape, 0, 0, [(0, 0)]
    while (i, j) != (k, m):
        best = left[i, j] + ROUNDING
        both = i < k and j < m and not blocked[i, j]
        if both and 1.0 + left[i + 1, j + 1] <= best:
            i, j = i + 1, j + 1
        elif (
            i < k
            and first[i, j]
            and (1.0 + (waits[1] if j < m else 0.0) + left[i + 1, j] <= best)
        ):
            i += 1
        else:
            j += 1
        way.append((i, j))
    return np.array(way, dtype=np.intp)


def crosses(way: Nodes, blocked: Bools) -> bool:
    """Whether a way leads through blocked cells.

    Args:
        way: Nodes, each followed by that after one step, shape (n, 2).
        blocked: Cells, shape (k, m).
    """
    first, second = edges_free(blocked)
    (i, j), (di, dj) = way[:-1].T, np.diff(way, axis=0).T
    both, one, other = (di & dj) > 0, di > dj, dj > di
    if blocked[i[both], j[both]].any() or not first[i[one], j[one]].all():
        return True
    pinched = np.zeros((blocked.shape[0] + 1, blocked.shape[1] + 1), dtype=bool)
    pinched[1:-1, 1:-1] = blocked[:-1, 1:] & blocked[1:, :-1]
    return bool(not second[i[other], j[other]].all() or pinched[i, j].any())


def beside_others(moves: Bools, rests: Bools) -> Nodes | None:
    """The soonest way of one plan beside others whose times are fixed.

    Args:
        moves: Whether step n of the plan is free in step t of time, shape (t, k).
        rests: Whether the plan may rest at node n in step t of time, shape (t, k + 1).

    Returns:
        Node of the plan before each step of time, and at last, shape (s + 1,); None if
        it cannot reach its end.
    """
    steps, k = moves.shape
    reached = np.zeros((steps + 1, k + 1), dtype=bool)
    reached[0, 0] = True
    for t in range(steps):
        reached[t + 1] = reached[t] & rests[t]
        reached[t + 1, 1:] |= reached[t, :-1] & moves[t]
    # Once it is at its end it has to be left alone there.
    safe = np.flip(np.logical_and.accumulate(np.flip(rests[:, k])))
    ends = np.flatnonzero(reached[:-1, k] & safe)
    if not len(ends):
        return None
    way = np.full(steps + 1, k, dtype=np.intp)
    n = k
    for t in range(int(ends[0]) - 1, -1, -1):
        if n > 0 and reached[t, n - 1] and moves[t, n - 1]:
            n -= 1
        way[t] = n
    return way
