"""Calls between two cycles: the right that each needs, and what it does."""

import json
import logging
import time
from collections.abc import Callable
from reprlib import repr as brief
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from armguard.errors import ArmguardError, RefusedError, UnknownNameError, did_you_mean
from armguard.guard.contract import expiry_remark
from armguard.guard.levels import Reason
from armguard.recording.calls import (
    CALLS,
    Allow,
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
from armguard.scene.objects import placement_remark
from armguard.service.server.context import Context
from armguard.service.server.peers import Peer
from armguard.service.wire import Cause, Role

log = logging.getLogger("armguard.service")

# Answers say for that long that objects were changed [ns].
SHOWN = 1_000_000_000

# How far a stamp may be ahead of the service's clock, which senders on other machines
# know to half a round trip [ns].
AHEAD = 20_000_000


class Request(BaseModel):
    """A call that was read."""

    model_config = ConfigDict(strict=True)

    number: int = Field(alias="id")  # the same one of a sender is not done twice
    call: str
    arguments: dict[str, Any] = {}


def read_call(payload: bytes) -> Request | None:
    """The call in a payload; None if it is none."""
    try:
        return Request.model_validate(json.loads(payload))
    except (ValueError, RecursionError):
        return None


class Calls:
    """Makes the calls of clients.

    Objects that the scene calls movable belong to the client that placed or removed
    them last, as long as a client of that name is connected. All others are fixtures.

    Args:
        context: State that all parts of the loop share.
        adopt_scene: Takes over what follows from the scene as it is now; given the
            time, monotonic [ns].
    """

    def __init__(self, context: Context, adopt_scene: Callable[[int], None]) -> None:
        self._context, self._adopt_scene = context, adopt_scene
        # Name of the client that placed or removed an object last.
        self._owner: dict[str, str] = {}
        objects = context.judge.scene.objects
        self._present = {name for name, one in objects.items() if one.present}

    def do(self, request: Request, peer: Peer, commands: bool) -> tuple[bool, bytes]:
        """Do it, if its sender may.

        Args:
            request: The call.
            peer: The client that calls.
            commands: Whether it has the command.

        Returns:
            Whether it was done, and the reply.
        """
        try:
            call = permitted(request, peer.role, commands)
            reply = {"ok": True, "result": self._answer(call, peer)}
            if remark := self._remark_on(call):
                reply["remark"] = remark
            return True, json.dumps(reply).encode()
        except Exception as error:  # whatever it is, the loop goes on
            return False, refusal(error)

    def _answer(self, call: Call, peer: Peer) -> Any:
        """What a call gives back.

        Raises:
            ArmguardError: It is refused.
        """
        context, judge = self._context, self._context.judge
        match call:
            case Place():
                return self._place(peer, call)
            case Remove():
                return self._remove(peer, call)
            case Reset() if not judge.at_rest():
                raise RefusedError("a reset is for when every robot rests")
            case Engage() if call.ordered and context.reflex:
                assert context.pulses is not None
                raise RefusedError(
                    f"{context.pulses.sentence}; only `armguard reset` lifts its stop",
                    reason=context.reflex.name,
                )
            case GuardCall():
                judge.do(call)
                if isinstance(call, Engage) and call.ordered:
                    context.ordered = Cause.NONE
                return None
            case Configure():
                changed = judge.configure(call.response, call.mode)
                self._adopt_scene(time.monotonic_ns())
                return changed
            case ListObjects():
                return judge.objects(call.first)
            case Why():
                found = judge.why()
                if context.pulses is not None:
                    found["reflex"] = context.pulses.sentence
                return found
            case OrderStop():
                return context.order_stop(peer.name)
            case Ping():
                return {"cycle": judge.guard.cycle}
        raise NotImplementedError(call.call)

    def _remark_on(self, call: Call) -> str:
        """A sentence if a call that was done looks like a mistake, else ""."""
        now = time.monotonic()
        match call:
            case Place() if call.pose is not None:
                found = self._context.judge.scene.objects[call.name]
                return placement_remark(call.name, call.pose, call.shape) or (
                    age_remark(call.name, call.stamp, now, found.stale)
                )
            case Allow() if call.until is not None:
                return expiry_remark(call.a, call.b, call.until, now)
        return ""

    def _place(self, peer: Peer, call: Place) -> None:
        """Place an object.

        Raises:
            RefusedError: The client may not.
        """
        name, stamp, now = call.name, call.stamp, time.monotonic()
        self._check(peer, name)
        if stamp is not None and stamp > now + AHEAD * 1e-9:
            raise RefusedError(
                f"'{name}' was seen at {stamp:.3f} s, which is ahead of the service's "
                f"clock; give seconds of that clock, see Client.clock",
                reason=Reason.OBJECT_AHEAD.name,
            )
        if stamp is not None and stamp > now:
            # Its sender knows the clock no better; the next cycle is later than now.
            call = call.model_copy(update={"stamp": now})
        judge = self._context.judge
        routine = (
            self._owner.get(name) == peer.name
            and judge.scene.objects[name].top_speed > 0.0
            and name in self._present
            and call.shape is None
        )
        judge.do(call)
        self._owner[name] = peer.name
        self._present.add(name)
        if not routine:
            self._announce(peer, name, "placed")

    def _remove(self, peer: Peer, call: Remove) -> None:
        """Remove an object.

        Raises:
            RefusedError: The client may not.
        """
        name = call.name
        self._check(peer, name)
        self._context.judge.do(call)
        self._owner[name] = peer.name
        self._present.discard(name)
        self._announce(peer, name, "removed")

    def _check(self, peer: Peer, name: str) -> None:
        """Refuse what a client may not change.

        Raises:
            RefusedError: It may not.
        """
        context, administers = self._context, peer.role >= Role.ADMINISTER
        found = context.judge.scene.objects.get(name)
        if found is None or (administers and found.movable):
            return
        if not found.movable:
            if not administers:
                raise RefusedError(
                    f"'{name}' is a fixture: the scene gives it no top_speed, and it "
                    "is present from the start; changing it needs the key for "
                    "'administer'"
                )
            if not context.judge.at_rest():
                raise RefusedError(
                    f"'{name}' is a fixture; it changes only while every robot rests"
                )
            return
        owner = self._owner.get(name, peer.name)
        if owner != peer.name and context.peers.names(owner):
            raise RefusedError(
                f"'{name}' belongs to client '{owner}', which is connected; that one "
                "changes it, or the key for 'administer' does"
            )

    def _announce(self, peer: Peer, name: str, done: str) -> None:
        """Log and record that an object was changed, and have answers say so."""
        self._context.changed = time.monotonic_ns() + SHOWN
        self._context.judge.note("object", name=name, done=done, by=peer.name)
        log.warning("object '%s' was %s by client '%s'", name, done, peer.name)


def permitted(request: Request, role: Role, commands: bool) -> Call:
    """The call that was read, if its sender may make it.

    Args:
        request: The call.
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
        raise wrong_argument(made, error) from None


def age_remark(name: str, stamp: float | None, now: float, stale: float | None) -> str:
    """Sentence that a sighting was too old when it came, else "".

    Args:
        name: Name of the object.
        stamp: When it was seen [s].
        now: The present, on the same clock [s].
        stale: Age from which on sightings of it are refused; None for no limit [s].
    """
    if stamp is None or stale is None or now - stamp <= stale:
        return ""
    return (
        f"object '{name}' was seen {now - stamp:.3f} s ago, and its stale is {stale:g} "
        "s: cycles stop; give the stamp of a newer sighting, see Client.clock"
    )


def wrong_argument(made: type[Call], error: ValidationError) -> ArmguardError:
    """The error of a call with other arguments than it takes."""
    found = error.errors(include_url=False)[0]
    why = found.get("ctx", {}).get("error")
    if isinstance(why, ArmguardError):
        return why
    where = found["loc"][0]
    if found["type"] == "missing":
        fault = f"'{where}' is missing"
    elif found["type"] == "extra_forbidden":
        fault = f"there is no argument '{where}'"
    else:
        must = str(why) if why else found["msg"].replace("Input should", "it must")
        fault = f"{where} is {brief(found['input'])}; {must}"
    takes = ", ".join(made.model_fields) or "nothing"
    return RefusedError(f"{fault}; call '{made.call}' takes {takes}")


def refusal(error: Exception) -> bytes:
    """The reply that says why a call was not done."""
    reply = {"ok": False, "error": type(error).__name__, "sentence": str(error)}
    if reason := getattr(error, "reason", ""):
        reply["reason"] = reason
    return json.dumps(reply).encode()
