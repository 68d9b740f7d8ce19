"""Values that stand for eight doubles: LLVM vectors in kernels, arrays without them.

Each verb is a plain function over NumPy arrays. Compiled code gets LLVM's vector
instructions in place of it, with the same bits.
"""

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic, models, overload, register_model
from numba.np.arrayobj import make_array

WIDTH = 8

VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
BITS = ir.VectorType(ir.IntType(1), WIDTH)
BYTE, WORD, LONG = ir.IntType(8), ir.IntType(32), ir.IntType(64)
YES = ir.IntType(1)(1)


class Lanes(types.Type):  # type: ignore[misc]
    """Eight doubles."""


class Mask(types.Type):  # type: ignore[misc]
    """Eight booleans."""


LANES = Lanes("Lanes")
MASK = Mask("Mask")


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    """Eight doubles as one LLVM vector."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


@register_model(Mask)
class MaskModel(models.PrimitiveModel):  # type: ignore[misc]
    """Eight booleans as one LLVM vector."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, BITS)


def load(array: Any, start: int) -> Any:
    """Eight consecutive doubles of a contiguous array, from index `start`."""
    return array[start : start + WIDTH].copy()


def store(array: Any, start: int, value: Any) -> None:
    """Write eight doubles to a contiguous array, from index `start`."""
    array[start : start + WIDTH] = value


def least(a: Any, b: Any) -> Any:
    """The smaller of each lane; `b` where a NaN is on either side."""
    return np.where(a < b, a, b)


def most(a: Any, b: Any) -> Any:
    """The larger of each lane; `b` where a NaN is on either side."""
    return np.where(a > b, a, b)


def either(mask: Any, a: Any, b: Any) -> Any:
    """`a` where the mask is true, else `b`."""
    return np.where(mask, a, b)


def root(a: Any) -> Any:
    """Square root of each lane."""
    return np.sqrt(a)


def size(a: Any) -> Any:
    """Absolute value of each lane."""
    return np.abs(a)


def floor(a: Any) -> Any:
    """Largest whole number not above each lane."""
    return np.floor(a)


def some(mask: Any) -> bool:
    """Whether the mask is true in any lane."""
    return bool(np.any(mask))


def item(array: Any, place: int) -> Any:
    """One number of a contiguous array of any shape; `place` must be within it."""
    return array.reshape(-1)[place].item()


def pick(array: Any, places: Any) -> Any:
    """Bytes or single floats of an array at whole numbers, which must be within it."""
    return array[places.astype(np.int64)].astype(np.float64)


def bits(mask: Any) -> int:
    """The mask as a number: bit k is lane k."""
    return int(np.packbits(mask, bitorder="little")[0])


def mask(number: Any) -> Any:
    """A number as a mask: lane k is bit k, from which `bits` gives the number again."""
    return np.unpackbits(np.uint8(number), bitorder="little").astype(np.bool_)


def lowest(number: Any) -> int:
    """Place of the lowest bit of a number above 0."""
    return (int(number) & -int(number)).bit_length() - 1


def ones(number: Any) -> int:
    """Count of the bits of a number that are set."""
    return int(number).bit_count()


def splat(number: Any) -> Any:
    """One number in every lane."""
    return np.full(WIDTH, float(number))


def widened(builder: Any, kind: Any, value: Any) -> Any:
    """The vector itself, or a scalar in every lane."""
    if isinstance(kind, Lanes):
        return value
    if isinstance(kind, types.Integer):
        value = builder.sitofp(value, ir.DoubleType())
    one = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, WORD(0))
    order = ir.Constant(ir.VectorType(WORD, WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(VECTOR, ir.Undefined), order)


def fits(*kinds: Any) -> bool:
    """Whether the operands are lanes, or lanes and scalars."""
    numbers = (Lanes, types.Float, types.Integer)
    return any(isinstance(k, Lanes) for k in kinds) and all(
        isinstance(k, numbers) for k in kinds
    )


def name_of(verb: Any) -> str:
    """Name of a verb's vector code: code in object files is linked by its name."""
    return f"{verb.__name__}_in_lanes"


def define_binary(
    verb: Any, emit: Callable[..., Any], result: Any, given: Any = LANES
) -> None:
    """Give a verb of two operands, lanes or masks, its vector code."""

    @intrinsic  # type: ignore[untyped-decorator]
    def code(_typing: Any, a: Any, b: Any) -> Any:
        def generate(_context: Any, builder: Any, sign: Any, values: Any) -> Any:
            if given == MASK:
                return emit(builder, *values)
            wide = (
                widened(builder, k, v) for k, v in zip(sign.args, values, strict=True)
            )
            return emit(builder, *wide)

        return result(a, b), generate

    @overload(verb, strict=False)  # type: ignore[untyped-decorator]
    def chosen(a: Any, b: Any) -> Any:
        def vector(a: Any, b: Any) -> Any:
            return code(a, b)

        vector.__qualname__ = name_of(verb)
        fitting = a == b == MASK if given == MASK else fits(a, b)
        return vector if fitting else None


def define_unary(verb: Any, emit: Callable[..., Any], given: Any, result: Any) -> None:
    """Give a verb of one operand its vector code."""

    @intrinsic  # type: ignore[untyped-decorator]
    def code(_typing: Any, a: Any) -> Any:
        def generate(_context: Any, builder: Any, _sign: Any, values: Any) -> Any:
            return emit(builder, values[0])

        return result(a), generate

    @overload(verb, strict=False)  # type: ignore[untyped-decorator]
    def chosen(a: Any) -> Any:
        def vector(a: Any) -> Any:
            return code(a)

        vector.__qualname__ = name_of(verb)
        return vector if a == given else None


def compared(sign: str) -> Callable[..., Any]:
    """Code that compares; false where a NaN is on either side."""
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


def called(name: str) -> Callable[..., Any]:
    """Code of an LLVM function over vectors."""
    kind = ir.FunctionType(VECTOR, [VECTOR])
    full = f"{name}.v{WIDTH}f64"

    def emit(builder: Any, a: Any) -> Any:
        known = builder.module.globals.get(full)
        return builder.call(known or ir.Function(builder.module, kind, full), [a])

    return emit


def chosen_by(sign: str) -> Callable[..., Any]:
    """Code that keeps the first operand where it compares true."""
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


define_binary(operator.add, lambda builder, a, b: builder.fadd(a, b), LANES)
define_binary(operator.sub, lambda builder, a, b: builder.fsub(a, b), LANES)
define_binary(operator.mul, lambda builder, a, b: builder.fmul(a, b), LANES)
define_binary(operator.truediv, lambda builder, a, b: builder.fdiv(a, b), LANES)
define_binary(operator.lt, compared("<"), MASK)
define_binary(operator.le, compared("<="), MASK)
define_binary(operator.gt, compared(">"), MASK)
define_binary(operator.ge, compared(">="), MASK)
define_binary(operator.eq, compared("=="), MASK)
define_binary(least, chosen_by("<"), LANES)
define_binary(most, chosen_by(">"), LANES)
define_binary(operator.and_, lambda builder, a, b: builder.and_(a, b), MASK, MASK)
define_binary(operator.or_, lambda builder, a, b: builder.or_(a, b), MASK, MASK)
define_unary(operator.neg, lambda builder, a: builder.fneg(a), LANES, LANES)
define_unary(root, called("llvm.sqrt"), LANES, LANES)
define_unary(size, called("llvm.fabs"), LANES, LANES)
define_unary(floor, called("llvm.floor"), LANES, LANES)
define_unary(
    some,
    lambda builder, a: builder.icmp_unsigned("!=", builder.bitcast(a, BYTE), BYTE(0)),
    MASK,
    types.boolean,
)
define_unary(
    bits,
    lambda builder, a: builder.zext(builder.bitcast(a, BYTE), LONG),
    MASK,
    types.int64,
)
define_unary(
    mask,
    lambda builder, number: builder.bitcast(builder.trunc(number, BYTE), BITS),
    types.int64,
    MASK,
)
for integer in (types.int64, types.uint64):
    define_unary(lowest, lambda builder, a: builder.cttz(a, YES), integer, types.int64)
    define_unary(ones, lambda builder, a: builder.ctpop(a), integer, types.int64)
define_unary(
    splat,
    lambda builder, number: widened(builder, types.float64, number),
    types.float64,
    LANES,
)


@intrinsic  # type: ignore[untyped-decorator]
def select_code(_typing: Any, mask: Any, a: Any, b: Any) -> Any:
    """Vector code of `either`."""

    def generate(_context: Any, builder: Any, sign: Any, values: Any) -> Any:
        a, b = (widened(builder, sign.args[k], values[k]) for k in (1, 2))
        return builder.select(values[0], a, b)

    return LANES(mask, a, b), generate


@overload(either, strict=False)  # type: ignore[untyped-decorator]
def either_chosen(mask: Any, a: Any, b: Any) -> Any:
    """Vector code for lanes only."""

    def vector(mask: Any, a: Any, b: Any) -> Any:
        return select_code(mask, a, b)

    return vector if mask == MASK and fits(a, b) else None


def vector_at(context: Any, builder: Any, kind: Any, array: Any, start: Any) -> Any:
    """Pointer to the eight doubles of an array from an index on."""
    data = make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [start]), VECTOR.as_pointer())


@intrinsic  # type: ignore[untyped-decorator]
def load_code(_typing: Any, array: Any, start: Any) -> Any:
    """One vector read; the array need not be aligned to vectors."""

    def generate(context: Any, builder: Any, sign: Any, values: Any) -> Any:
        at = vector_at(context, builder, sign.args[0], *values)
        return builder.load(at, align=8)

    return LANES(array, types.int64), generate


@intrinsic  # type: ignore[untyped-decorator]
def store_code(_typing: Any, array: Any, start: Any, value: Any) -> Any:
    """One vector write; the array need not be aligned to vectors."""

    def generate(context: Any, builder: Any, sign: Any, values: Any) -> Any:
        at = vector_at(context, builder, sign.args[0], *values[:2])
        builder.store(values[2], at, align=8)

    return types.void(array, types.int64, value), generate


@intrinsic  # type: ignore[untyped-decorator]
def item_code(_typing: Any, array: Any, place: Any) -> Any:
    """A scalar read without the check for negative places."""
    whole = isinstance(array.dtype, types.Integer)

    def generate(context: Any, builder: Any, sign: Any, values: Any) -> Any:
        data = make_array(sign.args[0])(context, builder, values[0]).data
        value = builder.load(builder.gep(data, [values[1]]))
        if array.dtype == types.float32:
            return builder.fpext(value, ir.DoubleType())
        if not whole or value.type.width == 64:
            return value
        longer = builder.sext if array.dtype.signed else builder.zext
        return longer(value, LONG)

    return (types.int64 if whole else types.float64)(array, types.int64), generate


@overload(item, strict=False)  # type: ignore[untyped-decorator]
def item_chosen(array: Any, place: Any) -> Any:
    """Code for arrays."""

    def scalar(array: Any, place: Any) -> Any:
        return item_code(array, place)

    return scalar


@intrinsic  # type: ignore[untyped-decorator]
def pick_code(_typing: Any, array: Any, places: Any) -> Any:
    """Eight scalar reads."""
    single = array.dtype == types.float32
    element = ir.FloatType() if single else BYTE

    def generate(context: Any, builder: Any, sign: Any, values: Any) -> Any:
        data = make_array(sign.args[0])(context, builder, values[0]).data
        whole = builder.fptosi(values[1], ir.VectorType(WORD, WIDTH))
        found = ir.Constant(ir.VectorType(element, WIDTH), ir.Undefined)
        for lane in range(WIDTH):
            at = WORD(lane)
            place = builder.extract_element(whole, at)
            value = builder.load(builder.gep(data, [place]))
            found = builder.insert_element(found, value, at)
        return (builder.fpext if single else builder.uitofp)(found, VECTOR)

    return LANES(array, places), generate


@overload(pick, strict=False)  # type: ignore[untyped-decorator]
def pick_chosen(array: Any, places: Any) -> Any:
    """Vector code for lanes only."""

    def vector(array: Any, places: Any) -> Any:
        return pick_code(array, places)

    return vector if places == LANES else None


@overload(load, strict=False)  # type: ignore[untyped-decorator]
def load_chosen(array: Any, start: Any) -> Any:
    """Vector code."""

    def vector(array: Any, start: Any) -> Any:
        return load_code(array, start)

    return vector


@overload(store, strict=False)  # type: ignore[untyped-decorator]
def store_chosen(array: Any, start: Any, value: Any) -> Any:
    """Vector code."""

    def vector(array: Any, start: Any, value: Any) -> Any:
        store_code(array, start, value)

    return vector
