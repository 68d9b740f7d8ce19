"""How long processes wait for a processor, as Linux counts it."""

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

# A key that is no thread's: what the host of a virtual machine took from all of it.
STOLEN = 0

# Where the time that the host took is in the first line of /proc/stat [ticks].
STEAL_AT = 8


def waits(pids: Iterable[int]) -> Mapping[int, float]:
    """Time for which each thread of some processes could run and did not [s].

    Args:
        pids: The processes; those that have ended are left out.

    Returns:
        By the number of the thread, since it began; by `STOLEN` what the host of a
        virtual machine took. Nothing where the machine does not count all this.

    References:
        Linux, Documentation/scheduler/sched-stats.rst, and proc_stat(5).
    """
    try:
        stat = Path("/proc/stat").read_text(encoding="ascii")
        Path("/proc/self/schedstat").read_bytes()
        stolen = float(stat.split(maxsplit=STEAL_AT + 1)[STEAL_AT])
    except OSError:
        return {}
    found = {STOLEN: stolen / os.sysconf("SC_CLK_TCK")}
    for pid in pids:
        # It may end at any time.
        with suppress(OSError, ValueError):
            for thread in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208
                path = f"/proc/{pid}/task/{thread}/schedstat"
                _, waited, _ = Path(path).read_text(encoding="ascii").split()
                found[int(thread)] = float(waited) * 1e-9
    return found
