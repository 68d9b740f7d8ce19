"""The description that a service sends of itself."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RobotJoints:
    """A robot's part of the joints."""

    name: str
    first: int  # its first place among all joints
    count: int  # how many it has


@dataclass(frozen=True, slots=True, eq=False)
class Welcome:
    """Description of a service, from its answer to a HELLO."""

    names: tuple[str, ...] = ()  # 'robot/joint' of each place of q
    robots: tuple[str, ...] = ()
    parts: tuple[RobotJoints, ...] = ()  # joints of each robot
    bodies: tuple[str, ...] = ()  # by the indices in a COMMAND
    tools: tuple[str, ...] = ()  # by the indices in desired twists
    period: float = 0.0  # time from one cycle to the next [s]
    home: Floats = field(default_factory=lambda: np.zeros(0))  # (n,) [rad or m]
    scene_file: str = ""
    scene_hash: str = ""  # in hex
    ring: str = ""  # path of the ring, on the service's machine
    counters: str = ""  # path of its counters, likewise
    session: int = 0  # number of the service's start
    version: str = ""  # version of armguard that it runs
    watchdogs: Mapping[str, float] = field(default_factory=dict)  # by name [s]
    reasons: Mapping[int, tuple[str, str]] = field(default_factory=dict)  # sentences
    boot_id: str = ""  # identifies the start of its machine
    text: Mapping[str, Any] = field(default_factory=dict)  # all of it as received


# Before a client is connected.
NOTHING = Welcome()


def read_welcome(data: bytes) -> Welcome:
    """The description in the JSON of a WELCOME.

    Raises:
        ValueError: It is no JSON.
        KeyError: A field is missing.
    """
    text = json.loads(data)
    parts = tuple(RobotJoints(**part) for part in text["robots"])
    found: dict[str, Any] = {
        **{name: tuple(text[name]) for name in ("names", "bodies", "tools")},
        "robots": tuple(part.name for part in parts),
        "parts": parts,
        "home": np.array(text["home"], dtype=np.float64),
        "reasons": {int(k): (name, why) for k, (name, why) in text["reasons"].items()},
        "text": text,
    }
    plain = {one.name for one in fields(Welcome)} - found.keys()
    return Welcome(**found, **{name: text[name] for name in plain})
