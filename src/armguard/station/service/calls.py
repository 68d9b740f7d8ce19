"""What may be called between two cycles, by name, with arguments in JSON."""

import json
import time
from collections.abc import Callable
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from armguard.errors import ArmguardError, UnknownNameError, did_you_mean
from armguard.station.calls import (
    CALLS,
    Call,
    Configure,
    Engage,
    GuardCall,
    ListObjects,
    OrderStop,
    Ping,
    Place,
    Remove,
    Reset,
    Why,
)
from armguard.station.errors import RefusedError
from armguard.station.service.hub import Hub
from armguard.station.service.objects import Objects
from armguard.station.service.peers import Peer
from armguard.station.wire.keys import Role
from armguard.station.wire.words import Cause


class Request(BaseModel):
    """A call that was read.

    Attributes:
        number: What the sender numbered it with; the same one is not done twice.
        call: Its name.
        arguments: Its arguments by name.
    """

    model_config = ConfigDict(strict=True)

    number: int = Field(alias="id")
    call: str
    arguments: dict[str, Any] = {}


def read_call(payload: bytes) -> Request | None:
    """The call in a payload; None if it is none."""
    try:
        return Request.model_validate(json.loads(payload))
    except (ValueError, RecursionError):
        return None


class Calls:
    """Does what is called for.

    Args:
        hub: What all parts of the loop share.
        adopt_scene: Takes over what follows from the scene as it is now; given the
            time, monotonic [ns].
    """

    def __init__(self, hub: Hub, adopt_scene: Callable[[int], None]) -> None:
        self._hub, self._objects = hub, Objects(hub)
        self._adopt_scene = adopt_scene

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
            result = self._answer(permitted(request, peer.role, commands), peer)
            return True, json.dumps({"ok": True, "result": result}).encode()
        except Exception as error:  # whatever it is, the loop goes on
            reply = {"ok": False, "error": type(error).__name__, "sentence": str(error)}
            reason = getattr(error, "reason", "")
            if reason:
                reply["reason"] = reason
            return False, json.dumps(reply).encode()

    def _answer(self, call: Call, peer: Peer) -> Any:
        """What a call gives back.

        Raises:
            ArmguardError: It is refused.
        """
        hub, judge = self._hub, self._hub.judge
        match call:
            case Place():
                return self._objects.place(peer, call)
            case Remove():
                return self._objects.remove(peer, call)
            case Reset() if not judge.at_rest(hub.states):
                raise RefusedError("a reset is for when every robot rests")
            case GuardCall():
                judge.do(call)
                if isinstance(call, Engage) and call.ordered:
                    hub.ordered = Cause.NONE
                return None
            case Configure():
                changed = judge.configure(hub.states, call.response, call.mode)
                self._adopt_scene(time.monotonic_ns())
                return changed
            case ListObjects():
                return judge.objects(call.first)
            case Why():
                return judge.why()
            case OrderStop():
                return hub.order_stop(peer.name)
            case Ping():
                return {"cycle": judge.guard.cycle}
        raise NotImplementedError(call.call)


def permitted(request: Request, role: Role, commands: bool) -> Call:
    """The call that was read, if its sender may make it.

    Args:
        request: What is called for.
        role: Its sender's role.
        commands: Whether its sender has the command.

    Raises:
        RefusedError: Its sender may not, or it takes other arguments.
        UnknownNameError: There is no such call.
        ArmguardError: An argument cannot be.
    """
    name = request.call
    made = CALLS.get(name)
    if made is None:
        raise UnknownNameError(
            f"there is no call '{name}'; {did_you_mean(name, CALLS)}"
        )
    if role < made.right:
        raise RefusedError(
            f"'{name}' needs the key for '{made.right.word}'; this client has the one "
            f"for '{role.word}'"
        )
    if made.right >= Role.COMMAND and not commands:
        raise RefusedError(f"'{name}' is for the commander; claim the command first")
    try:
        return made.model_validate(request.arguments)
    except ValidationError as error:
        found = error.errors(include_url=False)[0]
        why = found.get("ctx", {}).get("error")
        if isinstance(why, ArmguardError):
            raise why from None
        where = ".".join(map(str, found["loc"]))
        takes = ", ".join(made.model_fields) or "nothing"
        raise RefusedError(
            f"call '{name}' takes {takes}; {where}: {found['msg']}"
        ) from None


def refusal(sentence: str) -> bytes:
    """The reply that says why something was not done."""
    reply = {"ok": False, "error": RefusedError.__name__, "sentence": sentence}
    return json.dumps(reply).encode()
