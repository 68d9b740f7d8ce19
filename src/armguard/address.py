"""Memory and foreign code by address: numbers elsewhere, scratch on the stack.

Handing an array to compiled code costs more than many a kernel does. So what a kernel
needs beyond its arguments it finds through an address, and what it needs only while it
runs lies on its stack.
"""

# `carray` has no types that mypy could see.
# mypy: disable-error-code="no-any-return"

import ctypes
from collections import deque
from typing import Any

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.core.typing.npydecl import parse_dtype
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import as_dtype

if numba.config.DISABLE_JIT:
    # As on a stack: memory that is soon used again, though not before the kernel that
    # requested it has called all it calls.
    RECENT: deque[Any] = deque(maxlen=8192)

    def pointer(address: int) -> Any:
        """An address as something `carray` takes."""
        return ctypes.c_void_p(int(address))

    def stack(count: int) -> Any:
        """Room for this many float64, as something `carray` takes."""
        RECENT.append(np.zeros(count))
        return ctypes.c_void_p(RECENT[-1].ctypes.data)

    def array_at(place: Any, shape: tuple[int, ...], dtype: Any) -> Any:
        """A contiguous array of a shape at a place."""
        return numba.carray(place, shape, dtype)

    def call_support(
        function: int, parameters: int, x: float, y: float, z: float
    ) -> tuple[float, float, float]:
        """Call a compiled support function by its address."""
        out = np.zeros(3)
        SUPPORT_PROTOTYPE(function)(parameters, x, y, z, out.ctypes.data)
        return (float(out[0]), float(out[1]), float(out[2]))

    def call_c(address: int, arguments: tuple[int, ...]) -> None:
        """Call a C function that returns nothing, and takes addresses."""
        kinds = [ctypes.c_void_p] * len(arguments)
        ctypes.CFUNCTYPE(None, *kinds)(int(address))(*map(int, arguments))

    SUPPORT_PROTOTYPE = ctypes.CFUNCTYPE(
        None,
        ctypes.c_void_p,
        ctypes.c_double,
        ctypes.c_double,
        ctypes.c_double,
        ctypes.c_void_p,
    )

else:

    @intrinsic  # type: ignore[untyped-decorator]
    def pointer(typing_context: Any, address: Any) -> Any:
        """An address as something `carray` takes."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], cgutils.voidptr_t)

        return types.voidptr(types.int64), generate

    @intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]
    def stack(typing_context: Any, count: Any) -> Any:
        """Room for this many float64, as something `carray` takes.

        It is the calling kernel's, and gone when that returns. The count is a literal.
        """
        if not isinstance(count, types.IntegerLiteral):
            return None
        room = count.literal_value

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            place = cgutils.alloca_once(builder, ir.DoubleType(), size=room)
            return builder.bitcast(place, cgutils.voidptr_t)

        return types.voidptr(count), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def array_at(typing_context: Any, place: Any, shape: Any, dtype: Any) -> Any:
        """A contiguous array of a shape at a place.

        It owns nothing. `numba.carray` would be compiled as a function that returns
        an array, which code without reference counts may not.
        """
        kind = types.Array(parse_dtype(dtype), len(shape), "C")

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            sizes = cgutils.unpack_tuple(builder, args[1])
            item = as_dtype(kind.dtype).itemsize
            strides = [context.get_constant(types.intp, item)]
            for size in sizes[:0:-1]:
                strides.insert(0, builder.mul(strides[0], size))
            array = context.make_array(kind)(context, builder)
            populate_array(
                array,
                data=builder.bitcast(args[0], array.data.type),
                shape=cgutils.pack_array(builder, sizes),
                strides=cgutils.pack_array(builder, strides),
                itemsize=context.get_constant(types.intp, item),
                meminfo=None,
            )
            return array._getvalue()

        return kind(place, shape, dtype), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def call_c(typing_context: Any, address: Any, arguments: Any) -> Any:
        """Call a C function that returns nothing, and takes addresses."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            long, count = ir.IntType(64), len(signature.args[1])
            kind = ir.FunctionType(ir.VoidType(), [long] * count)
            values = [builder.extract_value(args[1], k) for k in range(count)]
            builder.call(builder.inttoptr(args[0], kind.as_pointer()), values)
            return context.get_dummy_value()

        return types.none(types.int64, arguments), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def call_support(
        typing_context: Any, function: Any, parameters: Any, x: Any, y: Any, z: Any
    ) -> Any:
        """Call a compiled support function by its address."""
        point = types.containers.UniTuple(types.float64, 3)
        number = types.float64

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            double, address = ir.DoubleType(), cgutils.voidptr_t
            kind = ir.FunctionType(
                ir.VoidType(), [address, double, double, double, address]
            )
            out = cgutils.alloca_once(builder, double, size=3)
            builder.call(
                builder.inttoptr(args[0], kind.as_pointer()),
                [
                    builder.inttoptr(args[1], address),
                    *args[2:5],
                    builder.bitcast(out, address),
                ],
            )
            numbers = [
                builder.load(builder.gep(out, [ir.Constant(ir.IntType(32), k)]))
                for k in range(3)
            ]
            return context.make_tuple(builder, point, numbers)

        return point(types.int64, types.int64, number, number, number), generate
