"""The distances that are judged: armguard's, and how long each call takes."""

from time import perf_counter
from typing import Any

import numpy as np

from armguard.geometry.pairs import measure
from armguard.geometry.shapes import shape_row
from arrays import Floats


def measured(pair: Any) -> Floats:
    """Witness row of one pair, shape (10,)."""
    out = np.zeros(10)
    a, b = pair.shape_a, pair.shape_b
    measure(
        int(a.kind), shape_row(a, pair.T_a), int(b.kind), shape_row(b, pair.T_b), out
    )
    return out


def measure_all(
    kind_a: int, rows_a: Floats, kind_b: int, rows_b: Floats
) -> tuple[Floats, Floats]:
    """Witness rows, shape (n, 10), and seconds of each call, shape (n,)."""
    out = np.zeros((len(rows_a), 10))
    seconds = np.zeros(len(rows_a))
    for k in range(len(rows_a)):
        begin = perf_counter()
        measure(int(kind_a), rows_a[k], int(kind_b), rows_b[k], out[k])
        seconds[k] = perf_counter() - begin
    return out, seconds
