"""The one decorator of compiled code, and the folder where it is kept."""

import os
import re
import stat
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numba
from numba.core import config
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.core.types.misc import unliteral

from armguard.errors import ArmguardError
from armguard.inlined import InlinedCompiler, KernelFlags, SeparateCompiler
from armguard.ready import KernelCache, place_of_ready_code, usable
from armguard.separate import SeparateKernel, link, link_missing

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

PACKAGE = Path(__file__).parent

# What a source file takes names from.
IMPORTED = re.compile(rb"^from armguard\.([\w.]+) import", re.MULTILINE)


# Write permission of group and others.
WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


class CacheError(ArmguardError, OSError):
    """The cache folder cannot be used, or another user could write into it."""


def cache_home() -> Path:
    """Folder for everything the package may delete and make again.

    `ARMGUARD_CACHE`, else `XDG_CACHE_HOME/armguard`, else `~/.cache/armguard`.
    """
    chosen = os.environ.get("ARMGUARD_CACHE")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "armguard"


def kernel_digest(*folders: str) -> str:
    """Hash of every source file that holds a kernel, or a name such a file imports.

    And of Numba's version. Numba's own cache looks at one file only: it does not notice
    an edit in a function called from another file (numba issue 8396), nor in a constant
    taken from one. Keying the folder on all of them does. A kernel's file imports
    constants from where they are defined, not from where they are handed on.

    Args:
        folders: Folders of the package whose kernels count; all if none is named.
    """
    digest = sha256(numba.__version__.encode())
    sources = {path: path.read_bytes() for path in sorted(PACKAGE.rglob("*.py"))}
    holders = [
        path
        for path, source in sources.items()
        if b"@kernel" in source
        and (not folders or path.relative_to(PACKAGE).parts[0] in folders)
    ]
    used = {path for holder in holders for path in sources_of(sources[holder])}
    # What compiles a field of a table is imported where tables are declared, and what
    # compiles a kernel, or a call of a separate one, below.
    used.update(
        PACKAGE / f"{name}.py" for name in ("table", "record", "inlined", "separate")
    )
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


def private_folder(path: Path) -> Path:
    """The folder, made with mode 0700 if it is not there; only its owner may write.

    What Numba keeps on disk is code that the next start runs.

    Raises:
        CacheError: It cannot be made, belongs to another user, or others may write
            into it or rename a folder above it.
    """
    remedy = "delete it, or set ARMGUARD_CACHE to your own folder"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(mode=0o700, exist_ok=True)
        resolved = path.resolve()
        found = resolved.stat()
        above = [(folder, folder.stat()) for folder in resolved.parents]
    except OSError as error:
        raise CacheError(
            f"the cache folder '{path}' cannot be made: {error.strerror}; set "
            "ARMGUARD_CACHE to your own folder"
        ) from None
    if found.st_uid not in (0, os.geteuid()):
        raise CacheError(
            f"the cache folder '{path}' belongs to user {found.st_uid}, who could "
            f"change the code in it; {remedy}"
        )
    if found.st_mode & WRITABLE_BY_OTHERS:
        raise CacheError(
            f"the cache folder '{path}' has mode {stat.S_IMODE(found.st_mode):04o}, so "
            f"other users could change the code in it; {remedy}"
        )
    for folder, state in above:
        if state.st_mode & stat.S_IWOTH and not state.st_mode & stat.S_ISVTX:
            raise CacheError(
                f"the cache folder '{path}' is below '{folder}', where every user may "
                "rename folders; set ARMGUARD_CACHE to your own folder"
            )
    return path


DIGEST = kernel_digest()

KERNEL_CACHE = cache_home() / f"kernels-{DIGEST}"

# Where the object code lies that the wheel brought; None if there is none for here.
READY_CODE = usable(place_of_ready_code(PACKAGE, DIGEST))

# Why nothing is kept there, and nothing of it is run; None if all is well.
CACHE_FAULT: CacheError | None = None
try:
    private_folder(private_folder(KERNEL_CACHE.parent) / KERNEL_CACHE.name)
except CacheError as error:
    CACHE_FAULT = error


def check_cache() -> None:
    """Refuse to start a guard whose cache folder cannot be trusted.

    Raises:
        CacheError: It cannot; the message says why.
    """
    if CACHE_FAULT is not None:
        raise CACHE_FAULT


@overload
def kernel(function: Kernel) -> Kernel: ...


@overload
def kernel(
    *,
    inline: bool = True,
    entry: bool = False,
    separate: bool = False,
    optional: bool = False,
) -> Callable[[Kernel], Kernel]: ...


def kernel(
    function: Callable[..., Any] | None = None,
    *,
    inline: bool = True,
    entry: bool = False,
    separate: bool = False,
    optional: bool = False,
) -> Callable[..., Any]:
    """Compile a function with the options every kernel shares.

    No exception inside (`error_model="numpy"`: 1/0 is infinite, not raised), no
    fast-math (a NaN must stay visible), no GIL, kept on disk in `KERNEL_CACHE`. And no
    counts of references (`_nrt=False`): a kernel that allocates is not compiled.

    Args:
        function: The function.
        inline: Whether callers swallow it. A call hands arrays over one by one, which
            takes longer than a small kernel does: inlining made the cycle ten times
            faster. Large and rare kernels are left out of it, for the sake of compile
            time.
        entry: Whether Python calls it. Unpacking Python's objects is a function of its
            own, and two in three kernels never need it: a quarter of compile time.
        separate: Whether it stays an object of its own, see `SeparateKernel`; for large
            kernels, above all where several call them.
        optional: Whether a separate one serves a feature that few scenes have: what
            turns the feature on links it, see `link_missing`.
    """
    if function is not None:
        return compiled(function, inline, entry, separate)

    def decorate(wrapped: Callable[..., Any]) -> Callable[..., Any]:
        made = compiled(wrapped, inline, entry, separate)
        if separate and made is not wrapped:
            return SeparateKernel(made, optional)
        return made

    return decorate


class KernelDispatcher(CPUDispatcher):  # type: ignore[misc]
    """A kernel.

    Attributes:
        linked: Whether all separate kernels that it may call are, see `link`.
    """

    linked = False

    def enable_caching(self) -> None:
        """Look for its object code where that of kernels is kept."""
        self._cache = KernelCache(self.py_func, READY_CODE, KERNEL_CACHE)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What a call of it is typed with: a literal as the number it is.

        Otherwise it would be compiled once for every value.
        """
        names = {name: unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(unliteral, args)), names)


class EntryDispatcher(KernelDispatcher):
    """A kernel that Python calls."""

    def compile(self, signature: Any) -> Any:
        """Compile, or load, it and all separate kernels that it may call."""
        if not self.overloads:
            link(self)
        return super().compile(signature)


class InnerDispatcher(KernelDispatcher):
    """A kernel without an entry for Python; Numba would jump to address 0."""

    def compile(self, signature: Any) -> Any:
        """Compile, or load, it, also for code that is no kernel."""
        if not self.overloads:
            link_missing(self)
        return super().compile(signature)

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
    function: Callable[..., Any], inline: bool, entry: bool, separate: bool
) -> Callable[..., Any]:
    """The function as Numba's dispatcher, which compiles when it is first called."""
    compiler = SeparateCompiler if separate else Compiler if entry else InlinedCompiler
    jitted: Any = numba.njit(
        error_model="numpy",
        nogil=True,
        forceinline=inline and not separate,
        pipeline_class=compiler,
        no_cpython_wrapper=not entry,
        no_cfunc_wrapper=True,
        _nrt=False,
    )(function)
    if not config.DISABLE_JIT:
        jitted.__class__ = EntryDispatcher if entry else InnerDispatcher
        jitted._compiler._customize_flags = KernelFlags
        if CACHE_FAULT is None:
            jitted.enable_caching()
    return cast(Callable[..., Any], jitted)
