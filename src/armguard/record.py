"""Records: rows of named fields that a kernel takes as one argument.

A class decorated with `@record` declares the fields of a structured dtype: `int`,
`float`, `Short`, or an array of fixed shape, `Annotated[Floats, (2, 16)]`. Kernels read
and write the fields by name, and a call passes the address alone. A record is a row of
an array of records (`Records`, `records`), or a kernel makes it on its stack by
`maker(Record)`.
"""

import ctypes
from collections import deque
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import (
    Annotated,
    Any,
    Protocol,
    TypeVar,
    cast,
    get_args,
    get_type_hints,
    overload,
)

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.extending import as_numba_type, intrinsic
from numpy.typing import NDArray

Record = TypeVar("Record")

# An integer of 32 bits, for records of which there may be a million.
Short = Annotated[int, np.int32]
Row_co = TypeVar("Row_co", covariant=True)


class Records(Protocol[Row_co]):
    """An array of records."""

    shape: tuple[int, ...]
    nbytes: int

    @overload
    def __getitem__(self, k: int) -> Row_co: ...

    @overload
    def __getitem__(self, k: str) -> NDArray[Any]: ...

    def __getitem__(self, k: int | str) -> Any:
        """A row by its number, or a field of all rows by its name; by reference."""

    def __setitem__(self, k: int | slice, rows: Any) -> None:
        """Overwrite rows; a number is written to all of their fields."""

    def __iter__(self) -> Iterator[Row_co]:
        """The rows, by reference."""

    def __len__(self) -> int:
        """Number of rows."""

    def copy(self) -> "Records[Row_co]":
        """A copy of all rows."""

    def fill(self, value: float) -> None:
        """Set all fields of all rows to a number."""


def records(shape: Any, declared: type) -> Any:
    """An array of records, all zero; a NumPy array to Python, `Records` to kernels.

    Args:
        shape: Its shape; () for a field of a table that is one record.
        declared: A class decorated with `@record`.
    """
    return np.zeros(shape, dtype_of(declared)).view(np.recarray)


def attributes(row: Any) -> Any:
    """An object whose attributes are the fields of a record, in the same memory.

    A loop of Python reads and writes them thirty times as fast as those of the array.

    Args:
        row: Array of shape () of a record whose fields are numbers.
    """
    kinds = {"i": ctypes.c_int64, "f": ctypes.c_double}
    fields = [(name, kinds[row.dtype[name].kind]) for name in row.dtype.names]
    # Without slots a wrong name would be a new attribute.
    contents = {"_fields_": fields, "__slots__": ()}
    declared: Any = type("Attributes", (ctypes.Structure,), contents)
    return declared.from_buffer(row)


def dtype_of(declared: type) -> np.dtype[Any]:
    """The structured dtype of a class of fields."""
    fields: list[Any] = []
    for name, hint in get_type_hints(declared, include_extras=True).items():
        if not get_args(hint):
            fields.append((name, np.dtype(hint)))
            continue
        if hint is Short:
            fields.append((name, np.dtype(np.int32)))
            continue
        array, shape = get_args(hint)
        fields.append((name, np.dtype(get_args(get_args(array)[1])[0]), shape))
    return np.dtype(fields, align=True)


def indices(declared: type) -> Any:
    """Index of the first number of each field in a record of equal numbers, by name."""
    fields: Any = dtype_of(declared).fields
    return SimpleNamespace(**{name: at // 8 for name, (_, at, *_) in fields.items()})


def record(declared: type[Record]) -> type[Record]:
    """Let annotations of separate kernels name a record.

    Raises:
        TypeError: A field has the name of an attribute of NumPy's records, which an
            interpreted kernel would read instead.
    """
    if taken := set(dtype_of(declared).names or ()).intersection(dir(np.recarray)):
        raise TypeError(f"{declared.__name__} has fields that NumPy names: {taken}")
    as_numba_type.register(declared, numba.from_dtype(dtype_of(declared)))
    return declared


def maker(declared: type[Record]) -> Callable[[], Record]:
    """What makes a record in a kernel, on its stack; its fields hold anything at first.

    Args:
        declared: A class decorated with `@record`.
    """
    dtype = dtype_of(declared)
    if numba.config.DISABLE_JIT:
        # As on a stack: memory that is soon used again, though not before the kernel
        # that requested it has called all it calls.
        recent: deque[Any] = deque(maxlen=256)

        def interpreted() -> Any:
            """The record."""
            recent.append(np.recarray(1, dtype))
            return recent[-1][0]

        return interpreted
    kind = numba.from_dtype(dtype)

    @intrinsic  # type: ignore[untyped-decorator]
    def compiled(typing_context: Any) -> Any:
        """The record."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            count = -(-dtype.itemsize // 8)
            place = cgutils.alloca_once(builder, ir.DoubleType(), size=count)
            return builder.bitcast(place, context.get_value_type(kind))

        return kind(), generate

    return cast(Callable[[], Record], compiled)


if numba.config.DISABLE_JIT:

    def clear(row: Any) -> None:
        """Set all fields of a record to zero."""
        for name in row.dtype.names:
            row[name] = 0

    def copy(row: Any, out: Any) -> None:
        """Copy all fields of a record to another one of its kind."""
        for name in row.dtype.names:
            out[name] = row[name]

else:

    @intrinsic  # type: ignore[untyped-decorator]
    def clear(typing_context: Any, row: Any) -> Any:
        """Set all fields of a record to zero."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            place = builder.bitcast(args[0], cgutils.voidptr_t)
            cgutils.memset(builder, place, ir.Constant(ir.IntType(64), row.size), 0)
            return context.get_dummy_value()

        return types.none(row), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def copy(typing_context: Any, row: Any, out: Any) -> Any:
        """Copy all fields of a record to another one of its kind."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            source, place = (builder.bitcast(a, cgutils.voidptr_t) for a in args)
            size = ir.Constant(ir.IntType(64), row.size)
            cgutils.raw_memcpy(builder, place, source, size, 1)
            return context.get_dummy_value()

        return types.none(row, out), generate
