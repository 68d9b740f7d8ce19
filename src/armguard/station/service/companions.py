"""Processes beside the loop: what they do, and whether they live, costs it nothing."""

import logging
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

log = logging.getLogger("armguard.service")

# What each is started with beside its own arguments; `{}` is replaced, see `start`.
MODULES: Mapping[str, tuple[str, ...]] = {
    "record": ("armguard.station.blackbox", "--ring", "{ring}"),
    "view": ("armguard.station.view", "--service", "{port}"),
    "metrics": ("armguard.station.exporter", "--ring", "{ring}"),
    "zenoh": ("armguard.station.zenoh_bridge", "--port", "{port}"),
}

# How long they get to end by themselves [s].
PATIENCE = 3.0


@dataclass(slots=True)
class Companion:
    """A process beside the loop.

    Attributes:
        name: What it is for.
        process: The process.
        ended: Whether its end was noticed.
    """

    name: str
    process: subprocess.Popen[bytes]
    ended: bool = False


class Companions:
    """Starts processes, notices their end, and ends them with the service."""

    def __init__(self) -> None:
        self._all: list[Companion] = []

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
            words = [word.format(ring=ring, port=port) for word in (*fixed, *own)]
            command = [sys.executable, "-m", module, *words]
            try:
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL)
            except OSError as error:
                log.warning("companion '%s' cannot be started: %s", name, error)
                continue
            self._all.append(Companion(name, process))

    def newly_ended(self) -> int:
        """How many have ended since the last look; each is named in the log once."""
        count = 0
        for one in self._all:
            if not one.ended and one.process.poll() is not None:
                one.ended = True
                count += 1
                log.warning(
                    "companion '%s' has ended with code %s; the loop goes on",
                    one.name,
                    one.process.returncode,
                )
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
