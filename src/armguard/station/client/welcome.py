"""The description that a service sends of itself."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RobotJoints:
    """A robot's part of the joints.

    Attributes:
        name: Its name.
        first: Its first place among all joints.
        count: How many it has.
    """

    name: str
    first: int
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Welcome:
    """Description of a service, from its answer to a HELLO.

    Attributes:
        names: 'robot/joint' of each place of q.
        robots: Names of robots.
        parts: Which joints each of them has.
        bodies: Names of bodies by the indices in a COMMAND.
        tools: Names of tools by the indices in a WISH.
        period: Time from one cycle to the next [s].
        home: Home configuration, shape (n,) [rad or m].
        scene_file: The scene's file, or "".
        scene_hash: The scene's hash, in hex.
        ring: Path of the ring, on the service's machine.
        counters: Path of its counters, likewise.
        session: Number of the service's start.
        version: Version of armguard it runs.
        watchdogs: Times after which silence counts, by name [s].
        reasons: Name and sentence of each reason, by its number.
        boot_id: Identifies the start of its machine.
        text: All of it as it came.
    """

    names: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()
    parts: tuple[RobotJoints, ...] = ()
    bodies: tuple[str, ...] = ()
    tools: tuple[str, ...] = ()
    period: float = 0.0
    home: Floats = field(default_factory=lambda: np.zeros(0))
    scene_file: str = ""
    scene_hash: str = ""
    ring: str = ""
    counters: str = ""
    session: int = 0
    version: str = ""
    watchdogs: Mapping[str, float] = field(default_factory=dict)
    reasons: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    boot_id: str = ""
    text: Mapping[str, Any] = field(default_factory=dict)


# Before a client is connected.
NOTHING = Welcome()

PLAIN = (
    *("period", "scene_file", "scene_hash", "ring", "counters"),
    *("session", "version", "watchdogs", "boot_id"),
)


def read_welcome(data: bytes) -> Welcome:
    """The description in the JSON of a WELCOME.

    Raises:
        ValueError: It is no JSON.
        KeyError: Something is missing.
    """
    text = json.loads(data)
    parts = tuple(RobotJoints(**part) for part in text["robots"])
    return Welcome(
        names=tuple(text["names"]),
        robots=tuple(part.name for part in parts),
        parts=parts,
        bodies=tuple(text["bodies"]),
        tools=tuple(text["tools"]),
        home=np.array(text["home"], dtype=np.float64),
        reasons={int(k): (name, words) for k, (name, words) in text["reasons"].items()},
        text=text,
        **{name: text[name] for name in PLAIN},
    )
