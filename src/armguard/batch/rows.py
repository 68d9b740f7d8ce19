"""Rows of a batch: given arrays, and an order in which near ones follow each other."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import SceneError

Floats = NDArray[np.float64]

# Fewest rows that are sorted.
FEWEST = 256

# First rows that are looked at, and how far they are from each other in a batch that is
# sorted: in the mean, over all joints [rad or m].
SAMPLED = 64
FAR = 0.5

# First joints by which rows are sorted, into so many parts of their range each.
SORTED = 4
PARTS = 16


def rows_of(given: ArrayLike, q_names: Sequence[str], name: str) -> Floats:
    """Joint positions as a contiguous array, shape (rows, joints).

    Args:
        given: The argument of a call.
        q_names: Names of the joints.
        name: Name of the argument.

    Raises:
        SceneError: It is no array of numbers of that shape.
    """
    rows, joints = np.asarray(given), len(q_names)
    if rows.ndim != 2 or rows.shape[1] != joints:
        raise SceneError(
            f"{name} has shape {rows.shape}; it must be (rows, {joints}), one "
            f"column for each of: {', '.join(q_names)}"
        )
    if rows.dtype.kind not in "fiu":
        raise SceneError(f"{name} holds {rows.dtype}; it must hold numbers")
    return np.ascontiguousarray(rows, dtype=np.float64)


def order_of(rows: Floats, lower: Floats, upper: Floats) -> NDArray[np.intp] | None:
    """Places of rows by the cells of their first joints; None if they follow already.

    Args:
        rows: Joint positions, shape (rows, n) [rad or m].
        lower: Least joint positions, shape (n,) [rad or m].
        upper: Greatest joint positions, of that shape.
    """
    if len(rows) < FEWEST:
        return None
    finite = np.isfinite(lower) & np.isfinite(upper)
    first = np.where(finite, lower, -np.pi)[:SORTED]
    width = np.where(finite, upper - lower, 2.0 * np.pi)[:SORTED]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        if not np.abs(rows[1:SAMPLED] - rows[: SAMPLED - 1]).sum() > FAR * SAMPLED:
            return None
        places = (rows[:, :SORTED] - first) * (PARTS / width)
    key = np.zeros(len(rows), dtype=np.uint16)
    for column in np.clip(np.nan_to_num(places), 0, PARTS - 1).astype(np.uint16).T:
        key = key * np.uint16(PARTS) + column
    return np.argsort(key, kind="stable")
