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
CYCLE = "cycle.run_cycle-*.nbi"
GUARDED_CYCLE = "guarded_cycle.run_guarded_cycle-*.nbi"


def is_compiled(cycle: str) -> bool:
    """Whether a cycle's machine code lies in the cache of this installation."""
    return any(KERNEL_CACHE.rglob(cycle))


def compile_ahead(progress: Callable[[str], None] | None, guarded: bool) -> None:
    """Compile here and in another process, unless all is kept.

    Numba compiles one kernel at a time. Two processes share the cache on disk: what the
    other one has compiled is loaded when this one comes to it. Here go the distances,
    the cycle with fixed buffers and the filter, there the octree and the prediction of
    stops.

    Args:
        progress: Told before, since it takes a minute or more.
        guarded: Whether stops are to be predicted; their kernels take as long again.
    """
    if numba.config.DISABLE_JIT:
        return
    if is_compiled(CYCLE) and (is_compiled(GUARDED_CYCLE) or not guarded):
        return
    if progress is not None:
        minutes = "three or four minutes" if guarded else "over a minute"
        progress(f"compiling kernels for this machine; first start only, {minutes}")
    if (os.cpu_count() or 1) < 2:
        return
    other = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "armguard.respond.compile_kernels",
            *(["guarded"] if guarded else []),
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        # Imported here: it makes a guard itself.
        from armguard.respond.compile_kernels import compile_cycle, compile_filter

        row, out = np.zeros(ROW_WIDTH), np.zeros(WITNESS_WIDTH)
        measure(int(ShapeKind.SPHERE), row, int(ShapeKind.SPHERE), row, out)
        compile_cycle("fixed")
        if guarded:
            compile_filter()
        other.wait(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        if other.poll() is None:
            other.kill()
            other.wait()
