"""A guard at work without a robot: service, simulated arms and an operator."""

import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from armguard.errors import StationError
from armguard.processes import Crew, free_port
from armguard.recording.ring import RingReader
from armguard.service.client import Client
from armguard.service.wire.keys import keys_path

# The first start on a machine compiles all kernels [s].
LONGEST_START = 900.0

# Between two looks whether the service is there [s].
LOOK = 0.1


class Stage:
    """Processes around one service, started in order and ended together.

    Attributes:
        crew: The processes.
        port: Port of the service.
        client: A client that observes.
        options: Further arguments of the service.

    Args:
        scene: A scene file, or the name of a bundled scene.
        options: Further arguments of `armguard serve`.
        log: Where the processes write to.
    """

    def __init__(self, scene: str, *options: str, log: IO[bytes] | None = None) -> None:
        self.crew = Crew()
        self.port = free_port()
        self.client = Client(self.port, name="audience", every=0)
        self.options = options
        self._scene, self._log = scene, log

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End everything."""
        self.client.close()
        self.crew.end()

    def start_service(self, *launch: str) -> None:
        """Start the service and do not wait for it.

        Args:
            launch: How Python runs the command line; `-m armguard` if empty.
        """
        serve = ("serve", self._scene, "--port", str(self.port), *self.options)
        self._start("service", *(launch or ("-m", "armguard")), *serve)

    def wait_for_service(self, say: Callable[[float], None] = lambda _: None) -> None:
        """Wait until the service answers.

        Args:
            say: Called again and again with the time so far [s].

        Raises:
            StationError: It ended, or did not answer in time.
        """
        start = time.monotonic()
        while time.monotonic() - start < LONGEST_START:
            if not self.crew.lives("service"):
                raise StationError(
                    "the service ended with code "
                    f"{self.crew['service'].returncode} before it answered"
                )
            try:
                self.client.connect(timeout=LOOK)
            except StationError:
                say(time.monotonic() - start)
                continue
            return
        raise StationError(f"the service did not answer in {LONGEST_START:.0f} s")

    def start_arms(self, port: int | None = None, trace: Path | None = None) -> None:
        """Start the simulated arms.

        Args:
            port: Where they find the service; its own port if None.
            trace: Where they write their true state.
        """
        to = () if trace is None else ("--trace", str(trace))
        self._simulated("arms", port, *to)

    def start_operator(self, port: int | None = None, seed: int | None = None) -> None:
        """Start the operator.

        Args:
            port: See `start_arms`.
            seed: Seed of its motion; without one all arms sway about home.
        """
        how = ("--sway",) if seed is None else ("--drive", str(seed))
        self._simulated("operator", port, *how)

    def check(self) -> None:
        """Make sure that service, arms and operator live.

        Raises:
            StationError: One has ended.
        """
        for name in ("service", "arms", "operator"):
            if name in self.crew and not self.crew.lives(name):
                code = self.crew[name].returncode
                raise StationError(f"the process '{name}' ended with code {code}")

    def frames(self) -> RingReader:
        """What the service writes from now on."""
        return RingReader(Path(self.client.welcome.ring), newest=True)

    def _simulated(self, name: str, port: int | None, *words: str) -> None:
        at = str(self.port if port is None else port)
        self._start(
            name, "-m", "armguard.simulation", "--port", at, "--key-file",
            str(keys_path(self.port)), "--scene", self._scene, *words,
        )  # fmt: skip

    def _start(self, name: str, *words: str) -> None:
        if self._log is None:
            self.crew.start(name, words)
        else:
            self.crew.start(name, words, log=self._log)
