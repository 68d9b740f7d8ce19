"""Which mutant is on, and what the running code passed: memory at a fixed address.

The build copies this file beside the kernels it mutates. Compiled code reads the switch
at an address it knows, so one build holds every mutant, and a forked process has a
switch of its own.
"""

import ctypes
import mmap
import os
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

# Far from where programs and libraries are loaded.
ADDRESS = 0x2000_0000_0000
MARKS = ADDRESS + mmap.PAGESIZE

# Numbers of mutants are smaller; each has one byte of marks.
ROOM = 1 << 22

# Marks of a mutant: its place was passed; its value differed from the original's; its
# type is not the original's, or none that is mutated, so it is never used.
PASSED, DIFFERED, UNFIT = 1, 2, 4

MAP_FIXED_NOREPLACE = 0x100000


def map_memory() -> None:
    """Map the switch and the marks; what a fork writes there is its own."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.mmap.restype = ctypes.c_void_p
    numbers = (ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long)
    libc.mmap.argtypes = [ctypes.c_void_p, *numbers]
    flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | MAP_FIXED_NOREPLACE
    access = mmap.PROT_READ | mmap.PROT_WRITE
    size = MARKS - ADDRESS + ROOM
    if libc.mmap(ADDRESS, size, access, flags, -1, 0) != ADDRESS:
        raise MemoryError(
            f"no memory at {ADDRESS:#x}: {os.strerror(ctypes.get_errno())}"
        )


map_memory()
chosen = ctypes.c_int64.from_address(ADDRESS)
chosen.value = int(os.environ.get("ARMGUARD_MUTANT", "-1"))
marks = np.frombuffer((ctypes.c_uint8 * ROOM).from_address(MARKS), np.uint8)


@intrinsic(prefer_literal=True)
def pick(typing_context: Any, number: Any, original: Any, mutated: Any) -> Any:
    """The mutated value if the switch is at this number, else the original."""
    if not isinstance(number, types.IntegerLiteral):
        return None
    kind, at = types.unliteral(original), number.literal_value
    fits = kind == types.unliteral(mutated)
    fits = fits and isinstance(kind, types.Float | types.Boolean)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        byte, long = ir.IntType(8), ir.IntType(64)

        def place(address: int, kind: Any) -> Any:
            return ir.Constant(long, address).inttoptr(kind.as_pointer())

        def mark(value: Any) -> None:
            before = builder.load(place(MARKS + at, byte))
            builder.store(builder.or_(before, value), place(MARKS + at, byte))

        one = context.cast(builder, args[1], signature.args[1], kind)
        if not fits:
            mark(ir.Constant(byte, UNFIT))
            return one
        other = context.cast(builder, args[2], signature.args[2], kind)
        if isinstance(kind, types.Float):
            differ = builder.fcmp_unordered("!=", one, other)
        else:
            differ = builder.icmp_unsigned("!=", one, other)
        differed = builder.zext(differ, byte)
        mark(builder.or_(builder.shl(differed, ir.Constant(byte, 1)), byte(PASSED)))
        number = builder.load(place(ADDRESS, long))
        on = builder.icmp_signed("==", number, ir.Constant(long, at))
        return builder.select(on, other, one)

    return kind(number, original, mutated), generate


if numba.config.DISABLE_JIT:
    raise RuntimeError("mutants are chosen in compiled code: unset NUMBA_DISABLE_JIT")
