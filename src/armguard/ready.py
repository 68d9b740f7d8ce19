"""Object code that a wheel brings, so that the first start compiles nothing.

`make dist` compiles the kernels for x86-64-v3, which is all processors with AVX2, and
puts them into the wheel. Each kernel has a file, below a folder that is named after the
kernels' sources, Python's binary interface and the processor. Where no such folder is,
or a file is damaged, kernels are compiled as in a clone. The code has the bits of code
that is compiled on the spot: Numba neither reorders nor contracts arithmetic.

Only the package's own folder is looked into: a user that may write there may
change the package too.
"""

import pickle
import sysconfig
import zlib
from collections.abc import Callable
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from llvmlite import binding  # type: ignore[import-untyped]
from numba.core import config
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

TARGET = "x86-64-v3"

# What a processor of that level has, in LLVM's words.
FEATURES = """
    avx avx2 bmi bmi2 cmov crc32 cx16 cx8 f16c fma fxsr lzcnt mmx movbe popcnt sahf
    sse sse2 sse3 sse4.1 sse4.2 ssse3 xsave
""".split()

# Bytes of the hash that a file begins with.
HASH = sha256().digest_size


def place_of_ready_code(package: Path, kernels: str) -> Path:
    """Where the object code for this Python belongs.

    Args:
        package: Folder of the package.
        kernels: Hash of the kernels' sources.
    """
    python = sysconfig.get_config_var("SOABI")
    return package / "ready" / f"{kernels}-{python}-{TARGET}"


def usable(folder: Path) -> Path | None:
    """The folder; None if it is not there, or its code is not for this process.

    It is not where the processor lacks an instruction, or where Numba is set to code of
    another kind.
    """
    asked = (config.CPU_NAME, config.CPU_FEATURES, config.BOUNDSCHECK)
    if not folder.is_dir() or any(one is not None for one in asked):
        return None
    features = binding.get_host_cpu_features()
    return folder if all(features.get(name) for name in FEATURES) else None


def write_ready(file: Path, code: dict[Any, bytes]) -> None:
    """Write the object code of a kernel.

    Args:
        file: Where to.
        code: By signature, as `KernelCache.kept` has it.
    """
    content = dumps(code)
    file.write_bytes(sha256(content).digest() + content)


def read_ready(file: Path) -> dict[Any, bytes]:
    """The object code of a kernel by signature; empty if it is damaged or missing."""
    try:
        found = file.read_bytes()
    except OSError:
        return {}
    if sha256(found[HASH:]).digest() != found[:HASH]:
        return {}
    code: dict[Any, bytes] = pickle.loads(found[HASH:])
    return code


class CompressedFiles(IndexDataCacheFile):  # type: ignore[misc]
    """Files of a kernel in the user's cache, half as long as those of Numba."""

    def _load_data(self, name: str) -> Any:
        try:
            return pickle.loads(decompressed(Path(self._data_path(name))))
        except zlib.error as error:
            # Numba compiles what it cannot read.
            raise OSError(f"{name} is damaged: {error}") from None

    def _save_data(self, name: str, data: Any) -> None:
        with self._open_for_write(self._data_path(name)) as file:
            file.write(zlib.compress(dumps(data), level=1))


def decompressed(file: Path) -> bytes:
    """What such a file holds."""
    return zlib.decompress(file.read_bytes())


class KernelCache:
    """Where the object code of a kernel is: in the wheel, else in the user's cache.

    Attributes:
        name: Of the kernel's file in the wheel.

    Args:
        function: The kernel's function.
        ready: What `usable` returned.
        folder: The user's cache.
    """

    def __init__(
        self, function: Callable[..., Any], ready: Path | None, folder: Path
    ) -> None:
        self.name = f"{function.__module__}.{function.__qualname__}"
        self._function, self._folder = function, folder
        self._ready = ready and ready / self.name

    @cached_property
    def _own(self) -> FunctionCache:
        """The user's cache; most kernels are loaded as a part of others, without it.

        Numba reads the folder from its settings; those of its other users stay.
        """
        previous, config.CACHE_DIR = config.CACHE_DIR, str(self._folder)
        try:
            own = FunctionCache(self._function)
        finally:
            config.CACHE_DIR = previous
        own._cache_file.__class__ = CompressedFiles
        return own

    @property
    def cache_path(self) -> str:
        """The folder of its module in the user's cache."""
        path: str = self._own.cache_path
        return path

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is kept for a signature, loaded; None if nothing is."""
        code = None if self._ready is None else read_ready(self._ready).get(sig)
        if code is None:
            return self._own.load_overload(sig, target_context)
        target_context.refresh()
        return CompileResult._rebuild(target_context, *pickle.loads(code))

    def save_overload(self, sig: Any, made: Any) -> None:
        """Keep what was compiled for a signature in the user's cache."""
        self._own.save_overload(sig, made)

    def kept(self) -> dict[Any, bytes]:
        """What the user's cache has, by signature.

        Raises:
            ValueError: It has code for this processor alone.
        """
        found = {}
        files = self._own._cache_file
        for (signature, (_, *processor), _), name in files._load_index().items():
            if processor != [TARGET, ""]:
                raise ValueError(
                    f"{name} is compiled for {processor}, not {[TARGET, '']}"
                )
            found[signature] = decompressed(Path(files._data_path(name)))
        return found
