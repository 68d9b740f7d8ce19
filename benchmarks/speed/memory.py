"""`bench memory`: allocation, drift, and how long a start takes."""

import os
import subprocess
import sys
import tempfile
from time import perf_counter
from typing import Any

import numpy as np
from numba.core.runtime import _nrt_python, rtsys

from armguard.respond import Guard
from armguard.scene import bay_scene
from speed.scenes import sway
from timing import Progress, percentiles, time_calls

CYCLES = 1_000_000

FIRST_VERDICT = (
    "import armguard as ag; g = ag.Guard(ag.bay_scene()); g.step(g.home).level"
)


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Memory over many cycles, verdicts after them, float32 beside it, start times."""
    guard = Guard(bay_scene(), progress=progress)
    q = sway(guard.tables, 20_000)
    fresh = Guard(bay_scene())
    probes = q[::997]
    times = time_calls(guard.step, q)
    _nrt_python.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    resident = [resident_kib()]
    progress(f"{cycles} cycles")
    for k in range(cycles):
        guard.step(q[k % len(q)])
        if k % max(cycles // 10, 1) == 0:
            resident.append(resident_kib())
            progress(f"cycle {k} of {cycles}, {resident[-1]} KiB resident")
    after = rtsys.get_allocation_stats()
    identical = all(
        guard.step(row).tobytes() == fresh.step(row).tobytes() for row in probes
    )
    progress("start times, in processes of their own")
    return {
        "ours": percentiles(times),
        "peers": {},
        "ratio": {},
        "cycles": cycles,
        "kernel_allocations": after.alloc - before.alloc - cycles * handed_over(guard),
        "resident_kib": resident,
        "resident_growth_kib": resident[-1] - resident[1],
        "verdicts_identical_to_a_fresh_guard": identical,
        "configurations_compared": len(probes),
        "drift": drift(),
        "start_s": starts(),
    }


def handed_over(guard: Guard) -> int:
    """Allocations of a call that does nothing: headers of the arrays it is handed."""
    before = rtsys.get_allocation_stats().alloc
    guard.step(np.full(len(guard.home), np.nan))
    return int(rtsys.get_allocation_stats().alloc - before)


def resident_kib() -> int:
    """Resident memory of this process [KiB]."""
    with open("/proc/self/statm", encoding="utf-8") as file:  # noqa: PTH123
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024


def drift(steps: int = 100_000) -> dict[str, float]:
    """What composing small rotations costs, at a lever of one metre [m].

    A joint turns by a thousandth of a radian a step, forth and back, so that it ends
    where it began; what is left is rounding.
    """
    answer: dict[str, float] = {"steps": steps, "from_angles_m": 0.0}
    rng = np.random.default_rng(0)
    angles = rng.uniform(-1e-3, 1e-3, steps // 2)
    angles = np.concatenate([angles, -angles[::-1]])
    for kind in (np.float32, np.float64):
        c, s = np.cos(angles).astype(kind), np.sin(angles).astype(kind)
        x, y = kind(1.0), kind(0.0)
        for a, b in zip(c, s, strict=True):
            x, y = a * x - b * y, b * x + a * y
        name = f"composed_{np.dtype(kind).name}_m"
        answer[name] = float(np.hypot(float(x) - 1.0, float(y)))
    return answer


def starts() -> dict[str, float]:
    """Time to import, to the first verdict, and to the first one ever [s]."""
    with tempfile.TemporaryDirectory() as folder:
        return {
            "import": timed("import armguard"),
            "warm_first_verdict": timed(FIRST_VERDICT),
            "first_ever_verdict": timed(FIRST_VERDICT, ARMGUARD_CACHE=folder),
        }


def timed(program: str, **environment: str) -> float:
    """Duration of a program in a fresh interpreter [s]."""
    start = perf_counter()
    words = [sys.executable, "-c", program]
    subprocess.run(words, check=True, env={**os.environ, **environment})
    return perf_counter() - start
