"""The one decorator of compiled code, and the folder where it is kept."""

import os
import re
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, overload

import numba
from numba.core import config
from numba.core.registry import CPUDispatcher

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

PACKAGE = Path(__file__).parent

# What a source file takes names from.
IMPORTED = re.compile(rb"^from armguard\.([\w.]+) import", re.MULTILINE)


def cache_home() -> Path:
    """Folder for everything the package may delete and make again.

    `ARMGUARD_CACHE`, else `XDG_CACHE_HOME/armguard`, else `~/.cache/armguard`.
    """
    chosen = os.environ.get("ARMGUARD_CACHE")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "armguard"


def kernel_digest() -> str:
    """Hash of every source file that holds a kernel, or a name such a file imports.

    And of Numba's version. Numba's own cache looks at one file only: it does not notice
    an edit in a function called from another file (numba issue 8396), nor in a constant
    taken from one. Keying the folder on all of them does. A kernel's file imports
    constants from where they are defined, not from where they are handed on.
    """
    digest = sha256(numba.__version__.encode())
    sources = {path: path.read_bytes() for path in sorted(PACKAGE.rglob("*.py"))}
    holders = [path for path, source in sources.items() if b"@kernel" in source]
    used = {path for holder in holders for path in sources_of(sources[holder])}
    for path in sorted(used.intersection(sources).union(holders)):
        digest.update(path.relative_to(PACKAGE).as_posix().encode())
        digest.update(sources[path])
    return digest.hexdigest()[:16]


def sources_of(source: bytes) -> list[Path]:
    """Where a source file of the package takes names from, of the package itself."""
    found = []
    for module in IMPORTED.findall(source):
        path = PACKAGE.joinpath(*module.decode().split("."))
        found += [path.with_suffix(".py"), path / "__init__.py"]
    return found


KERNEL_CACHE = cache_home() / f"kernels-{kernel_digest()}"


@overload
def kernel(function: Kernel) -> Kernel: ...


@overload
def kernel(
    *, inline: bool = True, entry: bool = False
) -> Callable[[Kernel], Kernel]: ...


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    inline: bool = True,
    entry: bool = False,
) -> Callable[..., Any]:
    """Compile a function with the options every kernel shares.

    No exception inside (`error_model="numpy"`: 1/0 is infinite, not raised), no
    fast-math (a NaN must stay visible), no GIL, kept on disk in `KERNEL_CACHE`.
    The cache folder is read by Numba when it decorates, so the setting is put back
    at once and other users of Numba in the process keep theirs.

    Args:
        function: The function.
        inline: Whether callers swallow it. A call hands arrays over one by one and
            counts references to each, which takes longer than a small kernel does:
            inlining made the cycle ten times faster. Large and rare kernels are left
            out of it, for the sake of compile time.
        entry: Whether Python calls it. Unpacking Python's objects is a function of its
            own, and two in three kernels never need it: a quarter of compile time.
    """
    if function is not None:
        return compiled(function, inline, entry)

    def decorate(wrapped: Callable[..., Any]) -> Callable[..., Any]:
        return compiled(wrapped, inline, entry)

    return decorate


class InnerDispatcher(CPUDispatcher):  # type: ignore[misc]
    """A kernel without an entry for Python; Numba would jump to address 0."""

    def __call__(self, *_arguments: Any, **_names: Any) -> None:
        """Say so.

        Raises:
            TypeError: Always.
        """
        raise TypeError(
            f"kernel '{self.py_func.__name__}' is called by kernels only; to call it "
            "from Python decorate it with @kernel(entry=True)"
        )


def compiled(
    function: Callable[..., Any], inline: bool, entry: bool
) -> Callable[..., Any]:
    """The function as Numba's dispatcher, which compiles when it is first called."""
    previous = config.CACHE_DIR
    config.CACHE_DIR = str(KERNEL_CACHE)
    try:
        jitted: Callable[..., Any] = numba.njit(
            cache=True,
            error_model="numpy",
            nogil=True,
            forceinline=inline,
            no_cpython_wrapper=not entry,
            no_cfunc_wrapper=True,
        )(function)
        if not (entry or config.DISABLE_JIT):
            jitted.__class__ = InnerDispatcher
        return jitted
    finally:
        config.CACHE_DIR = previous
