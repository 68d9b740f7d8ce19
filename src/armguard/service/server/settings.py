"""Settings of a service."""

from dataclasses import dataclass, field
from ipaddress import ip_address
from math import isfinite
from pathlib import Path

from armguard.errors import ServiceError
from armguard.service.wire.keys import Keys

LOOPBACK = "127.0.0.1"
PORT = 47800


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceSettings:
    """How a service runs."""

    bind: str = LOOPBACK  # address it listens on; another than loopback needs keys
    port: int = PORT  # UDP port; 0 for any that is free
    # Key of each role; new ones for this start, in the file of `keys_path`, if empty.
    keys: Keys = field(default_factory=dict)
    rate: float = 250.0  # cycles a second [Hz]
    # How much later than its period a cycle may be; the guard reckons with it, so it
    # costs distance [s].
    late: float = 0.004
    stale: float | None = None  # how old states may be; as the scene says if None [s]
    wish_watchdog: float = 0.1  # a desired motion older than that counts as none [s]
    commander_watchdog: float = 0.5  # a commander silent for longer loses it [s]
    # The robot of a controller that is silent for longer may get another one [s].
    controller_watchdog: float = 0.5
    forget: float = 3.0  # a client that is silent for longer gets no more messages [s]
    heartbeat: float = 0.04  # time between two heartbeats [s]
    # Whether robots stay stopped after the start until they are engaged; they do in any
    # case after a service that was killed.
    stopped: bool = False
    # For that long before a state is expected the loop does not sleep: it takes a
    # processor, and saves the time in which a process that slept gets going again [s].
    spin: float = 0.0
    budget: int = 1024  # see `Guard`
    self_test: bool = True  # see `Guard`
    # The ring's file; one in memory, named after the port, if None.
    ring: Path | None = None
    ring_size: int = 64 << 20  # [bytes]
    realtime: bool = False  # whether to request real-time scheduling
    lock_memory: bool = False  # whether to request memory that is never swapped out
    cpu: int | None = None  # processor to stay on; any if None
    # File of the reflex that the service and its controllers obey; none if None.
    reflex: Path | None = None
    # Processes to start beside, by name, with their arguments.
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
