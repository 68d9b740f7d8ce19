"""The one start in which kernels have to be compiled: said before, and done by two."""

import os
import subprocess
import sys
from collections.abc import Callable

import numba
import numpy as np

from armguard.geometry.pairs import measure
from armguard.geometry.shapes import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import KERNEL_CACHE

# Longest the other process is waited for [s]; without it this one compiles all.
PATIENCE = 600.0

# Files of the cache without which a guard would have to compile.
CYCLES = ("cycle.run_cycle-*.nbi", "guarded_cycle.run_guarded_cycle-*.nbi")


def kernels_are_compiled() -> bool:
    """Whether the cycles' machine code lies in the cache of this installation."""
    return all(any(KERNEL_CACHE.rglob(name)) for name in CYCLES)


def compile_ahead(progress: Callable[[str], None] | None) -> None:
    """Compile here and in another process, unless all is kept.

    Numba compiles one kernel at a time. Two processes share the cache on disk: what the
    other one has compiled is loaded when this one comes to it. Here go the distances
    and the cycle with fixed buffers, there the octree and the prediction of stops.

    Args:
        progress: Told before, since it takes a minute or two.
    """
    if numba.config.DISABLE_JIT or kernels_are_compiled():
        return
    if progress is not None:
        progress("compiling kernels for this machine; first start only, two minutes")
    if (os.cpu_count() or 1) < 2:
        return
    other = subprocess.Popen(
        [sys.executable, "-m", "armguard.guard.compile_kernels"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        # Imported here: it makes a guard itself.
        from armguard.guard.compile_kernels import compile_cycle

        row, out = np.zeros(ROW_WIDTH), np.zeros(WITNESS_WIDTH)
        measure(int(ShapeKind.SPHERE), row, int(ShapeKind.SPHERE), row, out)
        compile_cycle("fixed")
        other.wait(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        if other.poll() is None:
            other.kill()
            other.wait()
