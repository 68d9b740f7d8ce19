"""All arrays of a guard as one: where each lies, and its shape.

Handing forty arrays from Python to compiled code costs more than the whole cycle. So
the cycle is handed one array of addresses, made once, and looks at the others through
it. The guard that owns the ledger owns the arrays too and never lets them go.
"""

# `carray` has no types that mypy could see.
# mypy: disable-error-code="no-any-return"

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer
from armguard.kernel import kernel

Longs = NDArray[np.int64]

# Numbers kept of each array: address, rows, columns (1 for a vector).
LINE = 3

# Room for more arrays than any ledger has; only those that are there are read.
LINES = 256


class Ledger:
    """Addresses of arrays that must stay where they are.

    Attributes:
        arrays: The arrays, kept alive.
        lines: Their addresses and shapes, shape (k · LINE,).

    Args:
        arrays: Contiguous vectors and matrices, in the order the cycle expects.
    """

    def __init__(self, arrays: Sequence[NDArray[Any]]) -> None:
        self.arrays = list(arrays)
        self.lines = np.zeros(len(self.arrays) * LINE, dtype=np.int64)
        for k, array in enumerate(self.arrays):
            self.put(k, array)

    def put(self, k: int, array: NDArray[Any]) -> None:
        """Lead to another array in place of array k."""
        if not array.flags.carray or array.ndim not in (1, 2):
            raise TypeError(f"array {k} of a ledger is not a contiguous matrix")
        self.arrays[k] = array
        columns = array.shape[1] if array.ndim == 2 else 1
        self.lines[k * LINE :][:LINE] = array.ctypes.data, array.shape[0], columns


@kernel
def ledger_at(address: int) -> Longs:
    """The lines of a ledger by their address, which is cheap to hand over."""
    return numba.carray(pointer(address), (LINE * LINES,), np.int64)


@kernel
def vector_f8(lines: Longs, k: int) -> NDArray[np.float64]:
    """Array k as a vector of float64."""
    return numba.carray(pointer(lines[3 * k]), (lines[3 * k + 1],), np.float64)


@kernel
def matrix_f8(lines: Longs, k: int) -> NDArray[np.float64]:
    """Array k as a matrix of float64."""
    shape = (lines[3 * k + 1], lines[3 * k + 2])
    return numba.carray(pointer(lines[3 * k]), shape, np.float64)


@kernel
def vector_i4(lines: Longs, k: int) -> NDArray[np.int32]:
    """Array k as a vector of int32."""
    return numba.carray(pointer(lines[3 * k]), (lines[3 * k + 1],), np.int32)


@kernel
def matrix_i4(lines: Longs, k: int) -> NDArray[np.int32]:
    """Array k as a matrix of int32."""
    shape = (lines[3 * k + 1], lines[3 * k + 2])
    return numba.carray(pointer(lines[3 * k]), shape, np.int32)


@kernel
def vector_i8(lines: Longs, k: int) -> NDArray[np.int64]:
    """Array k as a vector of int64."""
    return numba.carray(pointer(lines[3 * k]), (lines[3 * k + 1],), np.int64)


@kernel
def matrix_i8(lines: Longs, k: int) -> NDArray[np.int64]:
    """Array k as a matrix of int64."""
    shape = (lines[3 * k + 1], lines[3 * k + 2])
    return numba.carray(pointer(lines[3 * k]), shape, np.int64)


@kernel
def vector_u1(lines: Longs, k: int) -> NDArray[np.uint8]:
    """Array k as a vector of uint8."""
    return numba.carray(pointer(lines[3 * k]), (lines[3 * k + 1],), np.uint8)


@kernel
def matrix_u1(lines: Longs, k: int) -> NDArray[np.uint8]:
    """Array k as a matrix of uint8."""
    shape = (lines[3 * k + 1], lines[3 * k + 2])
    return numba.carray(pointer(lines[3 * k]), shape, np.uint8)
