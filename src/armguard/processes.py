"""Processes of a station that belong together, and end together."""

import ctypes
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import IO, Self, TypeVar

from armguard.errors import StationError

Found = TypeVar("Found")

# How long a process gets to end by itself [s].
PATIENCE = 4.0

# Between two looks at whether another process has begun [s].
LOOK = 0.05

# Of `prctl`: which signal comes when the parent ends.
PR_SET_PDEATHSIG = 1

# What a new process does first: on Linux it asks to be ended when the one that started
# it does, unless that has ended already; then it becomes what it is to be. Elsewhere an
# orphan lives on.
FIRST = """
import ctypes, os, signal, sys
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)
    if os.getppid() != int(sys.argv[1]):
        sys.exit()
os.execv(sys.executable, [sys.executable, *sys.argv[2:]])
"""


def end_with(parent: int) -> None:
    """On Linux, end as soon as the process that started this one does.

    Args:
        parent: Number of that process; where it is another one, nothing happens.
    """
    if sys.platform == "linux" and os.getppid() == parent:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def free_port() -> int:
    """A UDP port on loopback that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


@contextmanager
def interrupted() -> Iterator[threading.Event]:
    """While in here an interrupt, or an order to end, only sets an event."""
    ended = threading.Event()
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda *_: ended.set()) for number in numbers]
    try:
        yield ended
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def wait_for(
    make: Callable[[], Found], patience: float, ended: threading.Event
) -> Found:
    """What can be made as soon as another process has begun, as a reader of its ring.

    Raises:
        StationError: It cannot after `patience` [s], or when `ended` is set.
    """
    end = time.monotonic() + patience
    while True:
        try:
            return make()
        except StationError:
            if time.monotonic() > end or ended.wait(LOOK):
                raise


class Crew:
    """Child processes by name; leaving the context ends all of them.

    They are in a session of their own, so that an interrupt from the keyboard reaches
    the one who started them alone, who then ends them in order.
    """

    def __init__(self) -> None:
        self._members: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()

    def start(
        self,
        name: str,
        words: Sequence[str],
        *,
        log: IO[bytes] | int = subprocess.DEVNULL,
        stdin: int = subprocess.DEVNULL,
    ) -> subprocess.Popen[bytes]:
        """Start a Python process, `python` and these words.

        Args:
            name: What it is for; the last one started is the first one ended.
            words: Its arguments.
            log: Where its output goes.
            stdin: Where its input comes from.
        """
        process = subprocess.Popen(
            [sys.executable, "-c", FIRST, str(os.getpid()), *words],
            stdin=stdin,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
        self._members[name] = process
        return process

    def __getitem__(self, name: str) -> subprocess.Popen[bytes]:
        """A process."""
        return self._members[name]

    def __contains__(self, name: object) -> bool:
        """Whether there is, or was, a process of that name."""
        return name in self._members

    def pids(self) -> list[int]:
        """Numbers of the processes that live."""
        return [self[name].pid for name in self._members if self.lives(name)]

    def lives(self, name: str) -> bool:
        """Whether a process was started and has not ended."""
        return name in self._members and self._members[name].poll() is None

    def send(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a process that lives."""
        if self.lives(name):
            self._members[name].send_signal(number)

    def end_one(self, name: str) -> int:
        """End a process and wait for it.

        Returns:
            Its exit code.
        """
        process = self._members[name]
        if process.poll() is None:
            # One that is stopped would not hear that it is to end.
            process.send_signal(signal.SIGCONT)
            process.terminate()
        try:
            return process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
            return process.wait()

    def end(self) -> None:
        """End all of them, the last one started first."""
        for name in reversed(self._members):
            self.end_one(name)
