"""What a service tells about itself."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
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
    """What a service told when it was said hello to.

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
        boot_id: What tells the start of its machine.
        text: All of it as it came.
    """

    names: tuple[str, ...]
    robots: tuple[str, ...]
    parts: tuple[RobotJoints, ...]
    bodies: tuple[str, ...]
    tools: tuple[str, ...]
    period: float
    home: Floats
    scene_file: str
    scene_hash: str
    ring: str
    counters: str
    session: int
    version: str
    watchdogs: Mapping[str, float]
    reasons: Mapping[int, tuple[str, str]]
    boot_id: str
    text: Mapping[str, Any]


# What is known before anybody was connected to.
NOTHING = Welcome(
    names=(),
    robots=(),
    parts=(),
    bodies=(),
    tools=(),
    period=0.0,
    home=np.zeros(0),
    scene_file="",
    scene_hash="",
    ring="",
    counters="",
    session=0,
    version="",
    watchdogs={},
    reasons={},
    boot_id="",
    text={},
)


def read_welcome(data: bytes) -> Welcome:
    """What the JSON of a WELCOME says.

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
        period=text["period"],
        home=np.array(text["home"], dtype=np.float64),
        scene_file=text["scene_file"],
        scene_hash=text["scene_hash"],
        ring=text["ring"],
        counters=text["counters"],
        session=text["session"],
        version=text["version"],
        watchdogs=text["watchdogs"],
        reasons={int(k): (name, words) for k, (name, words) in text["reasons"].items()},
        boot_id=text["boot_id"],
        text=text,
    )
