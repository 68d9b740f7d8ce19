"""What may be called between two cycles, by name, with arguments in JSON."""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import singledispatchmethod
from typing import Any

from pydantic import ValidationError

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
        hub: What all parts of the loop share.
        order_stop: Stops all robots; given the name of the client that asked for it.
        adopt_scene: Takes over what follows from the scene as it is now; given the
            time, monotonic [ns].
    """

    def __init__(
        self,
        hub: Hub,
        order_stop: Callable[[str], None],
        adopt_scene: Callable[[int], None],
    ) -> None:
        self._hub, self._objects = hub, Objects(hub)
        self._order_stop, self._adopt_scene = order_stop, adopt_scene

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

    @singledispatchmethod
    def _answer(self, call: Call, peer: Peer) -> Any:
        """What a call gives back; one of the guard alone, nothing.

        Raises:
            ArmguardError: It is refused.
        """
        raise NotImplementedError(call.call)

    @_answer.register
    def _guard(self, call: GuardCall, peer: Peer) -> None:
        self._hub.judge.do(call)

    @_answer.register
    def _engage(self, call: Engage, peer: Peer) -> None:
        self._hub.judge.do(call)
        if call.ordered:
            self._hub.ordered = Cause.NONE

    @_answer.register
    def _reset(self, call: Reset, peer: Peer) -> None:
        judge = self._hub.judge
        if not judge.at_rest(self._hub.states):
            raise RefusedError("a reset is for when every robot rests")
        judge.do(call)

    @_answer.register
    def _place(self, call: Place, peer: Peer) -> None:
        self._objects.place(peer, call)

    @_answer.register
    def _remove(self, call: Remove, peer: Peer) -> None:
        self._objects.remove(peer, call)

    @_answer.register
    def _configure(self, call: Configure, peer: Peer) -> dict[str, Any]:
        states = self._hub.states
        changed = self._hub.judge.configure(states, call.response, call.mode)
        self._adopt_scene(time.monotonic_ns())
        return changed

    @_answer.register
    def _objects_placed(self, call: ListObjects, peer: Peer) -> dict[str, Any]:
        return self._hub.judge.objects(call.first)

    @_answer.register
    def _why(self, call: Why, peer: Peer) -> dict[str, Any]:
        return self._hub.judge.why()

    @_answer.register
    def _stop(self, call: OrderStop, peer: Peer) -> None:
        self._order_stop(peer.name)

    @_answer.register
    def _ping(self, call: Ping, peer: Peer) -> dict[str, int]:
        return {"cycle": self._hub.judge.guard.cycle}


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
