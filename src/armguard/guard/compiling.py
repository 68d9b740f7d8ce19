"""Says so before the one start in which the kernels have to be compiled."""

from collections.abc import Callable

from armguard.kernel import KERNEL_CACHE


def kernels_are_compiled() -> bool:
    """Whether the cycle's machine code lies in the cache of this installation."""
    return any(KERNEL_CACHE.rglob("cycle.run_cycle-*.nbi"))


def announce_compiling(progress: Callable[[str], None] | None) -> None:
    """Tell `progress` if the next call has to compile."""
    if progress is not None and not kernels_are_compiled():
        progress("compiling kernels for this machine; first start only, about a minute")
