"""The processes that take part in the service's benchmark, and what they cost."""

import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import psutil

from armguard.errors import ArmguardError

# Time until a process must write its first line; kernels may be compiled [s].
START = 600.0

# Time in which it must end [s].
END = 5.0

# Period at which memory and descriptors are read [s].
LOOK = 1.0


class BenchmarkError(ArmguardError, RuntimeError):
    """A process of the benchmark has ended, or says nothing."""


Process = subprocess.Popen[str]
Result = TypeVar("Result")


@contextmanager
def running(*words: str, log: Path) -> Iterator[Process]:
    """A Python module as a process; it is ended afterwards.

    Args:
        words: The module and its arguments.
        log: Where its standard error goes.

    Raises:
        BenchmarkError: As raised while it ran; with its last line if it has died.
    """
    with log.open("w", encoding="utf-8") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            bufsize=1,
        )
    try:
        yield process
    except BenchmarkError as error:
        said = log.read_text(encoding="utf-8", errors="replace").strip()
        if process.poll() is None or not said:
            raise
        raise BenchmarkError(f"{error}; {said.splitlines()[-1]}") from error
    finally:
        # One that is paused cannot end.
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGCONT)
        process.terminate()
        try:
            process.communicate(timeout=END)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def line_of(process: Process, timeout: float) -> str:
    """The next line a process writes.

    Args:
        process: The process.
        timeout: How long to wait [s].

    Raises:
        BenchmarkError: It has ended, or says nothing.
    """
    assert process.stdout is not None
    ready, _, _ = select.select([process.stdout], [], [], timeout)
    if ready and (line := process.stdout.readline()):
        return line
    raise BenchmarkError(f"process {process.args!r} said nothing: {process.poll()}")


@dataclass
class Watch:
    """Memory and open files of processes over time.

    Attributes:
        rows: By process, of each look: time [s], resident memory [KiB], descriptors.
    """

    rows: dict[str, list[tuple[float, float, int]]] = field(default_factory=dict)
    _all: dict[str, psutil.Process] = field(default_factory=dict)
    _began: float = field(default_factory=time.monotonic)
    _last: float = 0.0

    def add(self, name: str, pid: int) -> None:
        """Watch a process from now on."""
        self._all[name] = psutil.Process(pid)
        self.rows[name] = []

    def add_children(self, pid: int) -> None:
        """Watch the children of a process from now on."""
        for child in psutil.Process(pid).children(recursive=True):
            with suppress(psutil.Error):
                words = child.cmdline()
                name = words[2] if words[1:2] == ["-m"] else child.name()
                self.add(name.rpartition(".")[2], child.pid)

    def look(self) -> None:
        """Look once; no more often than once a second."""
        now = time.monotonic()
        if now - self._last < LOOK:
            return
        self._last = now
        for name, process in self._all.items():
            with suppress(psutil.Error):
                memory = process.memory_info().rss / 1024
                row = now - self._began, memory, process.num_fds()
                self.rows[name].append(row)

    def processor_seconds(self) -> float:
        """Processor time of the watched processes [s]."""
        return sum(seconds_of(process) for process in self._all.values())

    def summary(self) -> dict[str, Any]:
        """What each process holds, how that changes, and whether it is flat."""
        return {name: kept(rows) for name, rows in self.rows.items() if len(rows) > 3}


@dataclass
class Loops:
    """The process of the client and the bare loops.

    Attributes:
        process: The process.
        meanwhile: Called every second while it works.
    """

    process: ProcessPoolExecutor
    meanwhile: Callable[[], None]

    def ask(self, work: Callable[..., Result], *arguments: Any) -> Result:
        """Do some work in the process; its result."""
        result = self.process.submit(work, *arguments)
        while wait([result], LOOK).not_done:
            self.meanwhile()
        return result.result()


def seconds_of(process: psutil.Process) -> float:
    """Processor time that a process has used; 0 if it has ended [s]."""
    with suppress(psutil.Error):
        times = process.cpu_times()
        return float(times.user + times.system)
    return 0.0


# Memory is flat if its growth from the second to the last quarter of the time is at
# most this share, or this much [KiB].
FLAT, LEAST = 0.005, 1024.0


def kept(rows: list[tuple[float, float, int]]) -> dict[str, Any]:
    """Memory and descriptors of a process over time.

    The first quarter is not judged: buffers are still being filled.
    """
    table = np.array(rows)
    at, memory, files = table.T
    quarter = max(len(table) // 4, 1)
    then, now = table[quarter : 2 * quarter], table[-quarter:]
    grown = float(np.median(now[:, 1]) - np.median(then[:, 1]))
    late = table[quarter:]
    slope = float(np.polyfit(late[:, 0] / 60.0, late[:, 1], 1)[0])
    most = max(FLAT * float(np.median(memory)), LEAST)
    return {
        "minutes": float((at[-1] - at[0]) / 60.0),
        "start_kib": float(memory[0]),
        "end_kib": float(memory[-1]),
        "most_kib": float(memory.max()),
        "growth_kib_per_minute": slope,
        "descriptors_start": int(files[0]),
        "descriptors_end": int(files[-1]),
        "flat": bool(grown <= most and now[:, 2].max() <= then[:, 2].max()),
    }
