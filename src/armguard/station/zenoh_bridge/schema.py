"""JSON in and out. Numbers of joints always come with the names of the joints."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from armguard.station.client import Answer, Welcome

Floats = NDArray[np.float64]


class DroppedError(ValueError):
    """A message that is dropped.

    Attributes:
        cause: Under what it is counted.
    """

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
    """Which joint is where.

    Args:
        welcome: What the service told about itself.
    """

    def __init__(self, welcome: Welcome) -> None:
        self._names = welcome.names
        self._tools = frozenset(welcome.tools)
        self._parts = welcome.parts
        self._orders: dict[tuple[str, ...], tuple[list[int], tuple[str, ...]]] = {}

    def state(self, message: Mapping[str, Any]) -> "State":
        """What a controller measured.

        Raises:
            DroppedError: It is not what docs/zenoh.md says.
        """
        order, robots = self._order(names_in(message, "names"))
        q = vector_in(message, "positions", len(order))[order]
        velocity = None
        if message.get("velocities") is not None:
            velocity = vector_in(message, "velocities", len(order))[order]
        stamp = message.get("stamp")
        return State(
            robots,
            q,
            velocity,
            None if stamp is None else number_of("stamp", stamp),
        )

    def wish(self, message: Mapping[str, Any], field: str) -> Floats:
        """Velocities or positions of all joints, in the service's order.

        Raises:
            DroppedError: It is not what docs/zenoh.md says.
        """
        order, robots = self._order(names_in(message, "names"))
        if len(robots) != len(self._parts):
            raise DroppedError("names", "a wish names the joints of all robots")
        return vector_in(message, field, len(order))[order]

    def twists(self, message: Mapping[str, Any]) -> dict[str, Floats]:
        """Twists by tool.

        Raises:
            DroppedError: It is not what docs/zenoh.md says.
        """
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
        # Few orders occur; who makes up ever new ones does not fill the memory.
        if len(self._orders) < len(self._names):
            self._orders[names] = order, tuple(robots)
        return order, tuple(robots)


class State(NamedTuple):
    """What a controller measured.

    Attributes:
        robots: Of which robots.
        q: Their positions in the service's order [rad or m].
        velocity: Their velocities, None if there are none.
        stamp: When, on the service's clock; None for now [s].
    """

    robots: tuple[str, ...]
    q: Floats
    velocity: Floats | None
    stamp: float | None


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


def command_of(
    answer: Answer, source: Callable[[int, int], dict[str, Any] | None]
) -> dict[str, Any]:
    """What robots are told.

    Args:
        answer: What the service, or the client in its place, told.
        source: The sender and number over Zenoh of a state, from those at the service.
    """
    return {
        "cycle": answer.cycle,
        "time": answer.time,
        "began_by": source(*answer.began),
        "states": {
            name: source(row.sender, row.sequence)
            for name, row in zip(answer.welcome.robots, answer.numbers, strict=True)
        },
        "names": list(answer.welcome.names),
        "velocities": [finite(v) for v in answer.velocity.tolist()],
        # A service that has seen no state yet does not know where joints are.
        "positions": [finite(x) for x in answer.position.tolist()],
        "action": answer.action.name,
        "actions": {name: action.name for name, action in answer.actions.items()},
        "stop": answer.stops,
        "cause": answer.cause.name,
        "reason": answer.reason.name,
    }


def verdict_of(answer: Answer) -> dict[str, Any]:
    """What was judged, and why."""
    near = answer.nearest
    return {
        "cycle": answer.cycle,
        "time": answer.time,
        "level": answer.level.name,
        "levels": {name: level.name for name, level in answer.levels.items()},
        "cause": answer.cause.name,
        "reason": answer.reason.name,
        "sentence": answer.sentence,
        "slack": finite(answer.slack),
        "slack_time": finite(answer.slack_time),
        "nearest": near
        and {
            "a": near.a,
            "b": near.b,
            "distance": finite(near.distance),
            "clearance": finite(near.clearance),
            "point_a": near.point_a.tolist(),
            "point_b": near.point_b.tolist(),
        },
        "urgency": {name: finite(x) for name, x in answer.urgency.items()},
        "speed_scale": {name: finite(x) for name, x in answer.speed_scale.items()},
        "blocked": {name: why.name for name, why in answer.blocked.items()},
        "stopped_by": {name: why.name for name, why in answer.stopped_by.items()},
        "held": {
            name: {"cause": one.cause, "remedy": one.remedy, "since": finite(one.since)}
            for name, one in answer.held.items()
        },
        "ages": {name: finite(age) for name, age in answer.ages.items()},
    }


def finite(value: float) -> float | None:
    """A number; None for what JSON has no word for."""
    return value if math.isfinite(value) else None
