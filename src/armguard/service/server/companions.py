"""Processes beside the loop, which goes on when they end."""

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

log = logging.getLogger("armguard.service")

# What each is started with beside its own arguments; `{}` is replaced, see `start`.
MODULES: Mapping[str, tuple[str, ...]] = {
    "record": (
        *("armguard.recording", "--ring", "{ring}"),
        *("--parent", "{pid}"),
    ),
    "sense": (
        *("armguard.service.mapping", "--service", "127.0.0.1:{port}"),
        *("--parent", "{pid}"),
    ),
    "rig": ("armguard.simulation.rig", "--port", "{port}", "--parent", "{pid}"),
    "view": ("armguard.view", "--service", "{port}"),
    "metrics": ("armguard.bridges.prometheus", "--ring", "{ring}"),
    "zenoh": ("armguard.bridges.zenoh_bridge", "--port", "{port}"),
}

# Those that are started again when they end: no user sees that they are gone.
RESTARTED = frozenset(("record", "sense"))

# The loop comes before these: they get the processor that it leaves. The bridge passes
# on commands, so it has the loop's priority.
AFTER_THE_LOOP = frozenset(("record", "sense", "view", "metrics"))
NICENESS = 5

# They are started again so much later, then twice that each time, at most so much [s].
SOON, LATER = 0.5, 60.0

# One that lived for so long is started again soon [s].
STEADY = 120.0

# How long they get to end by themselves [s].
PATIENCE = 3.0


@dataclass(slots=True)
class Companion:
    """A process beside the loop; times are monotonic [s]."""

    name: str
    command: Sequence[str]  # what starts it
    process: subprocess.Popen[bytes]
    began: float  # when it was started
    ended: bool = False  # whether its end was noticed
    again: float = inf  # when it is started again; infinite if it is not
    pause: float = SOON  # how much later than its end that is


class Companions:
    """Starts processes, notices their end, and ends them with the service.

    Args:
        clock: Monotonic clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._all: list[Companion] = []
        self._clock = clock

    def start(
        self, wanted: Mapping[str, tuple[str, ...]], ring: Path, port: int
    ) -> None:
        """Start those that are wanted.

        Args:
            wanted: Arguments by name.
            ring: The ring they read.
            port: Port of the service.
        """
        for name, own in wanted.items():
            module, *fixed = MODULES[name]
            places = {"ring": ring, "port": port, "pid": os.getpid()}
            words = [word.format(**places) for word in (*fixed, *own)]
            command = [sys.executable, "-m", module, *words]
            process = started(name, command)
            if process is not None:
                self._all.append(Companion(name, command, process, self._clock()))

    def newly_ended(self) -> int:
        """How many have ended since the last look; each is named in the log."""
        count, now = 0, self._clock()
        for one in self._all:
            if one.ended or one.process.poll() is None:
                continue
            one.ended = True
            count += 1
            then = "the loop goes on"
            if one.name in RESTARTED:
                if now - one.began >= STEADY:
                    one.pause = SOON
                one.again, one.pause = now + one.pause, min(2.0 * one.pause, LATER)
                then += f", and starts it again in {one.again - now:g} s"
            log.warning(
                "companion '%s' has ended with code %s; %s",
                one.name,
                one.process.returncode,
                then,
            )
        return count

    def restart(self) -> int:
        """Start those again whose time has come; how many were.

        It takes the loop about a millisecond each.
        """
        count, now = 0, self._clock()
        for one in self._all:
            if now < one.again:
                continue
            process = started(one.name, one.command)
            if process is None:
                one.again, one.pause = now + one.pause, min(2.0 * one.pause, LATER)
                continue
            one.process, one.began, one.ended = process, now, False
            one.again = inf
            count += 1
        return count

    def end(self) -> None:
        """End all that still run."""
        for one in self._all:
            if one.process.poll() is None:
                one.process.terminate()
        for one in self._all:
            try:
                one.process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                one.process.kill()
                one.process.wait()


def started(name: str, command: Sequence[str]) -> subprocess.Popen[bytes] | None:
    """A process that was started; None if that was not possible, which is logged."""
    try:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    except OSError as error:
        log.warning("companion '%s' cannot be started: %s", name, error)
        return None
    if name in AFTER_THE_LOOP:
        own = os.getpriority(os.PRIO_PROCESS, 0)
        os.setpriority(os.PRIO_PROCESS, process.pid, own + NICENESS)
    return process
