"""Sorting without allocation, for lists of ids inside the cycle."""

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel


@kernel
def sort_ids(ids: NDArray[np.int32], count: int) -> None:
    """Sort the first `count` ids in place, ascending.

    Heap sort: no scratch, no recursion, and n·log n in the worst case too, when every
    pair of a crowded cell is near.

    Args:
        ids: Ids, only the first `count` are touched.
        count: Count of ids to sort.
    """
    for start in range(count // 2 - 1, -1, -1):
        sift_down(ids, start, count)
    for end in range(count - 1, 0, -1):
        ids[0], ids[end] = ids[end], ids[0]
        sift_down(ids, 0, end)


@kernel
def sift_down(ids: NDArray[np.int32], root: int, end: int) -> None:
    """Restore the heap order below `root` among the first `end` ids."""
    value = ids[root]
    child = 2 * root + 1
    while child < end:
        if child + 1 < end and ids[child + 1] > ids[child]:
            child += 1
        if not ids[child] > value:
            break
        ids[root] = ids[child]
        root = child
        child = 2 * root + 1
    ids[root] = value
