"""Faults of a reflex, its sensor and the guard beside it."""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from signal import SIGCONT, SIGKILL, SIGSTOP, SIGUSR1, SIGUSR2, Signals

from armguard.chaos.fault import Effect, Fault, Injection
from armguard.chaos.playground import (
    FRAME_PERIOD,
    FRAME_TIMEOUT,
    REFLEX_WATCHDOG,
    Playground,
)
from armguard.chaos.zone_sensor import WALL, frame_of
from armguard.errors import StationError
from armguard.processes import free_port
from armguard.reflex import CRC, MEASURED, Trip, read_settings
from armguard.service.wire.pulses import Pulses, reset, write_settings

# The sensor, its id and its zones, and the distance at which each stops the arms [m].
SENSOR, ID, ZONES, THRESHOLD = "front", 1, 64, 0.12

GROUP = "the reflex"

# What a service that was held up says when it goes on.
HELD_UP = ("CYCLE_LATE", "DEADLINE_MISSED", "STATE_STALE", "STOP_ORDERED")

# How long the reflex gets to be reset [s].
PATIENCE = 20.0

# What happens to a running reflex, and is over when the context ends.
Disturb = Callable[[Playground, Path], None]


def reflex_fault(begin: Disturb, end: Disturb, trip: Trip | None) -> Injection:
    """A fault of a guard that has a reflex.

    Args:
        begin: Begins it.
        end: Ends it.
        trip: Why the reflex stops the arms then; None if it says nothing any more.
    """

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        file = ground.folder / "reflex.json"
        if not ground.stage.crew.lives("reflex"):
            start_beside(ground, file)
        lift(file)
        ground.settle()
        pulses = Pulses(file)
        ground.begin()
        begin(ground, file)
        try:
            yield
        finally:
            pulses.hear(time.monotonic_ns())
            pulses.close()
            end(ground, file)
            lift(file)
        if trip is not None and pulses.newest.trip != trip:
            raise AssertionError(f"not {trip.name}: {pulses.sentence}")

    return inject


def start_beside(ground: Playground, file: Path) -> None:
    """Start the guard anew, and a reflex with one sensor beside it."""
    sensor = {"id": ID, "timeout": FRAME_TIMEOUT, "thresholds": [THRESHOLD] * ZONES}
    given = {
        "port": free_port(),
        # The service, the arms and this process.
        "listeners": [free_port() for _ in range(3)],
        "watchdog": REFLEX_WATCHDOG,
        "sensors": {SENSOR: sensor},
    }
    write_settings(file, given)
    ground.restart(options=("--reflex", str(file)))
    start_reflex(ground, file)
    start_sensor(ground, file)


def start_reflex(ground: Playground, file: Path) -> None:
    """Start the reflex."""
    ground.stage.crew.start("reflex", ("-m", "armguard.reflex", str(file)))


def start_sensor(ground: Playground, file: Path) -> None:
    """Start its sensor."""
    how = (str(file), SENSOR, "--period", str(FRAME_PERIOD))
    ground.stage.crew.start("sensor", ("-m", "armguard.chaos.zone_sensor", *how))


def lift(file: Path) -> None:
    """Reset the reflex as soon as it can be.

    Raises:
        StationError: It cannot be in time.
    """
    end, why = time.monotonic() + PATIENCE, "it does not answer"
    while time.monotonic() < end:
        try:
            why = reset(file)
        except StationError:
            why = "it does not answer"
        if not why:
            return
        time.sleep(FRAME_PERIOD)
    raise StationError(f"the reflex is not reset: {why}")


def signals(name: str, number: Signals) -> Disturb:
    """Send a signal to a process; a killed one is waited for."""

    def disturb(ground: Playground, _: Path) -> None:
        crew = ground.stage.crew
        crew.send(name, number)
        if number == SIGKILL:
            crew[name].wait()

    return disturb


def both(first: Disturb, second: Disturb) -> Disturb:
    """One after the other."""

    def disturb(ground: Playground, file: Path) -> None:
        first(ground, file)
        second(ground, file)

    return disturb


def corrupt(ground: Playground, file: Path) -> None:
    """Send a frame with one bit that is turned."""
    frame = frame_of(ID, 1, time.monotonic_ns(), [(int(WALL), MEASURED)] * ZONES)
    wrong = bytearray(frame)
    wrong[-CRC.size - 4] ^= 1
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.sendto(wrong, ("127.0.0.1", read_settings(file)["port"]))


def start_service(ground: Playground, _: Path) -> None:
    """Start a killed service anew."""
    ground.stage.start_service()
    ground.listen_again()


def nothing(_: Playground, __: Path) -> None:
    """The fault is over by itself."""


object_comes = signals("sensor", SIGUSR1)
object_leaves = signals("sensor", SIGUSR2)

REFLEX_FAULTS: tuple[Fault, ...] = (
    Fault(
        name="the reflex is killed", group=GROUP, effect=Effect.STOPS,
        reasons=("REFLEX_SILENT",), within=("reflex", "cycle"),
        inject=reflex_fault(signals("reflex", SIGKILL), start_reflex, None),
    ),
    Fault(
        name="the reflex is paused", group=GROUP, effect=Effect.STOPS,
        reasons=("REFLEX_SILENT",), within=("reflex", "cycle"),
        inject=reflex_fault(
            signals("reflex", SIGSTOP), signals("reflex", SIGCONT), None
        ),
    ),
    Fault(
        name="an object is in a zone", group=GROUP, effect=Effect.STOPS,
        reasons=("REFLEX_STOPPED",), within=("frame", "cycle"),
        inject=reflex_fault(object_comes, object_leaves, Trip.NEAR),
    ),
    Fault(
        name="a zone sensor is silent", group=GROUP, effect=Effect.STOPS,
        reasons=("REFLEX_STOPPED",), within=("frames", "cycle"),
        inject=reflex_fault(signals("sensor", SIGKILL), start_sensor, Trip.SILENT),
    ),
    Fault(
        name="a frame is corrupted", group=GROUP, effect=Effect.STOPS,
        reasons=("REFLEX_STOPPED",), within=("cycle",),
        inject=reflex_fault(corrupt, nothing, Trip.CORRUPT),
    ),
    Fault(
        name="the service is killed while an object is in a zone", group=GROUP,
        effect=Effect.STOPS_ITSELF, within=("frame",),
        inject=reflex_fault(
            both(signals("service", SIGKILL), object_comes),
            both(object_leaves, start_service),
            Trip.NEAR,
        ),
    ),
    Fault(
        name="the service is paused while an object is in a zone", group=GROUP,
        effect=Effect.STOPS_ITSELF, reasons=(*HELD_UP, "REFLEX_STOPPED"),
        within=("frame",), hold=0.5,
        inject=reflex_fault(
            both(signals("service", SIGSTOP), object_comes),
            both(signals("service", SIGCONT), object_leaves),
            Trip.NEAR,
        ),
    ),
)  # fmt: skip
