"""JSON in and out. Numbers of joints always come with the names of the joints."""

import json
import math
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from armguard.respond.command import Held
from armguard.service.client import Answer, Nearest, Welcome

Floats = NDArray[np.float64]


class DroppedError(ValueError):
    """A message that is dropped, and counted under its cause."""

    def __init__(self, cause: str, sentence: str) -> None:
        super().__init__(sentence)
        self.cause = cause


def read(payload: bytes) -> dict[str, Any]:
    """The object in a payload; an empty one if that has no bytes.

    Raises:
        DroppedError: It has something else.
    """
    try:
        found = json.loads(payload or b"{}", parse_constant=no_number)
    except (ValueError, RecursionError) as error:
        if isinstance(error, DroppedError):
            raise
        raise DroppedError("malformed", f"no JSON: {error}") from None
    if not isinstance(found, dict):
        raise DroppedError("malformed", "JSON, but no object")
    return found


def no_number(word: str) -> NoReturn:
    """NaN and infinity, which JSON does not have and Python reads."""
    raise DroppedError("not_finite", f"{word} is no number")


class Joints:
    """Order of the joints in messages; each raises DroppedError, see docs/zenoh.md.

    Args:
        welcome: Description of the service.
    """

    def __init__(self, welcome: Welcome) -> None:
        self._names = welcome.names
        self._tools = frozenset(welcome.tools)
        self._parts = welcome.parts
        self._orders: dict[tuple[str, ...], tuple[list[int], tuple[str, ...]]] = {}

    def state(self, message: Mapping[str, Any]) -> "State":
        """Measurement of a controller."""
        order, robots = self._order(names_in(message, "names"))
        q = vector_in(message, "positions", len(order))[order]
        velocity = None
        if message.get("velocities") is not None:
            velocity = vector_in(message, "velocities", len(order))[order]
        stamp = message.get("stamp")
        at = None if stamp is None else number_of("stamp", stamp)
        return State(robots, q, velocity, at)

    def desired_motion(self, message: Mapping[str, Any], field: str) -> Floats:
        """Velocities or positions of all joints, in the service's order."""
        order, robots = self._order(names_in(message, "names"))
        if len(robots) != len(self._parts):
            raise DroppedError(
                "names", "a desired motion names the joints of all robots"
            )
        return vector_in(message, field, len(order))[order]

    def twists(self, message: Mapping[str, Any]) -> dict[str, Floats]:
        """Twists by tool."""
        tools = names_in(message, "tools")
        rows = message.get("twists")
        if not isinstance(rows, list) or len(rows) != len(tools):
            raise DroppedError("payload", f"twists must be {len(tools)} rows of six")
        if len(set(tools)) != len(tools) or not self._tools.issuperset(tools):
            raise DroppedError("names", f"tools {tools} are not tools of the scene")
        return {
            tool: vector_in({"twists": row}, "twists", 6)
            for tool, row in zip(tools, rows, strict=True)
        }

    def _order(self, names: tuple[str, ...]) -> tuple[list[int], tuple[str, ...]]:
        """Where the joints of whole robots are among names, and which robots."""
        found = self._orders.get(names)
        if found is not None:
            return found
        place = {name: k for k, name in enumerate(names)}
        order: list[int] = []
        robots: list[str] = []
        for part in self._parts:
            own = self._names[part.first : part.first + part.count]
            if place.keys() >= set(own):
                order += [place[name] for name in own]
                robots.append(part.name)
        if not robots or len(order) != len(names) or len(place) != len(names):
            raise DroppedError(
                "names", "names must be all joints of one robot or more, each once"
            )
        # Few orders occur; a sender of ever new ones does not fill the memory.
        if len(self._orders) < len(self._names):
            self._orders[names] = order, tuple(robots)
        return order, tuple(robots)


class State(NamedTuple):
    """Measurement of a controller, its joints in the service's order."""

    robots: tuple[str, ...]
    q: Floats  # positions [rad or m]
    velocity: Floats | None  # [rad/s or m/s]
    stamp: float | None  # on the service's clock; None for now [s]


def names_in(message: Mapping[str, Any], field: str) -> tuple[str, ...]:
    """A list of names."""
    found = message.get(field)
    if not isinstance(found, list) or not all(isinstance(x, str) for x in found):
        raise DroppedError("payload", f"'{field}' must be a list of names")
    return tuple(found)


def vector_in(message: Mapping[str, Any], field: str, count: int) -> Floats:
    """So many finite numbers."""
    found = message.get(field)
    if not isinstance(found, list) or len(found) != count:
        raise DroppedError("payload", f"'{field}' must be a list of {count} numbers")
    return np.array([number_of(field, value) for value in found])


def number_of(field: str, value: Any) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DroppedError("payload", f"'{field}' holds {value!r}, which is no number")
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    if not math.isfinite(found):
        raise DroppedError("not_finite", f"'{field}' holds {found}")
    return found


# Fields of a verdict: attributes of an answer.
VERDICT = (
    *("cycle", "time", "level", "levels", "cause", "reason", "sentence", "headroom"),
    *("time_left", "nearest", "urgency", "speed_scale", "blocked", "stopped_by"),
    *("held", "ages"),
)


def command_of(
    answer: Answer, source: Callable[[int, int], dict[str, Any] | None]
) -> dict[str, Any]:
    """The command of an answer.

    Args:
        answer: Answer of the service, or of the client in its place.
        source: The sender and number over Zenoh of a state, from those at the service.
    """
    rows = zip(answer.welcome.robots, answer.numbers, strict=True)
    return {
        "cycle": answer.cycle,
        "time": answer.time,
        "began_by": source(*answer.began),
        "states": {name: source(row.sender, row.sequence) for name, row in rows},
        "names": answer.welcome.names,
        "velocities": plain(answer.velocity),
        # A service that has seen no state yet does not know where joints are.
        "positions": plain(answer.position),
        "action": plain(answer.action),
        "actions": plain(answer.actions),
        "stop": answer.stops,
        "cause": plain(answer.cause),
        "reason": plain(answer.reason),
    }


def verdict_of(answer: Answer) -> dict[str, Any]:
    """The verdict of an answer, and its reasons."""
    return {name: plain(getattr(answer, name)) for name in VERDICT}


def plain(value: Any) -> Any:
    """A value as JSON has it: names of enumerations; None for NaN and infinity."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, np.ndarray):
        return [plain(number) for number in value.tolist()]
    if isinstance(value, Held):
        value = {name: getattr(value, name) for name in ("cause", "remedy", "since")}
    elif isinstance(value, Nearest):
        value = {name: getattr(value, name) for name in value.__slots__}
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    return value
