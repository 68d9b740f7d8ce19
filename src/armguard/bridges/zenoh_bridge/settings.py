"""Settings of the bridge, and Zenoh's own made from them."""

import json
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import zenoh

from armguard.errors import StationError

# Zenoh's own port.
LISTEN = "tcp/127.0.0.1:7447"

# Kinds of endpoints that do not leave the machine whatever their address is.
LOCAL_KINDS = ("unixsock-stream", "unixpipe", "shm")

# Characters that mean something in Zenoh's key expressions.
SPECIAL = frozenset("*$?#/")

# What the bridge publishes, and what it takes.
PUBLISHED = ("command", "verdict", "heartbeat")
TAKEN = ("state", "wish/velocities", "wish/positions", "wish/twists", "stop")


class BridgeError(StationError, RuntimeError):
    """The bridge cannot start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeSettings:
    """How the bridge runs."""

    port: int  # of the service
    host: str = "127.0.0.1"  # of the service
    keys: Path | None = None  # file of its keys; if None the one it has written
    listen: tuple[str, ...] = (LISTEN,)  # endpoints, on this machine only
    connect: tuple[str, ...] = ()  # likewise; a router's for instance
    prefix: str = "armguard"  # of all keys
    name: str = "guard"  # follows it, and differs from one service to another
    watchdog: float = 0.1  # after that much silence of the service: a stop [s]
    heartbeat: float = 0.04  # time between two heartbeats [s]
    companion: bool = False  # ends with the service; else it waits for another one

    def __post_init__(self) -> None:
        for endpoint in (*self.listen, *self.connect):
            if not on_this_machine(endpoint):
                raise BridgeError(
                    f"endpoint '{endpoint}' leaves this machine; use 127.0.0.1, and a "
                    "router on this machine to reach it from others"
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


def access_control(root: str) -> dict[str, Any]:
    """Zenoh's rules for what others may do through a session, whatever their mode.

    What no rule allows is denied, so that the bridge carries its own keys only, and
    each of them in one direction: the session passes on no `command` of another one,
    and no other one receives what commanders send.

    Args:
        root: What the keys of the bridge begin with.
    """
    published = [f"{root}/{name}" for name in PUBLISHED]
    taken = [f"{root}/{name}" for name in TAKEN]
    calls = [f"{root}/call/*"]
    rules = [
        {
            "id": f"{flow} {' '.join(messages)}",
            "permission": "allow",
            "flows": [flow],
            "messages": messages,
            "key_exprs": keys,
        }
        for flow, messages, keys in (
            ("ingress", ["put"], taken),
            ("ingress", ["query"], calls),
            # Others may request every key; they receive those that are published.
            ("ingress", ["declare_subscriber"], ["**"]),
            ("egress", ["put"], published),
            ("egress", ["reply", "declare_queryable"], calls),
            ("egress", ["declare_subscriber"], taken),
        )
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": "all"}],
        "policies": [{"rules": [rule["id"] for rule in rules], "subjects": ["all"]}],
    }


def open_session(settings: BridgeSettings) -> zenoh.Session:
    """A Zenoh session that is reached from this machine only, for the bridge's keys.

    Zenoh's own defaults listen on every interface, join a multicast group, and allow
    every session everything; all of that is off.

    Raises:
        BridgeError: An endpoint is taken, or none answers.
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
        ("access_control", access_control(settings.root)),
    ):
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise BridgeError(
            f"Zenoh cannot listen on {', '.join(settings.listen)}: {error}"
        ) from error
