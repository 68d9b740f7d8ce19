"""What is done to a running guard: one function a kind of fault."""

import os
import signal
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path

from armguard.station.client import Client
from armguard.station.errors import RefusedError
from armguard.station.faults.fault import Unplayable
from armguard.station.faults.playground import Playground
from armguard.station.faults.relay import Tamper, honest

Doing = Callable[[Playground], AbstractContextManager[None]]

# Readers that never read.
SLOW_READERS = 10

# Longest time a service takes to find that its port is taken [s].
LONG = 60.0

# What is seen of a clock before it is set back [s].
BEFORE = 0.1

# States and wishes an intruder sends, and every how many seconds.
INTRUDES, EVERY = 40, 0.005


def tampered(make: Callable[[Playground], Tamper]) -> Doing:
    """The relay does something to messages."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        relay = ground.relay
        relay.tamper = make(ground)
        try:
            yield
        finally:
            relay.tamper = honest

    return inject


def killed(name: str) -> Doing:
    """A process is killed, kill -9, and started anew afterwards."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        crew = ground.stage.crew
        crew.send(name, signal.SIGKILL)
        crew[name].wait()
        yield
        if name == "service":
            ground.stage.start_service()
            ground.listen_again()
        elif name == "arms":
            ground.start_arms()
        else:
            ground.start_operator()

    return inject


def paused(name: str) -> Doing:
    """A process is stopped for a while, SIGSTOP, as by a debugger or a full machine."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        ground.stage.crew.send(name, signal.SIGSTOP)
        try:
            yield
        finally:
            ground.stage.crew.send(name, signal.SIGCONT)

    return inject


@contextmanager
def ended(ground: Playground) -> Iterator[None]:
    """The service is told to end, SIGTERM, and started anew afterwards."""
    ground.stage.crew.send("service", signal.SIGTERM)
    yield
    ground.stage.crew.end_one("service")
    ground.stage.start_service()
    ground.listen_again()


@contextmanager
def second_commander(ground: Playground) -> Iterator[None]:
    """Somebody claims the command, is refused, and sends wishes all the same."""
    with Client(ground.stage.port, name="second commander", every=0) as other:
        other.connect()
        try:
            other.claim()
        except RefusedError:
            pass
        for _ in range(INTRUDES):
            other.send_velocities([9.0] * len(other.welcome.names))
            ground.watch(EVERY)
        yield


@contextmanager
def second_controller(ground: Playground) -> Iterator[None]:
    """Somebody else sends states of the same robots."""
    with Client(ground.stage.port, name="second controller", every=0) as other:
        other.connect()
        for _ in range(INTRUDES):
            other.send_state([0.1] * len(other.welcome.names))
            ground.watch(EVERY)
        yield


@contextmanager
def stop_ordered(ground: Playground) -> Iterator[None]:
    """Somebody who only watches presses the stop."""
    ground.stage.client.stop()
    yield


@contextmanager
def slow_readers(ground: Playground) -> Iterator[None]:
    """Clients that want every answer and never read one."""
    with ExitStack() as stack:
        for k in range(SLOW_READERS):
            one = stack.enter_context(Client(ground.stage.port, name=f"sleeper {k}"))
            one.connect()
        yield


@contextmanager
def port_taken(ground: Playground) -> Iterator[None]:
    """A second service is started on the same port; it has to give up in words."""
    words = ("-m", "armguard", "serve", "bay", "--port", str(ground.stage.port))
    log = ground.folder / "second service"
    with log.open("wb") as file:
        second = ground.stage.crew.start("second service", words, log=file)
    ground.watch_until(lambda: second.poll() is not None, LONG)
    code, text = second.poll(), log.read_text(errors="replace")
    if code != 2 or "port" not in text:
        raise AssertionError(
            f"a second service on a port that is taken ends with code {code}: "
            f"{text.strip()[-200:]}"
        )
    # Its start kept this machine busy; what counts is that the first one goes on.
    ground.settle()
    ground.begin()
    yield


@contextmanager
def flooded(ground: Playground) -> Iterator[None]:
    """Somebody sends what is no message at all, as fast as he can for a while."""
    noise = [bytes([k]) * (23 * k) for k in range(1, 50)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        for _ in range(10):
            for message in noise:
                one.sendto(message, ("127.0.0.1", ground.stage.port))
            ground.watch(EVERY)
        yield


# The service with a wall clock that goes back by an hour when a file is there.
SET_BACK = """
import sys, time
from itertools import pairwise
from pathlib import Path
path, real, seen = Path(sys.argv.pop(1)), time.time, [False]
def time_of_day():
    seen[0] = seen[0] or path.exists()
    return real() - 3600.0 if seen[0] else real()
time.time = time_of_day
from armguard.cli import main
main()
"""


@contextmanager
def wall_clock_set_back(ground: Playground) -> Iterator[None]:
    """The service's wall clock goes back by an hour; it is recorded, nothing else."""
    path = ground.folder / "set back"
    ground.restart("-c", SET_BACK, str(path))
    ground.settle()
    frames = ground.stage.frames()
    ground.watch(BEFORE)
    ground.begin()
    path.touch()
    yield
    walls = [row[3] for row in frames.unread()]
    if not any(b < a - 3000.0 for a, b in pairwise(walls)):
        raise AssertionError("the frames do not tell that the wall clock went back")


def companion_killed(name: str, module: str, option: Sequence[str]) -> Doing:
    """A process beside the service is killed."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        words = [word.format(folder=ground.folder) for word in option]
        ground.restart(options=tuple(words))
        ground.settle()
        found = [
            pid
            for pid in children(ground.stage.crew["service"].pid)
            if module in (Path(f"/proc/{pid}/cmdline").read_text(errors="replace"))
        ]
        if not found:
            raise Unplayable(f"the service started no '{name}' on this machine")
        ground.begin()
        for pid in found:
            signal_process(pid)
        yield

    return inject


def children(pid: int) -> list[int]:
    """Processes that a process has started, where Linux tells.

    Raises:
        Unplayable: It does not.
    """
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii")
    except OSError as error:
        raise Unplayable(f"this machine does not tell children: {error}") from error
    return [int(word) for word in text.split()]


def signal_process(pid: int) -> None:
    """Kill a process that is none of our own children."""
    os.kill(pid, signal.SIGKILL)
