"""On what a figure was measured."""

import os
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import machine, python_version

PACKAGES = ("armguard", "numba", "numpy", "pin", "coal", "mujoco")


def describe_machine() -> dict[str, object]:
    """Processor, cores, and versions of what takes part."""
    return {
        "cpu": cpu_name(),
        "cores": os.cpu_count(),
        "architecture": machine(),
        "python": python_version(),
        "versions": {name: version_of(name) for name in PACKAGES},
    }


def cpu_name() -> str:
    """Name of the processor, as far as the system tells."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return machine()


def version_of(package: str) -> str | None:
    """Version of a package, None if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None
