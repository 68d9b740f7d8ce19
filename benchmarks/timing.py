"""Timing of calls: one core, warmed up, collector off; the machine they ran on."""

import gc
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import machine, python_version
from time import perf_counter_ns

import numpy as np

from arrays import Floats

# Takes a sentence before each part that takes a while.
Progress = Callable[[str], None]

PACKAGES = ("armguard", "numba", "numpy", "pin", "coal", "mujoco")


@contextmanager
def quiet() -> Iterator[None]:
    """One core and no garbage collection, both put back afterwards."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        os.sched_setaffinity(0, before)


def percentiles(nanoseconds: Floats | Sequence[float]) -> dict[str, float]:
    """Median and tail in microseconds."""
    p50, p99, p999, most = np.percentile(nanoseconds, [50, 99, 99.9, 100]) / 1e3
    return {
        "median_us": float(p50),
        "p99_us": float(p99),
        "p999_us": float(p999),
        "max_us": float(most),
    }


def time_calls(call: Callable[[Floats], object], rows: Floats) -> Floats:
    """Duration of one call for each row [ns]."""
    times = np.empty(len(rows))
    for k, row in enumerate(rows):
        start = perf_counter_ns()
        call(row)
        times[k] = perf_counter_ns() - start
    return times


def time_in_turns(
    calls: Sequence[Callable[[Floats], object]],
    rows: Floats,
    *,
    blocks: int = 10,
    passes: int = 5,
) -> list[Floats]:
    """Durations of several calls over the same rows, block by block in turns [ns].

    What disturbs the machine for a while disturbs them all, and no more than some of
    the passes over the rows.

    Returns:
        For each call its durations, shape (passes, rows).
    """
    for call in calls:
        time_calls(call, rows[: max(len(rows) // 10, 1)])
    parts: list[list[Floats]] = [[] for _ in calls]
    for _ in range(passes):
        for block in np.array_split(rows, blocks):
            for k, call in enumerate(calls):
                # The first call after a change of hands pays for cold caches.
                call(block[0])
                parts[k].append(time_calls(call, block))
    return [np.concatenate(part).reshape(passes, len(rows)) for part in parts]


def describe_machine() -> dict[str, object]:
    """Processor, cores, and versions of the packages."""
    return {
        "cpu": cpu_name(),
        "cores": os.cpu_count(),
        "architecture": machine(),
        "python": python_version(),
        "versions": {name: version_of(name) for name in PACKAGES},
    }


def cpu_name() -> str:
    """Name of the processor, or its architecture where the system has no name."""
    info = Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8") if info.is_file() else ""
    named = re.search(r"^model name\s*:\s*(.*)$", text, re.MULTILINE)
    return named.group(1).strip() if named else machine()


def version_of(package: str) -> str | None:
    """Version of a package, None if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None
