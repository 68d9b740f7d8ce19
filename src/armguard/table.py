"""Tables: named arrays that a kernel takes as one argument.

A `NamedTuple` of arrays decorated with `@table` is a table: the annotation of a field
says what kind its array is. To pass forty arrays to compiled code one by one costs more
than a whole cycle. So a `Ledger` holds the addresses of a table's arrays, and a table
in compiled code is the address of that: a field is loaded where it is named. A field
may be one record, or a table of its own, which is then shared by all tables that name
it. Kernels that
Python calls take the ledger's lines and make the table of them by `opener(Table)`. The
owner of a ledger owns the arrays too and keeps them alive.
"""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.core.datamodel.models import OpaqueModel
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    as_numba_type,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    register_model,
)
from numba.np import numpy_support
from numba.np.arrayobj import make_array, populate_array
from numpy.typing import NDArray

from armguard.address import pointer
from armguard.record import Records, dtype_of

# Kinds of arrays: their numbers, and 1 or 2 dimensions.
Vector = Annotated[NDArray[np.float64], 1]
Matrix = Annotated[NDArray[np.float64], 2]
IntVector = Annotated[NDArray[np.int32], 1]
IntMatrix = Annotated[NDArray[np.int32], 2]
LongVector = Annotated[NDArray[np.int64], 1]
LongMatrix = Annotated[NDArray[np.int64], 2]
ByteVector = Annotated[NDArray[np.uint8], 1]
ByteMatrix = Annotated[NDArray[np.uint8], 2]

# Numbers kept of each array: address, rows, columns (1 for a vector).
LINE = 3

LONG = ir.IntType(64)
VOID_POINTER = ir.IntType(8).as_pointer()

# Marks a field that is a table of its own: `motion: Annotated[Motion, TABLE]`.
TABLE = "table"

Table = TypeVar("Table", bound=tuple[Any, ...])


def array_type(hint: Any) -> Any:
    """Numba type of an array of one of the kinds above; None for anything else."""
    if not get_args(hint) or not isinstance(get_args(hint)[-1], int):
        return None
    array, dimensions = get_args(hint)
    if get_origin(array) is Records:
        dtype = dtype_of(get_args(array)[0])
    else:
        dtype = np.dtype(get_args(get_args(array)[1])[0])
    return types.Array(numba.from_dtype(dtype), dimensions, "C")


as_numba_type.register(array_type)


@cache
def array_types(table: type) -> tuple[tuple[str, Any], ...]:
    """Name and Numba type of each field: an array, a record, a table, or a tuple."""
    found: dict[str, Any] = {}
    for name, hint in get_type_hints(table, include_extras=True).items():
        if TABLE in get_args(hint):
            found[name] = TableType(get_args(hint)[0])
        elif get_args(hint):
            found[name] = array_type(hint)
        elif not hasattr(hint, "_fields"):
            found[name] = numba.from_dtype(dtype_of(hint))
        else:
            parts = [kind for _, kind in array_types(hint)]
            found[name] = types.containers.BaseTuple.from_types(parts, pyclass=hint)
    return tuple(found.items())


def arrays_of(
    table: tuple[Any, ...], tables: dict[str, "Ledger"]
) -> Iterator[NDArray[Any]]:
    """The arrays of a table one after another, those of tuples within it as well.

    Args:
        table: The table.
        tables: Ledgers of those fields that are tables; their lines are the arrays.

    Raises:
        TypeError: An array is not of the kind its field has, or not contiguous.
    """
    for (name, kind), value in zip(array_types(type(table)), table, strict=True):
        if isinstance(kind, TableType):
            yield tables[name].lines
            continue
        if isinstance(value, tuple):
            yield from arrays_of(value, {})
            continue
        found = numba.from_dtype(value.dtype)
        if value.ndim > 0:
            found = types.Array(found, value.ndim, "C")
        if found != kind:
            raise TypeError(
                f"{type(table).__name__}.{name} is an array of {value.ndim} "
                f"dimensions of {value.dtype}, not {kind}"
            )
        yield value


class Ledger:
    """Where the arrays of a table are; they must stay there.

    Attributes:
        arrays: The arrays, kept alive.
        tables: Ledgers of those fields that are tables, by name.
        lines: Addresses and shapes of the arrays, shape (k · LINE,).

    Args:
        table: The table.
        **shared: Ledgers of fields that are tables, where they exist already; the
            others are made.

    Raises:
        TypeError: An array is not of the kind its field has, or not contiguous.
    """

    def __init__(self, table: tuple[Any, ...], **shared: "Ledger") -> None:
        self.tables = {
            name: shared.get(name) or Ledger(value)
            for (name, kind), value in zip(array_types(type(table)), table, strict=True)
            if isinstance(kind, TableType)
        }
        self.arrays = list(arrays_of(table, self.tables))
        self.lines = np.zeros(len(self.arrays) * LINE, dtype=np.int64)
        for k, array in enumerate(self.arrays):
            self.put(k, array)

    def put(self, k: int, array: NDArray[Any]) -> None:
        """Lead to another array in place of array k.

        Raises:
            TypeError: It is not contiguous.
        """
        if not array.flags.carray:
            raise TypeError(f"array {k} of a ledger is not contiguous")
        self.arrays[k] = array
        rows, columns = (*array.shape, 1, 1)[:2]
        self.lines[k * LINE :][:LINE] = array.ctypes.data, rows, columns


class TableType(types.Type):
    """A table in compiled code: the address of its ledger's lines.

    Attributes:
        table: The class.
        places: Type and ordinal of the first array of each field.
    """

    def __init__(self, table: type) -> None:
        self.table = table
        self.places: dict[str, tuple[Any, int]] = {}
        first = 0
        for name, kind in array_types(table):
            self.places[name] = kind, first
            first += len(kind) if isinstance(kind, types.containers.BaseTuple) else 1
        super().__init__(name=f"Table({table.__module__}.{table.__qualname__})")


register_model(TableType)(OpaqueModel)


def table(declared: type[Table]) -> type[Table]:
    """Let annotations of separate kernels name a table.

    Args:
        declared: A `NamedTuple` whose fields are arrays of the kinds above, tuples of
            such, records, or tables.
    """
    as_numba_type.register(declared, TableType(declared))
    return declared


@infer_getattr
class TableFields(AttributeTemplate):  # type: ignore[misc]
    """Types of the fields of tables."""

    key = TableType

    def generic_resolve(self, table: TableType, name: str) -> Any:
        """The type of a field; None if there is none."""
        return table.places.get(name, (None, 0))[0]


@lower_getattr_generic(TableType)  # type: ignore[untyped-decorator]
def load_field(
    context: Any, builder: Any, table: TableType, value: Any, name: str
) -> Any:
    """Load where the array of a field is, and its shape."""
    kind, first = table.places[name]
    if isinstance(kind, TableType):
        return builder.inttoptr(load_word(builder, value, LINE * first), VOID_POINTER)
    if isinstance(kind, types.Record):
        word = load_word(builder, value, LINE * first)
        return builder.inttoptr(word, context.get_value_type(kind))
    if not isinstance(kind, types.containers.BaseTuple):
        return load_array(context, builder, kind, value, first)
    arrays = [
        load_array(context, builder, part, value, first + k)
        for k, part in enumerate(kind)
    ]
    return context.make_tuple(builder, kind, arrays)


def load_array(context: Any, builder: Any, kind: Any, value: Any, k: int) -> Any:
    """Load array k of a table."""
    words = [
        load_word(builder, value, place)
        for place in range(LINE * k, LINE * k + 1 + kind.ndim)
    ]
    size = context.get_constant(types.intp, numpy_support.as_dtype(kind.dtype).itemsize)
    strides = [size]
    if kind.ndim == 2:
        strides.insert(0, builder.mul(words[2], size))
    array = make_array(kind)(context, builder)
    populate_array(
        array,
        data=builder.inttoptr(words[0], array.data.type),
        shape=cgutils.pack_array(builder, words[1:]),
        strides=cgutils.pack_array(builder, strides),
        itemsize=size,
        meminfo=None,
    )
    return array._getvalue()


def load_word(builder: Any, value: Any, place: int) -> Any:
    """Load a number of a ledger's lines.

    No kernel writes to the lines of a ledger, so a load may be moved and shared.
    """
    lines = builder.bitcast(value, LONG.as_pointer())
    word = builder.load(builder.gep(lines, [ir.Constant(LONG, place)]))
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    return word


def opener(table: type[Table]) -> Callable[[int | NDArray[np.int64]], Table]:
    """What makes a table, in a kernel, of the address of its ledger's lines.

    Args:
        table: A `NamedTuple` whose fields are arrays of the kinds above.

    Returns:
        A function for kernels. Its argument is the address, or the lines themselves.
    """
    if numba.config.DISABLE_JIT:

        def interpreted(where: Any) -> Any:
            """The table."""
            address = int(getattr(getattr(where, "ctypes", None), "data", where))
            return from_lines(table, address)[0]

        return interpreted
    kind = TableType(table)

    @intrinsic  # type: ignore[untyped-decorator]
    def compiled(typing_context: Any, where: Any) -> Any:
        """The table."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            address = args[0]
            if isinstance(where, types.Array):
                lines = context.make_array(where)(context, builder, address)
                return builder.bitcast(lines.data, VOID_POINTER)
            return builder.inttoptr(address, VOID_POINTER)

        return kind(where), generate

    return cast(Callable[[int | NDArray[np.int64]], Table], compiled)


def from_lines(table: type, address: int, first: int = 0) -> tuple[Any, int]:
    """A table from the lines of its ledger, and how many arrays it has."""
    fields: list[Any] = []
    k = first
    for _, kind in array_types(table):
        lines = numba.carray(pointer(address), (LINE * (k + 1),), np.int64)
        if isinstance(kind, TableType):
            fields.append(from_lines(kind.table, int(lines[LINE * k]))[0])
            k += 1
            continue
        if isinstance(kind, types.containers.BaseTuple):
            part, count = from_lines(kind.instance_class, address, k)
            fields.append(part)
            k += count
            continue
        one = isinstance(kind, types.Record)
        place, *shape = lines[LINE * k :][: 2 if one else 1 + kind.ndim].tolist()
        dtype = numpy_support.as_dtype(kind if one else kind.dtype)
        found = numba.carray(pointer(place), tuple(shape), dtype)
        if dtype.names:
            found = found.view(np.recarray)
        fields.append(found[0] if one else found)
        k += 1
    return table(*fields), k - first
