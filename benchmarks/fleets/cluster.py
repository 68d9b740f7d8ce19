"""A cluster of the command line's own programs, whose workers are killed."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from armguard.processes import Crew

# Time for a program to print its address [s].
PATIENCE = 120.0


class Workers:
    """A scheduler and workers on loopback.

    Attributes:
        address: The scheduler's.
        killed: Workers that were killed.
    """

    def __init__(self, crew: Crew, folder: Path) -> None:
        self._crew, self._folder = crew, folder
        self._count = self.killed = 0
        self.address = self._start("scheduler", "scheduler", "--port", "0")

    def add(self) -> str:
        """Start a worker; its name."""
        self._count += 1
        name = f"worker{self._count}"
        self._start(name, "worker", self.address)
        return name

    def replace(self, name: str) -> str:
        """Kill a worker and all it started, and start another one; its name."""
        os.killpg(self._crew[name].pid, signal.SIGKILL)
        self._crew[name].wait()
        self.killed += 1
        return self.add()

    def _start(self, name: str, *words: str) -> str:
        """Start a program; the address that it prints."""
        path = self._folder / f"{name}.log"
        with path.open("wb") as log:
            self._crew.start(name, ["-m", "armguard", "fleet", *words], log=log)
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            for line in path.read_text(encoding="utf-8").splitlines():
                if line.startswith("tcp://"):
                    return line
            time.sleep(0.05)
        raise TimeoutError(path.read_text(encoding="utf-8"))


@contextmanager
def workers(folder: Path, count: int, every: float | None) -> Iterator[Workers]:
    """A cluster of so many workers; with `every`, one is killed so often [s]."""
    with Crew() as crew:
        found = Workers(crew, folder)
        names = [found.add() for _ in range(count)]
        ended = threading.Event()

        def kill() -> None:
            while not ended.wait(every):
                names.append(found.replace(names.pop(0)))

        thread = threading.Thread(target=kill)
        if every is not None:
            thread.start()
        try:
            yield found
        finally:
            ended.set()
            if every is not None:
                thread.join()
