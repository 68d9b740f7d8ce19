"""What may be called between two cycles, by name, with arguments in JSON."""

import inspect
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from armguard.errors import UnknownNameError, did_you_mean
from armguard.geometry.pose import Pose
from armguard.guard.contract import Region
from armguard.station.errors import RefusedError
from armguard.station.service.peers import Peer
from armguard.station.wire.words import OF_COMMANDER, OF_SENSORS


@dataclass(frozen=True, slots=True)
class Request:
    """A call that was read.

    Attributes:
        number: What the sender numbered it with; the same one is not done twice.
        call: Its name.
        arguments: Its arguments by name.
    """

    number: int
    call: str
    arguments: Mapping[str, Any]


def read_call(payload: bytes) -> Request | None:
    """The call in a payload; None if it is none."""
    try:
        found = json.loads(payload)
        number, call = found["id"], found["call"]
        arguments = found.get("arguments", {})
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    whole = isinstance(number, int) and isinstance(call, str)
    if not whole or not isinstance(arguments, dict):
        return None
    return Request(number, call, arguments)


class Calls:
    """Does what is called for.

    Args:
        doors: What each name stands for.
    """

    def __init__(self, doors: Mapping[str, Callable[..., Any]]) -> None:
        self._doors = doors

    def do(self, request: Request, peer: Peer, commands: bool) -> tuple[bool, bytes]:
        """Do it, if its sender may.

        Args:
            request: What is called for.
            peer: Who calls.
            commands: Whether he has the command.

        Returns:
            Whether it was done, and the reply.
        """
        try:
            result = self._answer(request, peer, commands)
            return True, json.dumps({"ok": True, "result": result}).encode()
        except Exception as error:  # whatever it is, the loop goes on
            reply = {"ok": False, "error": type(error).__name__, "sentence": str(error)}
            return False, json.dumps(reply).encode()

    def _answer(self, request: Request, peer: Peer, commands: bool) -> Any:
        """What a call gives back.

        Raises:
            RefusedError: Its sender may not call it, or its arguments are others.
            UnknownNameError: There is no such call.
        """
        call = request.call
        door = self._doors.get(call)
        if door is None:
            raise UnknownNameError(
                f"there is no call '{call}'; {did_you_mean(call, self._doors)}"
            )
        if call in OF_COMMANDER and not commands:
            raise RefusedError(f"'{call}' is for who commands; claim the command first")
        if call in OF_SENSORS and not (commands or peer.sensor):
            raise RefusedError(
                f"'{call}' is for sensors and who commands; say hello as a sensor"
            )
        form = inspect.signature(door)
        try:
            form.bind(**request.arguments)
        except TypeError as error:
            raise RefusedError(f"call '{call}{form}': {error}") from None
        return door(**request.arguments)


def refusal(sentence: str) -> bytes:
    """The reply that says why something was not done."""
    reply = {"ok": False, "error": RefusedError.__name__, "sentence": sentence}
    return json.dumps(reply).encode()


def region_of(value: Mapping[str, Any] | None) -> Region | None:
    """The region of a contract, from what a message holds."""
    if value is None:
        return None
    pose = Pose.from_matrix(np.array(value["pose"])) if "pose" in value else Pose()
    x, y, z = value["half_extents"]
    return Region(half_extents=(x, y, z), pose=pose, frame=value.get("frame"))
