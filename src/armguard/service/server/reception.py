"""Messages that were let in: what each of them does, and what answers a HELLO."""

import json
import logging
import time
from collections.abc import Callable, Iterator
from typing import Any

from armguard.errors import RefusedError
from armguard.guard.levels import Level, Reason
from armguard.recording.counters import DROPS
from armguard.scene.tables import SceneTables
from armguard.service.desk.desk import OUTCOMES
from armguard.service.desk.making import bodies_of
from armguard.service.desk.taking import take_desired_motion, take_state
from armguard.service.server.context import Context
from armguard.service.server.cycles import NANO, Cycles
from armguard.service.server.dropped import sentence_of_drop
from armguard.service.server.judge import tools_of
from armguard.service.server.mapped import MappedCells
from armguard.service.server.peers import Address, Peer
from armguard.service.server.rpc import AHEAD, Calls, read_call, refusal
from armguard.service.server.settings import ServiceSettings
from armguard.service.wire import Cause, Kind, Role
from armguard.service.wire.boot import boot_id
from armguard.service.wire.layout import (
    CHALLENGE,
    CLAIM,
    GIVE_BACK,
    GRANT,
    HEADER,
    HELLO,
    LEAST,
    MOST,
    PART,
    REPLY,
    SEAL,
    VERSION,
    WELCOME,
)

# The answer to a call has to fit into a message [bytes].
LONGEST_REPLY = MOST - LEAST - REPLY.size

# HELLOs that are answered from one heartbeat to the next.
MOST_HELLOS = 256

WATCHDOGS = ("wish", "commander", "controller")


class Reception:
    """Reads messages, one at a time.

    Args:
        context: State that all parts of the loop share.
        cycles: Cycles that states begin.
        calls: Done on request.
        mapped: Takes the changes of the map.
        buffer: Where messages are received; the desk looks at the same bytes.
    """

    def __init__(
        self, context: Context, cycles: Cycles, calls: Calls, mapped: MappedCells,
        buffer: bytearray,
    ) -> None:  # fmt: skip
        self._context, self._cycles, self._calls = context, cycles, calls
        self._buffer, self._message = buffer, memoryview(buffer)
        self._arrival = arrival = context.judge.arrival
        settings = context.settings
        arrival.watchdog = int(settings.controller_watchdog * NANO)
        self._call_limit = int(settings.commander_watchdog * NANO)
        self._hellos_left = MOST_HELLOS
        # Why the last desired motion does not count because of its age.
        self._age = ""
        # What each kind of message does, and the size of its payload if it is fixed.
        self._kinds: dict[int, Callable[[Peer, memoryview, int], str]] = {
            Kind.STATE: self._take_state,
            Kind.WISH: self._take_desired_motion,
            Kind.HEARTBEAT: self._take_nothing,
            Kind.CLAIM: self._take_claim,
            Kind.GIVE_BACK: self._take_give_back,
            Kind.CALL: self._take_call,
            Kind.STOP: self._take_stop,
            Kind.BYE: self._take_bye,
            Kind.CELLS: mapped.take_cells,
            Kind.HEALTH: mapped.take_health,
        }
        self._sizes: dict[int, int] = {
            Kind.HEARTBEAT: LEAST,
            Kind.CLAIM: LEAST + CLAIM.size,
            Kind.GIVE_BACK: LEAST + GIVE_BACK.size,
        }

    def read(self) -> bool:
        """Take one message over; False if there was none. Raises nothing."""
        context = self._context
        found = context.sockets.receive(self._buffer, context.log)
        if found is None:
            return False
        size, address = found
        if size < 0:
            return True
        now = time.monotonic_ns()
        count, log, check = context.counters.count, context.log, context.authenticator
        count("received")
        message = self._message[:size]
        peer = None
        try:
            peer = check.admit(message, address, now)
            drop, kind = check.drop, check.head.kind
            if not drop and kind == Kind.HELLO:
                drop = self._take_hello(peer, message, address, now)
            elif not drop and peer is not None:
                fits = self._sizes.get(kind, size) == size
                drop = self._kinds[kind](peer, message, now) if fits else "payload"
        except Exception as error:  # no message of a client may end the loop
            drop = "payload"
            log.report("message", f"{type(error).__name__}: {error}", now)
        if drop:
            count(f"dropped_{drop}")
            tables = context.judge.guard.guard.tables
            says = sentence_of_drop(drop, check.head.kind, message, tables)
            log.report(drop, f"{says}, from {address}", now)
            if peer is not None:
                context.refuse(peer, drop, says, now)
        else:
            count("accepted")
        return True

    def renew(self) -> None:
        """Answer as many HELLOs again until the next heartbeat."""
        self._hellos_left = MOST_HELLOS

    def _take_hello(
        self, peer: Peer | None, message: memoryview, address: Address, now: int
    ) -> str:
        """Answer a HELLO: a new client's first one with a cookie, others in full."""
        payload = message[HEADER.size : -SEAL]
        if len(payload) < HELLO.size:
            return "payload"
        if self._hellos_left <= 0:
            return "busy"
        self._hellos_left -= 1
        hello = HELLO.unpack_from(payload)
        context, check = self._context, self._context.authenticator
        head, peers = check.head, context.peers
        if peer is None:
            assert check.seal is not None
            name = bytes(payload[HELLO.size : HELLO.size + 64]).decode(errors="replace")
            role = Role(hello.role)
            new = Peer(head.sender, name, role, check.seal, address, head.sequence, now)
            if not check.opened:
                cookie = check.cookies.give(new.sender, address)
                challenge = CHALLENGE.pack(head.stamp, cookie)
                context.send(context.outbox.message(Kind.CHALLENGE, challenge), new)
                return ""
            if not check.cookies.take(hello.cookie, new.sender, address):
                return "challenge"
            if peers.full(role):
                full = "too_many_senders"
                context.refuse(new, full, DROPS[full], now)
                return "too_many_senders"
            peer = new
            peers.greet(peer)
            sentence = (
                f"client '{name}' at {address[0]}:{address[1]} has connected; its key "
                f"is for '{role.word}'"
            )
            context.log.report("hello", sentence, now, logging.INFO)
        peer.every = hello.every
        context.counters.count("hellos")
        send_welcome(context, peer, head.stamp, now)
        return ""

    def _take_state(self, peer: Peer, message: memoryview, now: int) -> str:
        """Take over measured joints, and the desired motion that may follow them."""
        context = self._context
        judge = context.judge
        self._hand_over(peer, message, now)
        drop = take_state(judge.lines)
        if drop:
            return OUTCOMES[drop]
        if not peer.controls:
            peer.controls = True
            context.sockets.open_own(peer.address)
        judge.look()
        context.counters.count("states")
        self._cycles.begin_with(peer, context.authenticator.head.sequence, now)
        if not judge.complete:
            holder = context.command.sender
            stop = context.answers.write_stop(0, Cause.WAITING, now, holder)
            context.send(stop, peer)
        if self._arrival.has_desired:
            return self._note_outcome(self._arrival.desired_outcome, now)
        return ""

    def _take_desired_motion(self, peer: Peer, message: memoryview, now: int) -> str:
        """Take the desired motion over."""
        self._hand_over(peer, message, now)
        return self._note_outcome(take_desired_motion(self._context.judge.lines), now)

    def _hand_over(self, peer: Peer, message: memoryview, now: int) -> None:
        """Describe on the desk the message that is there."""
        context, arrival = self._context, self._arrival
        command = context.command
        arrival.length, arrival.now = len(message), now
        arrival.sender = peer.sender
        arrival.sequence = context.authenticator.head.sequence
        # Token 0 fits none: a desired motion too old or from the future does not count.
        self._age = self._age_of(now, command.watchdog, "wish_late")
        owns = peer.sender == command.sender and not self._age
        arrival.token = command.token if owns else 0

    def _note_outcome(self, outcome: int, now: int) -> str:
        """Note what came of a desired motion; why it was dropped, "" if it counts."""
        context, drop = self._context, OUTCOMES[outcome]
        if not drop:
            context.command.heard = min(now, context.authenticator.head.stamp)
            context.counters.count("wishes")
        elif drop == "wish_not_finite":
            # A desired motion that is not finite requests none.
            context.command.heard = 0
        elif drop == "not_commander" and self._age:
            return self._age
        return drop

    def _age_of(self, now: int, limit: int, late: str) -> str:
        """Why the message that was let in last is too old, or from the future."""
        age = now - self._context.authenticator.head.stamp
        if age > limit:
            return late
        return "ahead" if age < -AHEAD else ""

    def _take_nothing(self, peer: Peer, message: memoryview, now: int) -> str:
        """A client is alive, which is noted already."""
        return ""

    def _take_claim(self, peer: Peer, message: memoryview, now: int) -> str:
        """Grant the command, or say that another client has it."""
        if drop := self._age_of(now, self._call_limit, "call_late"):
            return drop
        force = bool(CLAIM.unpack_from(message, HEADER.size).force)
        context = self._context
        command, before = context.command, context.command.sender
        granted = command.claim(peer.sender, force and peer.role >= Role.ADMINISTER)
        context.counters.count("claims" if granted else "claims_refused")
        if granted and before != peer.sender:
            context.judge.note(
                "commander", sender=peer.sender, name=peer.name, before=before
            )
        grant = GRANT.pack(
            granted=granted,
            reserved=0,
            token=command.token if granted else 0,
            holder=command.sender,
            watchdog=context.settings.commander_watchdog,
            sequence=context.authenticator.head.sequence,
        )
        context.send(context.outbox.message(Kind.GRANT, grant), peer)
        return ""

    def _take_give_back(self, peer: Peer, message: memoryview, now: int) -> str:
        """Take the command back from its holder."""
        token = GIVE_BACK.unpack_from(message, HEADER.size).token
        command = self._context.command
        if peer.sender != command.sender or token != command.token:
            return "not_commander"
        self._context.lose_command("given back")
        return ""

    def _take_call(self, peer: Peer, message: memoryview, now: int) -> str:
        """Do a call, and reply."""
        context, sequence = self._context, self._context.authenticator.head.sequence
        if peer.calls_left <= 0:
            return "busy"
        peer.calls_left -= 1
        if drop := self._age_of(now, self._call_limit, "call_late"):
            return drop
        request = read_call(bytes(message[HEADER.size : -SEAL]))
        if request is None:
            return "call_unreadable"
        context.counters.count("calls")
        if peer.last_call is not None and peer.last_call[0] == request.number:
            reply = peer.last_call[1]
        else:
            commands = peer.sender == context.command.sender
            done, reply = self._calls.do(request, peer, commands)
            if len(reply) > LONGEST_REPLY:
                long = RefusedError(f"the answer of '{request.call}' is too long")
                done, reply = False, refusal(long)
            if not done:
                context.counters.count("calls_refused")
            peer.last_call = request.number, reply
        message = context.outbox.message(Kind.REPLY, REPLY.pack(sequence), reply)
        context.send(message, peer)
        return ""

    def _take_stop(self, peer: Peer, message: memoryview, now: int) -> str:
        """Stop all robots, which every client may order."""
        self._context.order_stop(peer.name)
        return ""

    def _take_bye(self, peer: Peer, message: memoryview, now: int) -> str:
        """Let a client go."""
        context = self._context
        context.peers.leave(peer)
        context.sockets.close_own(peer.address)
        context.judge.release(peer.sender)
        if peer.sender == context.command.sender:
            context.lose_command("said good-bye")
        return ""


def welcome_parts(
    tables: SceneTables, settings: ServiceSettings, **more: Any
) -> Iterator[bytes]:
    """Parts of the JSON of a WELCOME, each of which fits into a message.

    Home is in the first part.
    """
    watchdogs = {name: getattr(settings, f"{name}_watchdog") for name in WATCHDOGS}
    robots = [
        {"name": part.name, "first": part.first_joint, "count": part.joint_count}
        for part in tables.robots
    ]
    reasons = {str(int(k)): [k.name, k.sentence] for k in Reason}
    text = {
        "home": tables.home.tolist(),
        "names": list(tables.q_names),
        "robots": robots,
        "period": tables.period,
        "late": tables.late,
        "stale": settings.stale,
        "bodies": list(bodies_of(tables)),
        "tools": list(tools_of(tables)),
        "watchdogs": {
            **watchdogs,
            "forget": settings.forget,
            "heartbeat": settings.heartbeat,
        },
        "levels": {str(int(level)): level.name for level in Level},
        "reasons": reasons,
        "boot_id": boot_id(),
        "protocol": VERSION,
        **more,
    }
    data = json.dumps(text).encode()
    for at in range(0, len(data), PART):
        yield data[at : at + PART]


def send_welcome(context: Context, peer: Peer, asked: int, received: int) -> None:
    """Send a client all parts.

    Args:
        context: State that all parts of the loop share.
        peer: The client.
        asked: Stamp of the HELLO it answers [ns].
        received: When that was received, monotonic [ns].
    """
    tables, parts = context.judge.guard.guard.tables, context.welcome
    scene = len(tables.q_names), len(tables.robots), tables.period
    for k, part in enumerate(parts):
        head = WELCOME.pack(k, len(parts), *scene, asked, received)
        context.send(context.outbox.message(Kind.WELCOME, head, part), peer)
