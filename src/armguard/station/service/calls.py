"""What may be called between two cycles, by name, with arguments in JSON."""

import inspect
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from armguard.errors import UnknownNameError, did_you_mean
from armguard.geometry.pose import Pose
from armguard.guard.contract import Region
from armguard.station.errors import RefusedError
from armguard.station.service.peers import Peer
from armguard.station.wire.keys import Role

# The role each call needs. From COMMAND on it needs the command itself as well.
NEEDS: Mapping[str, Role] = {
    "why": Role.OBSERVE,
    "objects": Role.OBSERVE,
    "stop": Role.OBSERVE,
    "ping": Role.OBSERVE,
    "place": Role.SENSE,
    "remove": Role.SENSE,
    "engage": Role.COMMAND,
    "grasp": Role.COMMAND,
    "release": Role.COMMAND,
    "allow": Role.COMMAND,
    "swap_model": Role.COMMAND,
    "retreat": Role.COMMAND,
    "field_goal": Role.COMMAND,
    "reset": Role.COMMAND,
    "configure": Role.ADMINISTER,
}


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
        doors: What each name stands for; each is given the client that calls first.
    """

    def __init__(self, doors: Mapping[str, Callable[..., Any]]) -> None:
        self._doors = doors

    def do(self, request: Request, peer: Peer, commands: bool) -> tuple[bool, bytes]:
        """Do it, if its sender may.

        Args:
            request: What is called for.
            peer: The client that calls.
            commands: Whether it has the command.

        Returns:
            Whether it was done, and the reply.
        """
        try:
            result = self._answer(request, peer, commands)
            return True, json.dumps({"ok": True, "result": result}).encode()
        except Exception as error:  # whatever it is, the loop goes on
            reply = {"ok": False, "error": type(error).__name__, "sentence": str(error)}
            reason = getattr(error, "reason", "")
            if reason:
                reply["reason"] = reason
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
        role = NEEDS.get(call, Role.ADMINISTER)
        if peer.role < role:
            raise RefusedError(
                f"'{call}' needs the key for '{role.word}'; this client has the one "
                f"for '{peer.role.word}'"
            )
        if role >= Role.COMMAND and not commands:
            raise RefusedError(
                f"'{call}' is for the commander; claim the command first"
            )
        own = partial(door, peer)
        form = inspect.signature(own)
        try:
            form.bind(**request.arguments)
        except TypeError as error:
            raise RefusedError(f"call '{call}{form}': {error}") from None
        return own(**request.arguments)


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
