"""Compiling a kernel that is only a part of its callers' code, or no part of it.

Numba makes machine code of every function it compiles. Callers take a kernel's bitcode
into their own, and no one jumps to the rest: that of an inlined kernel is not made.
No caller takes the bitcode of a separate kernel: it is not kept on disk.
"""

from itertools import count
from secrets import randbits
from typing import Any

from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags

# What names of environments begin with: Numba writes an address to each.
ENVIRONMENT = "_ZN08NumbaEnv"

# Numba numbers the functions that a process compiles, and the number is the part of a
# symbol by which closures of one function differ. Code that several processes have
# kept is linked by these symbols, so no two processes may use the same numbers.
FunctionIdentity._unique_ids = count(randbits(48))


class InlinedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of an inlined kernel: to be linked, not to be run."""

    _final_module: Any

    def _optimize_final_module(self) -> None:
        """Leave that to the callers, who optimise it with their own code."""

    def _finalize_final_module(self) -> None:
        """Hand the engine the environments alone."""
        whole = self._final_module
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        lines = [str(self._codegen._create_empty_module(self.name))]
        lines += [
            str(one)
            for one in whole.global_variables
            if one.name.startswith(ENVIRONMENT)
        ]
        self._final_module = binding.parse_assembly("\n".join(lines))
        self._final_module.name = whole.name
        super()._finalize_final_module()
        # Held, as the engine knows the library by this module.
        self._environments, self._final_module = self._final_module, whole


class SeparateLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of a separate kernel: to be run, not to be linked."""

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """What is kept on disk: object code, and the names that it defines."""
        self._ensure_finalized()
        names = ir.Module(self.name)
        for one in self.get_defined_functions():
            function = ir.Function(names, ir.FunctionType(ir.VoidType(), ()), one.name)
            ir.IRBuilder(function.append_basic_block()).ret_void()
        bitcode = binding.parse_assembly(str(names)).as_bitcode()
        return self.name, "object", (self._get_compiled_object(), bitcode)


class KernelCompiler(Compiler):  # type: ignore[misc]
    """Compiles into a library of its own kind.

    Attributes:
        kind: The kind.
    """

    kind: type[JITCodeLibrary]

    def _compile_core(self) -> Any:
        """Compile."""
        state = self.state
        name = state.func_id.func_qualname
        state.library = self.kind(state.targetctx.codegen(), name)
        state.library.enable_object_caching()
        return super()._compile_core()


class InlinedCompiler(KernelCompiler):
    """Compiles a kernel whose machine code is not made."""

    kind = InlinedLibrary


class SeparateCompiler(KernelCompiler):
    """Compiles a kernel whose bitcode is not kept."""

    kind = SeparateLibrary


class KernelFlags(Flags):  # type: ignore[misc]
    """Flags of a compilation whose comparison looks at the options that were set.

    Numba compares flags a million times while it compiles all kernels, and would read
    every option twice for that.
    """

    def __hash__(self) -> int:
        return hash(KernelFlags)

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, KernelFlags) and self._values == other._values
        )
