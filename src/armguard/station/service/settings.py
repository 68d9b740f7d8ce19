"""Settings of a service."""

from dataclasses import dataclass, field
from ipaddress import ip_address
from math import isfinite
from pathlib import Path

from armguard.station.errors import ServiceError
from armguard.station.wire.keys import Keys

LOOPBACK = "127.0.0.1"
PORT = 47800


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceSettings:
    """How a service runs.

    Attributes:
        bind: Address it listens on; another than loopback needs a key.
        port: UDP port; 0 for any that is free.
        keys: Key of each role; new ones for this start, in the file of `keys_path`, if
            empty.
        rate: Cycles a second [Hz].
        late: How much later than its period a cycle may come; the guard counts with
            it, so it costs distance [s].
        stale: How old states may be; as the scene says if None [s].
        wish_watchdog: A wish older than that counts as none [s].
        commander_watchdog: Who commands and has not been heard for that long does not
            command any more [s].
        controller_watchdog: A robot whose controller has been silent for that long
            may get another one [s].
        forget: Who has not been heard for that long gets no more messages [s].
        heartbeat: Time between two heartbeats [s].
        stopped: Whether robots stay stopped after the start until they are engaged;
            they do in any case after a service that was killed.
        spin: For that long before a state is expected the loop does not sleep but looks
            for it again and again, which takes a processor and saves the time in which
            a process that slept gets going again [s].
        budget: See `Guard`.
        self_test: See `Guard`.
        ring: The ring's file; one in memory, named after the port, if None.
        ring_size: Its size [bytes].
        realtime: Whether to ask for real-time scheduling.
        lock_memory: Whether to ask for memory that is never swapped out.
        cpu: Processor to stay on; any if None.
        companions: Processes to start beside, by name, with their arguments.
    """

    bind: str = LOOPBACK
    port: int = PORT
    keys: Keys = field(default_factory=dict)
    rate: float = 250.0
    late: float = 0.004
    stale: float | None = None
    wish_watchdog: float = 0.1
    commander_watchdog: float = 0.5
    controller_watchdog: float = 0.5
    forget: float = 3.0
    heartbeat: float = 0.04
    stopped: bool = False
    spin: float = 0.0
    budget: int = 1024
    self_test: bool = True
    ring: Path | None = None
    ring_size: int = 64 << 20
    realtime: bool = False
    lock_memory: bool = False
    cpu: int | None = None
    companions: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 1.0 <= self.rate <= 2000.0:
            raise ServiceError(f"rate is {self.rate} Hz; it must be from 1 to 2000")
        times = ("late", "wish_watchdog", "commander_watchdog", "controller_watchdog")
        for name in (*times, "forget", "heartbeat"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise ServiceError(f"{name} is {value} s; it must be finite and > 0")
        if not 0.0 <= self.spin <= self.period:
            raise ServiceError(
                f"spin is {self.spin} s; it must be from 0 to a period, {self.period}"
            )
        if self.heartbeat > 0.05:
            raise ServiceError(
                f"heartbeat is {self.heartbeat} s; it must be at most 0.05, or "
                "watchdogs take the service for silent"
            )
        try:
            address = ip_address(self.bind)
        except ValueError:
            raise ServiceError(
                f"bind is '{self.bind}'; it must be an address such as {LOOPBACK}"
            ) from None
        if address.version != 4:
            raise ServiceError(f"bind is '{self.bind}'; it must be an IPv4 address")
        if not address.is_loopback and not self.keys:
            raise ServiceError(
                f"bind is '{self.bind}', which other machines can reach; that needs "
                "keys they can be given: write them with 'armguard keys FILE' and name "
                "the file with --key-file"
            )
        if not 0 <= self.port <= 65535:
            raise ServiceError(f"port is {self.port}; it must be from 0 to 65535")

    @property
    def period(self) -> float:
        """Time from one cycle to the next [s]."""
        return 1.0 / self.rate
