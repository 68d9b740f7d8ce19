"""Compiling a kernel that is only ever a part of its callers' code.

Numba makes machine code of every function it compiles. Callers take a kernel's bitcode
into their own, and no one jumps to the rest: that of an inlined kernel is not made.
"""

from typing import Any

from llvmlite import binding  # type: ignore[import-untyped]
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags

# What names of environments begin with: Numba writes an address to each.
ENVIRONMENT = "_ZN08NumbaEnv"


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


class InlinedCompiler(Compiler):  # type: ignore[misc]
    """Compiles into a library that is not emitted."""

    def _compile_core(self) -> Any:
        """Compile."""
        state = self.state
        name = state.func_id.func_qualname
        state.library = InlinedLibrary(state.targetctx.codegen(), name)
        state.library.enable_object_caching()
        return super()._compile_core()


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
