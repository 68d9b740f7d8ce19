"""The one start in which kernels have to be compiled: said before, and done by two.

Of several programs that start at once one compiles, and the others wait for it: each
would do the same work, and all would take as long as all of it.
"""

import fcntl
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numba

from armguard.kernel import KERNEL_CACHE, READY_CODE

# Longest the other process is waited for [s]; without it this one compiles all.
PATIENCE = 600.0

# Written to the cache when all is there that a guard needs, without and with stops.
READY = "fixed.ready"
GUARDED_READY = "guarded.ready"

# Held by who compiles. It is let go of when he ends, however he does.
LOCK = "compiling.lock"


def is_compiled(guarded: bool) -> bool:
    """Whether a guard's machine code came with the wheel or lies in the cache."""
    return (
        READY_CODE is not None
        or (KERNEL_CACHE / (GUARDED_READY if guarded else READY)).exists()
    )


@contextmanager
def only_compiler() -> Iterator[None]:
    """Wait until nobody else compiles into this cache."""
    KERNEL_CACHE.mkdir(parents=True, exist_ok=True)
    with (KERNEL_CACHE / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError:
            # A folder that knows no locks: work may be done twice.
            pass
        yield


def compile_ahead(progress: Callable[[str], None] | None, guarded: bool) -> None:
    """Compile here and in another process, unless all is kept.

    Numba compiles one kernel at a time. Two processes share the cache on disk: what the
    other one has compiled is loaded when this one comes to it. Here go the distances
    and the cycle with fixed buffers, there the octree; the filter and the prediction of
    stops are begun at both ends.

    Args:
        progress: Told before, since it takes a minute or more.
        guarded: Whether stops are to be predicted; their kernels take as long again.
    """
    if numba.config.DISABLE_JIT or is_compiled(guarded):
        return
    if progress is not None:
        minutes = "three or four minutes" if guarded else "over a minute"
        progress(f"compiling kernels for this machine; first start only, {minutes}")
    with only_compiler():
        if not is_compiled(guarded):
            compile_by_two(guarded)
            for ready in (READY, GUARDED_READY) if guarded else (READY,):
                (KERNEL_CACHE / ready).touch()


def compile_by_two(guarded: bool) -> None:
    """Compile all a guard needs: half of it in another process, if there is a core."""
    # Imported here: it makes a guard itself.
    from armguard.respond.compile_kernels import compile_here, compile_there

    if (os.cpu_count() or 1) < 2:
        compile_there(guarded)
        compile_here(guarded)
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
        compile_here(guarded)
        other.wait(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        if other.poll() is None:
            other.kill()
            other.wait()
