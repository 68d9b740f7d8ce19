"""Clients that come and go, many more than a service can hold at a time."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from attack.raw import HEADER, LONGEST, NO_COOKIE, Kind, Raw, Role
from attack.row import Row
from attack.target import Target

# Processes that connect at a time.
PROCESSES = 2

# A connection is tried again after that long [s]: HELLOs have a budget a heartbeat.
AGAIN = 0.05

# HELLOs of one connection.
TRIES = 400

# What a service may grow by: pages that it had not touched before [MB].
GROWTH = 2.0

# Connections before its memory is looked at.
WARM = 300

# Clients that stay: as many as there is room for without those that may command.
STAY = 48


def come_and_go(port: int, key: bytes, count: int, done: Any) -> None:
    """Connect and say good-bye, again and again.

    Args:
        port: Port of the service.
        key: Key for 'observe'.
        count: How often.
        done: Shared: connections, and refusals.
    """
    for _ in range(count):
        with Raw(port, key, Role.OBSERVE) as raw:
            raw.socket.settimeout(AGAIN)
            while not connected(raw, done):
                raw.session = 0
                raw.sender += 2
            raw.say(Kind.BYE)
            done[0] += 1


def connected(raw: Raw, done: Any) -> bool:
    """Say hello until one part of the WELCOME is heard; False if that is refused."""
    cookie = NO_COOKIE
    for _ in range(TRIES):
        raw.hello(cookie)
        try:
            while True:
                message = raw.socket.recv(LONGEST)
                kind = message[5]
                if kind == Kind.CHALLENGE and cookie == NO_COOKIE:
                    raw.session = HEADER.unpack_from(message)[4]
                    cookie = message[HEADER.size + 8 : HEADER.size + 24]
                    raw.hello(cookie)
                elif kind == Kind.WELCOME:
                    # A message of another scene is dropped, the good-bye too.
                    raw.scene = HEADER.unpack_from(message)[5]
                    return True
                elif kind == Kind.REFUSAL:
                    done[1] += 1
                    time.sleep(AGAIN)
                    return False
        except TimeoutError:
            continue
    return False


@contextmanager
def crowd(port: int, key: bytes, count: int) -> Iterator[Callable[[], tuple[int, int]]]:
    """Processes that come and go; what gives the connections and refusals so far."""
    context = get_context("fork")
    shares = [context.Array("q", 2, lock=False) for _ in range(PROCESSES)]
    each = count // PROCESSES
    processes = [
        context.Process(target=come_and_go, args=(port, key, each, share), daemon=True)
        for share in shares
    ]
    for process in processes:
        process.start()

    def so_far() -> tuple[int, int]:
        return sum(share[0] for share in shares), sum(share[1] for share in shares)

    try:
        yield so_far
    finally:
        for process in processes:
            process.terminate()
            process.join()


def connects(target: Target, count: int, seconds: float) -> Row:
    """Clients that connect and say good-bye; memory of the service and refusals."""
    before = target.counters.values()
    come_and_go(target.port, target.keys[Role.OBSERVE], WARM, [0, 0])
    memory = target.memory
    began = time.monotonic()
    with crowd(target.port, target.keys[Role.OBSERVE], count) as so_far:
        while so_far()[0] < count // PROCESSES * PROCESSES:
            if time.monotonic() - began > seconds:
                break
            time.sleep(0.1)
        else:
            seconds = time.monotonic() - began
        tried, refused = so_far()
    grown = target.memory - memory
    counters = target.counters.values()
    full = counters["dropped_too_many_senders"] - before["dropped_too_many_senders"]
    last = target.raw(Role.COMMAND)
    last.socket.close()
    return Row(
        attack="clients that connect and say good-bye",
        tried=tried,
        had=refused + full,
        unit="refused",
        target=f"0 of {count:,}; memory grows by no more than {GROWTH:.0f} MB",
        passed=refused + full == 0 and grown <= GROWTH and tried >= 0.99 * count,
        note=f"{tried / seconds:,.0f} a second; memory {memory:.1f} MB before, "
        f"{memory + grown:.1f} MB after; a commander connects then",
        figures={"memory_before_mb": memory, "memory_after_mb": memory + grown},
    )


def full_house(target: Target) -> Row:
    """Observers fill the room there is for them; a commander connects all the same."""
    with ExitStack() as stack:
        there = 0
        for _ in range(STAY + 8):
            one = stack.enter_context(
                Raw(target.port, target.keys[Role.OBSERVE], Role.OBSERVE)
            )
            there += connected_in_time(one)
        commander = stack.enter_context(
            Raw(target.port, target.keys[Role.COMMAND], Role.COMMAND)
        )
        commander.connect()
        granted = commander.claim()
    return Row(
        attack=f"{there} observers that stay, then a commander",
        tried=1,
        had=int(not granted),
        unit="refused",
        target="0",
        passed=granted and there > 0,
    )


def connected_in_time(raw: Raw) -> bool:
    """Whether a client is let in within a few tries."""
    raw.socket.settimeout(AGAIN)
    return any(connected(raw, [0, 0]) for _ in range(3))


def run(count: int, seconds: float) -> list[Row]:
    """Both.

    Args:
        count: Connections.
        seconds: Longest time for them [s].
    """
    with tempfile.TemporaryDirectory() as name, Target(Path(name)) as target:
        return [connects(target, count, seconds), full_house(target)]
