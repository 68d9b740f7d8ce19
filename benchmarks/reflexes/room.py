"""A guard with simulated arms, a reflex and its sensors, all of them real processes."""

import os
import signal
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from select import select
from tempfile import TemporaryDirectory
from typing import Any

from armguard.chaos.zone_sensor import WALL, frame_of
from armguard.errors import StationError
from armguard.processes import Crew, free_port
from armguard.recording.counters import CountersReader
from armguard.reflex import MEASURED, Trip
from armguard.service.wire import Cause
from armguard.service.wire.pulses import Pulses, reset, write_settings
from armguard.simulation.stage import Stage
from reflexes import witness

# A VL53L8CX of 4 x 4 zones: time between frames, and the silence that counts [s].
PERIOD = 1.0 / 60.0
TIMEOUT, ZONES, THRESHOLD = 2.0 * PERIOD, 16, 0.12
# The sensor that is a process, and the one whose frames the campaign sends.
FRONT, PROBE, PROBE_ID = "front", "probe", 2
# Silence of the reflex after which its listeners stop [s].
WATCHDOG = 0.1
# Longest wait for a stop or for a reset [s].
PATIENCE = 20.0
# Real-time priority of the sensor and of the controller, which would be hardware.
PRIORITY = 60
# The guard of a busy machine; the campaign measures the reflex.
OPTIONS = ("--late", "0.4", "--no-self-test", "--mode", "path", "--stale", "0.4")


class Room:
    """Everything that runs while faults are played; `close` ends it.

    Attributes:
        file: File of the reflex.
        pulses: A listener, as a controller has one.
        realtime: Whether this process has real-time scheduling.
        seen: Pauses of this machine, see `witness`.
    """

    def __init__(self) -> None:
        self._folder = TemporaryDirectory()
        self.file = Path(self._folder.name) / "reflex.json"
        zones = {"thresholds": [THRESHOLD] * ZONES}
        self._port = free_port()
        given: dict[str, Any] = {
            "port": self._port,
            "listeners": [free_port() for _ in range(3)],
            "watchdog": WATCHDOG,
            "sensors": {
                FRONT: {"id": 1, "timeout": TIMEOUT, **zones},
                PROBE: {"id": PROBE_ID, "timeout": 2.0, **zones},
            },
        }
        write_settings(self.file, given)
        self.crew, self.counter = Crew(), 0
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.realtime = hurry(os.getpid())
        self.seen = Path(self._folder.name) / "pauses"
        self.seen.write_bytes(bytes(witness.SIZE * (os.cpu_count() or 1)))
        for cpu in os.sched_getaffinity(0) if self.realtime else ():
            words = (witness.__file__, str(self.seen), str(cpu))
            self.crew.start(f"witness {cpu}", words)
        self.start_reflex()
        self.start_sensor()
        self.pulses = Pulses(self.file)
        self._stage: Stage | None = None

    @property
    def stage(self) -> Stage:
        """The guard, its arms and its operator; started when first needed."""
        if self._stage is None:
            self._stage = Stage("bay", *OPTIONS, "--reflex", str(self.file))
            self._stage.start_service()
            self._stage.wait_for_service()
            self._stage.start_arms()
            self._stage.start_operator()
            counters = Path(self._stage.client.welcome.counters)
            while CountersReader(counters).value("states") == 0:
                self._stage.check()
                time.sleep(PERIOD)
        return self._stage

    def close(self) -> None:
        """End everything."""
        if self._stage is not None:
            self._stage.close()
        self.crew.end()
        self.pulses.close()
        self._out.close()
        self._folder.cleanup()

    def start_reflex(self) -> None:
        """Start the reflex."""
        self.crew.start("reflex", ("-m", "armguard.reflex", str(self.file)))

    def start_sensor(self) -> None:
        """Start the sensor that is a process."""
        how = (str(self.file), FRONT, "--period", str(PERIOD))
        process = self.crew.start("sensor", ("-m", "armguard.chaos.zone_sensor", *how))
        hurry(process.pid)

    def send(self, distance: float, *, turned: bool = False) -> int:
        """Send a frame of the probe; the time before that [ns].

        Args:
            distance: Of its first zone [mm].
            turned: Whether a bit is turned on the way.
        """
        self.counter += 1
        noise = self.counter % 7
        zones = [(int(WALL) + noise + k, MEASURED) for k in range(ZONES)]
        zones[0] = (int(distance), MEASURED)
        frame = bytearray(frame_of(PROBE_ID, self.counter, time.monotonic_ns(), zones))
        frame[-10] ^= turned
        start = time.monotonic_ns()
        self._out.sendto(frame, ("127.0.0.1", self._port))
        return start

    def lift(self) -> None:
        """Reset the reflex as soon as it can be, and hear that it is.

        Raises:
            StationError: It cannot be in time.
        """
        end, why = time.monotonic() + PATIENCE, "it does not answer"
        while time.monotonic() < end:
            if not self.crew.lives("reflex"):
                # Another socket of this machine had its port for a moment.
                self.start_reflex()
            self.send(WALL)
            with suppress(StationError):
                why = reset(self.file)
                if not why and self.await_pulse(lambda: self.trip == Trip.CLEAR, 0.1):
                    return
            time.sleep(0.25 * PERIOD)
        raise StationError(f"the reflex is not reset: {why}")

    @property
    def trip(self) -> Trip | None:
        """Why the reflex stops the arms; None if it is silent."""
        cause = self.pulses.hear(time.monotonic_ns())
        return None if cause is Cause.REFLEX_SILENT else Trip(self.pulses.newest.trip)

    def await_pulse(self, done: Callable[[], bool], seconds: float) -> bool:
        """Wait until a pulse makes something true, or for some time."""
        end = time.monotonic() + seconds
        while not done():
            left = end - time.monotonic()
            if left <= 0.0:
                return False
            select([self.pulses], (), (), min(left, 1e-3))
        return True

    def stopped(self, start: int) -> tuple[float, str]:
        """Wait until the arms have to stop: after how long [ms], and why.

        Args:
            start: When the fault began, monotonic [ns].
        """
        if not self.await_pulse(lambda: self.trip != Trip.CLEAR, PATIENCE):
            return PATIENCE * 1e3, "no stop"
        took = (time.monotonic_ns() - start) * 1e-6
        trip = self.trip
        return took, "silent" if trip is None else trip.name


def hurry(pid: int) -> bool:
    """Request real-time scheduling for a process; whether it has it.

    What it starts has ordinary scheduling: a busy child would starve the machine.
    """
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    try:
        os.sched_setscheduler(pid, policy, os.sched_param(PRIORITY))
    except OSError:
        return False
    return True


def signal_of(crew: Crew, name: str, number: signal.Signals) -> int:
    """Send a signal to a process; the time before that [ns]."""
    start = time.monotonic_ns()
    crew.send(name, number)
    return start
