"""Kernels that are compiled on their own and called through a cell of memory.

A kernel that calls another one takes that one's code into its own and has all of it
optimised again, and so does whatever calls it. A separate kernel stays an object of its
own: its callers load its address from a cell, as a program calls a shared library. The
cell is a symbol of the process, so a caller that was kept on disk finds it in any
process that has imported both. `link` writes the addresses before Python calls a
kernel.

An optional kernel serves a feature that few scenes have. Its callers do not link it:
what turns the feature on does, before the first call.
"""

import ctypes
import os
from collections.abc import Callable, Container, Iterator
from dis import get_instructions
from functools import cache, update_wrapper
from types import CodeType
from typing import Any, get_type_hints

from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba.core import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.types.misc import unliteral
from numba.core.typing.templates import ConcreteTemplate, infer_global
from numba.extending import as_numba_type, lower_builtin


def trap() -> None:
    """End the process: it would go on with an answer that nothing has computed."""
    os.write(2, b"armguard: a separate kernel was called before it was linked\n")
    os.abort()


TRAP = ctypes.CFUNCTYPE(None)(trap)


class SeparateKernel:
    """A kernel whose code its callers do not take into their own.

    It raises nothing, and has one signature: that of its annotations.

    Attributes:
        py_func: The function.
        dispatcher: What compiles it.
        signature: Types of what it returns and takes.
        symbol: Name of its cell.
        cell: Holds the address of its code; that of `trap` before it is linked.
        optional: Whether its callers are linked without it.
        linked: Whether it is compiled, or about to be.

    Args:
        dispatcher: See above. All parameters and what is returned are annotated with
            numbers, tuples of them, arrays of the kinds of `table`, tables or records.
        optional: See above.
    """

    def __init__(self, dispatcher: Any, optional: bool = False) -> None:
        self.py_func = function = dispatcher.py_func
        update_wrapper(self, function)
        hints = get_type_hints(function, include_extras=True)
        returned = as_numba_type(hints.pop("return"))
        self.dispatcher, self.optional = dispatcher, optional
        self.signature = returned(*map(as_numba_type, hints.values()))
        self.symbol = f"{function.__module__}.{function.__qualname__}"
        self.cell = ctypes.cast(TRAP, ctypes.c_void_p)
        self.linked = False
        binding.add_symbol(self.symbol, ctypes.addressof(self.cell))
        infer_global(self, types.Function(self._template()))
        lower_builtin(self, *self.signature.args)(self._call)

    def __repr__(self) -> str:
        return f"<separate kernel {self.symbol}>"

    def __call__(self, *arguments: Any) -> Any:
        """Refuse: it has no entry for Python.

        Raises:
            TypeError: Always.
        """
        return self.dispatcher(*arguments)

    def compile(self) -> None:
        """Compile it, or load it, and write its address to its cell.

        Raises:
            TypeError: It returns something else than its annotation says.
        """
        arguments = self.signature.args
        self.dispatcher.compile(arguments)
        made = self.dispatcher.overloads[arguments]
        # A constant has a type of its own, and is laid out as its number.
        returned = unliteral(made.signature.return_type)
        if returned != self.signature.return_type:
            raise TypeError(
                f"kernel '{self.symbol}' returns {returned}; its "
                f"annotation says {self.signature.return_type}"
            )
        self.cell.value = made.library.get_pointer_to_function(
            made.fndesc.llvm_func_name
        )

    def _template(self) -> type[ConcreteTemplate]:
        """What types calls of it, and links it for callers that are not kernels."""
        kernel = self

        class Template(ConcreteTemplate):  # type: ignore[misc]
            key = kernel
            cases = (kernel.signature,)

            def apply(self, args: Any, kws: Any) -> Any:
                wanted = kernel.signature.args
                if any(map(would_be_cut, args, wanted)):
                    return None
                if not kernel.optional:
                    link_missing(kernel)
                return super().apply(args, kws)

        return Template

    def _call(self, context: Any, builder: Any, signature: Any, args: Any) -> Any:
        """Call through the cell."""
        returned, kinds = signature.return_type, signature.args
        convention, module = context.call_conv, builder.module
        pointer = convention.get_function_type(returned, kinds).as_pointer()
        cell = module.globals.get(self.symbol)
        if cell is None:
            cell = ir.GlobalVariable(module, pointer, self.symbol)
        # Kernels raise nothing: there is no status to look at.
        _, result = convention.call_function(
            builder, builder.load(cell), returned, kinds, args
        )
        return result


def would_be_cut(given: Any, wanted: Any) -> bool:
    """Whether a number may have a fraction and is to become one that has none."""
    return isinstance(given, types.Float) and not isinstance(wanted, types.Float)


def link(
    kernel: Callable[..., Any], last_first: bool = False, later: Container[Any] = ()
) -> None:
    """Compile, or load, all separate kernels that a kernel may call, by others too.

    And the kernel itself where it is a separate one. Optional kernels are left out,
    but for the kernel itself and what an optional one calls.

    Args:
        kernel: The kernel.
        last_first: Whether to begin with those that are called last, for one of two
            processes that share the work: they meet in the middle.
        later: Kernels that are compiled after all others: the other process begins
            with them.
    """
    reached = kernels_from(kernel)
    separate = [one for one in reached if isinstance(one, SeparateKernel)]
    for one in reached:
        one.linked = True
    try:
        ordered = separate[::-1] if last_first else separate
        for one in sorted(ordered, key=lambda one: one in later):
            one.compile()
    except BaseException:
        for one in reached:
            one.linked = False
        raise


def link_missing(kernel: Any) -> None:
    """Link what a kernel may call, but for what is being linked at this moment.

    Does nothing where kernels are interpreted.
    """
    if getattr(kernel, "linked", True):
        return
    with global_compiler_lock:
        for one in kernels_from(kernel):
            if isinstance(one, SeparateKernel) and not one.linked:
                link(one)


def kernels_from(kernel: Any) -> list[Any]:
    """A kernel and all that it may call, nearest first; none where all is interpreted.

    What a kernel calls is a name of its module, or of the function that made it.
    Optional kernels are reached from an optional kernel only.
    """
    reached: dict[int, Any] = {id(kernel): kernel}
    waiting = [kernel] if isinstance(kernel, Dispatcher | SeparateKernel) else []
    within = is_optional(kernel)
    for one in waiting:
        for value in named_values(one.py_func):
            left_out = id(value) in reached or (is_optional(value) and not within)
            if not left_out and isinstance(value, Dispatcher | SeparateKernel):
                reached[id(value)] = value
                waiting.append(value)
    return waiting


def is_optional(value: Any) -> bool:
    """Whether it is a kernel that its callers are linked without."""
    return isinstance(value, SeparateKernel) and value.optional


def named_values(function: Any) -> Iterator[Any]:
    """Values of the names of a function's module and maker that its code reads."""
    for cell in function.__closure__ or ():
        yield cell.cell_contents
    for name in read_globals(function.__code__):
        yield function.__globals__.get(name)


@cache
def read_globals(code: CodeType) -> list[str]:
    """Names of the module that code reads; `code.co_names` holds fields as well.

    Kept: a start needs it 64 times per kernel, and decoding takes 40 us.
    """
    found = get_instructions(code)
    names = (one.argval for one in found if one.opname == "LOAD_GLOBAL")
    return list(dict.fromkeys(names))
