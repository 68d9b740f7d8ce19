"""The words of a message as numbers of other sizes."""

# `carray` has no types that mypy could see.
# mypy: disable-error-code="no-any-return"

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer
from armguard.kernel import kernel

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


@kernel
def as_i8(words: Floats) -> Longs:
    """The same memory as whole numbers of eight bytes."""
    return numba.carray(pointer(words.ctypes.data), words.shape, np.int64)


@kernel
def as_u4(words: Floats) -> NDArray[np.uint32]:
    """The same memory as whole numbers of four bytes."""
    count = 2 * words.shape[0]
    return numba.carray(pointer(words.ctypes.data), (count,), np.uint32)


@kernel
def u4_at(words: Floats, place: int) -> int:
    """A whole number of four bytes, counted in such."""
    # As a signed one of eight: mixed with others it would become a float.
    return int(np.int64(as_u4(words)[place]))


@kernel
def as_u2(words: Floats) -> NDArray[np.uint16]:
    """The same memory as whole numbers of two bytes."""
    count = 4 * words.shape[0]
    return numba.carray(pointer(words.ctypes.data), (count,), np.uint16)


@kernel
def as_f4(words: Floats) -> NDArray[np.float32]:
    """The same memory as numbers of four bytes."""
    count = 2 * words.shape[0]
    return numba.carray(pointer(words.ctypes.data), (count,), np.float32)
