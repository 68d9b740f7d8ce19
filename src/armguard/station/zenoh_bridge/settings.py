"""Settings of the bridge, and Zenoh's own made from them."""

import json
from dataclasses import dataclass
from ipaddress import ip_address

import zenoh

from armguard.station.errors import StationError

# Zenoh's own port.
LISTEN = "tcp/127.0.0.1:7447"

# Kinds of endpoints that do not leave the machine whatever their address is.
LOCAL_KINDS = ("unixsock-stream", "unixpipe", "shm")

# Characters that mean something in Zenoh's key expressions.
SPECIAL = frozenset("*$?#/")


class BridgeError(StationError, RuntimeError):
    """The bridge cannot start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeSettings:
    """How the bridge runs.

    Attributes:
        port: Port of the service.
        host: Its address.
        key: Its key; empty for the public word.
        listen: Endpoints Zenoh listens on; on this machine only.
        connect: Endpoints it connects to, a router's for instance; on this machine.
        prefix: What all keys begin with.
        name: What follows it, to tell one service from another.
        sensor: Whether anybody may tell where objects are, without commanding.
        watchdog: After that much silence of the service it is told as a stop [s].
        heartbeat: Time between two heartbeats [s].
        companion: Whether to end when the service is gone; else another one is waited
            for.
    """

    port: int
    host: str = "127.0.0.1"
    key: bytes = b""
    listen: tuple[str, ...] = (LISTEN,)
    connect: tuple[str, ...] = ()
    prefix: str = "armguard"
    name: str = "guard"
    sensor: bool = False
    watchdog: float = 0.1
    heartbeat: float = 0.04
    companion: bool = False

    def __post_init__(self) -> None:
        for endpoint in (*self.listen, *self.connect):
            if not on_this_machine(endpoint):
                raise BridgeError(
                    f"endpoint '{endpoint}' leaves this machine, where everybody could "
                    "command; use 127.0.0.1, and a router that you secure to reach it"
                )
        for part in (*self.prefix.split("/"), self.name):
            if not part or SPECIAL & set(part):
                raise BridgeError(
                    f"'{part}' is no part of a key; it must have a character, and none "
                    "of * $ ? # /"
                )

    @property
    def root(self) -> str:
        """What the keys of this bridge begin with."""
        return f"{self.prefix}/{self.name}"


def on_this_machine(endpoint: str) -> bool:
    """Whether an endpoint such as 'tcp/127.0.0.1:7447' is on this machine only."""
    kind, _, rest = endpoint.partition("/")
    if kind in LOCAL_KINDS:
        return True
    address = rest.partition("#")[0].partition("?")[0].rpartition(":")[0].strip("[]")
    if address == "localhost":
        return True
    try:
        return ip_address(address).is_loopback
    except ValueError:
        return False


def open_session(settings: BridgeSettings) -> zenoh.Session:
    """A Zenoh session that nobody outside this machine can reach.

    What Zenoh does by itself would listen on every interface and join a multicast
    group; all of that is off.

    Raises:
        BridgeError: An endpoint is taken, or nobody is there to connect to.
    """
    config = zenoh.Config()
    for key, value in (
        ("mode", "peer"),
        ("listen/endpoints", list(settings.listen)),
        ("listen/exit_on_failure", True),
        ("connect/endpoints", list(settings.connect)),
        ("scouting/multicast/enabled", False),
        ("scouting/gossip/enabled", False),
        # A session that is killed would leave files in shared memory behind.
        ("transport/shared_memory/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise BridgeError(
            f"Zenoh cannot listen on {', '.join(settings.listen)}: {error}"
        ) from error
