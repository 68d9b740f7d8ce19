"""What is attacked: a service in a process of its own, and arms that obey it."""

import os
import re
import secrets
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import PIPE, Popen
from typing import IO

from armguard.recording.counters import CountersReader
from armguard.scene.bay import FOLDER, bay_path
from attack.raw import Heard, Kind, Raw, Role, heard

# How much later than its period a cycle may come, and how old states may be: an attack
# is distinguished from a machine that is busy by what is done, not by when [s].
LATE = 0.4
PERIOD = 0.004

# Longest start, when kernels have to be compiled beside other programs [s].
START = 900.0


class Target:
    """A service.

    Attributes:
        process: Its process.
        port: Its port.
        keys: Its keys by role.
        counters: What it has counted.

    Args:
        folder: Where its files go.
        options: Further arguments of `armguard serve`.
        port: Port; any that is free if 0.
        keys: Key file; one of its own if None.
        late: See `LATE`.
    """

    def __init__(
        self,
        folder: Path,
        *options: str,
        port: int = 0,
        keys: Path | None = None,
        late: float = LATE,
    ) -> None:
        given = () if keys is None else ("--key-file", str(keys))
        words = ("serve", str(patient_bay(folder, late)), "--port", str(port), *given)
        how = ("--mode", "path", "--late", str(late), "--no-self-test", *options)
        self._log = (folder / "service.log").open("ab")
        self.process, line = started(("armguard", *words, *how), self._log)
        found = re.fullmatch(r"listening on [\d.]+:(\d+), ring (.*)\n", line)
        if found is None:
            self.end()
            raise RuntimeError(f"no service: {(folder / 'service.log').read_text()}")
        self.port, self.ring = int(found[1]), Path(found[2])
        self.key_file = keys or own_keys(self.port)
        self.keys = keys_in(self.key_file)
        self.counters = CountersReader(
            self.ring.with_name(self.ring.name + ".counters")
        )

    def __enter__(self) -> "Target":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def raw(self, role: int, every: int = 0) -> Raw:
        """A client with the right key for a role, connected."""
        client = Raw(self.port, self.keys[role], role)
        client.connect(every)
        return client

    @property
    def memory(self) -> float:
        """Memory that it holds [MB]."""
        text = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        return int(text.split("VmRSS:")[1].split()[0]) / 1024

    def end(self, how: signal.Signals = signal.SIGTERM) -> None:
        """End it."""
        with suppress(ProcessLookupError):
            self.process.send_signal(how)
        self.process.wait(timeout=60)
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._log.close()


def started(words: Sequence[str], log: IO[bytes]) -> tuple[Popen[str], str]:
    """A process of a Python module, and the first line it wrote; empty if it ended.

    Args:
        words: The module and its arguments.
        log: Where its errors go.
    """
    command = [sys.executable, "-m", *words]
    process = Popen(command, stdout=PIPE, stderr=log, text=True)
    watch = threading.Timer(START, process.kill)
    watch.start()
    assert process.stdout is not None
    line = process.stdout.readline()
    watch.cancel()
    return process, line


class Arms:
    """A controller that is commander too: its arms obey at once, as a thread.

    Attributes:
        raw: The client it talks by.
        q: Positions of its arms [rad].
        sent: States it has sent, each with desired motion if it commands.
        calls: Calls it has sent.
        answers: What it has heard last, if `keeps`.
        trace: Positions it was in, if `keeps`.
        desired: Desired velocities of all joints; may be changed at any time.
        strange: Answers with another commander, or that move an arm that is to
            rest, or whose velocity is not finite.
        moving: Answers that moved an arm.
        moved_at: When the last such answer came, monotonic [s].
        silent: States that had no answer in time.
        newest: What it has heard last.
        engages: Whether it engages arms that were stopped.

    Args:
        raw: See there.
        still: First of the joints that are to rest.
        engages: See there.
        commands: Whether it desires anything at all.
        keeps: Whether it keeps all answers and positions.
        start: Where its arms are at first; at home if empty [rad].
    """

    def __init__(
        self,
        raw: Raw,
        *,
        still: int = 7,
        engages: bool = True,
        commands: bool = True,
        keeps: bool = False,
        start: Sequence[float] = (),
    ) -> None:
        self.raw, self._still, self._commands = raw, still, commands
        self.engages, self._keeps = engages, keeps
        self.q = [float(x) for x in start or raw.welcome["home"]]
        self.v = [0.0] * len(self.q)
        self.desired: Callable[[float], list[float]] = self.sway
        self.sent = self.calls = self.strange = self.moving = self.silent = 0
        self.answers: list[Heard] = []
        self.moved_at = 0.0
        self.trace: list[tuple[float, ...]] = []
        self.newest: Heard | None = None
        self._ended = threading.Event()
        self._failed: BaseException | None = None
        if commands and not raw.claim():
            raise ConnectionError("the command was not granted")
        self._engaged = 0.0
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def __enter__(self) -> "Arms":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def sway(self, t: float) -> list[float]:
        """Only the first joint moves, to and fro about where it is at home."""
        found = [0.0] * len(self.q)
        # A rectangle of velocities that comes back, whatever cycle was missed.
        found[0] = 0.05 if self.q[0] < 0.02 * (-1) ** int(t) else -0.05
        return found

    def wait_until(self, done: Callable[[Heard], bool], seconds: float = 30.0) -> bool:
        """Wait until an answer is as it is to be; whether it was."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self._failed is not None:
                raise self._failed
            if self.newest is not None and done(self.newest):
                return True
            time.sleep(0.5 * PERIOD)
        return False

    def close(self) -> None:
        """End the thread and the client."""
        self._ended.set()
        self._thread.join()
        self.raw.socket.close()

    def _run(self) -> None:
        try:
            while not self._ended.is_set():
                self._cycle()
        except BaseException as error:
            self._failed = error

    def _cycle(self) -> None:
        raw = self.raw
        began = time.monotonic()
        desired = raw.desired(self.desired(began)) if self._commands else b""
        raw.say(Kind.STATE, raw.state(self.q, self.v, desired))
        self.sent += 1
        message = raw.hear(Kind.COMMAND, 0.1)
        if message is None:
            self.v = [0.0] * len(self.q)
            self.silent += 1
            return
        answer = heard(message)
        odd = self._commands and answer.commander != raw.sender
        odd |= not all(abs(x) < 10.0 for x in answer.velocities)
        odd |= any(answer.velocities[self._still :])
        self.strange += odd
        if any(answer.velocities):
            self.moving, self.moved_at = self.moving + 1, answer.came
        self.v = list(answer.velocities)
        self.q = [a + b * PERIOD for a, b in zip(self.q, self.v, strict=True)]
        self.newest = answer
        if self._keeps:
            self.answers.append(answer)
            self.trace.append(tuple(self.q))
        if self.engages and any(answer.actions) and began - self._engaged > 0.3:
            self._engaged = began
            raw.say(Kind.CALL, raw.calling("engage"))
            self.calls += 1
        if self._commands and not answer.commander:
            # A machine that was late for too long has cost it the command.
            raw.claim()
        left = began + PERIOD - time.monotonic()
        if left > 0.0:
            time.sleep(left)


def patient_bay(folder: Path, late: float) -> Path:
    """The bay, with states believed for longer than a busy machine is late."""
    path = folder / "bay.yaml"
    text = bay_path().read_text(encoding="utf-8")
    text = text.replace("stale: 0.010", f"stale: {late}")
    path.write_text(text.replace("bay_arm.urdf", str(FOLDER / "bay_arm.urdf")), "utf-8")
    return path


def new_keys(folder: Path) -> Path:
    """A key file that outlives a service."""
    path = folder / "keys"
    lines = (f"{role.name.lower()} {secrets.token_hex(16)}\n" for role in Role)
    path.write_text("".join(lines), "ascii")
    path.chmod(0o600)
    return path


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """A port that is free on loopback, of UDP or of another kind."""
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


def own_keys(port: int) -> Path:
    """Where a service writes the keys of its start."""
    for folder in (Path("/dev/shm"), Path("/tmp")):
        path = folder / f"armguard-{os.getuid()}" / f"{port}.keys"
        if path.exists():
            return path
    raise RuntimeError(f"the service at {port} has written no keys")


def keys_in(path: Path) -> dict[int, bytes]:
    """Keys by role."""
    lines = (line.split() for line in path.read_text("ascii").splitlines())
    return {Role[role.upper()]: key.encode() for role, key in lines}


def commanding(target: Target, **options: object) -> Arms:
    """Arms that a client with the key for 'command' moves."""
    return Arms(target.raw(Role.COMMAND), **options)  # type: ignore[arg-type]
