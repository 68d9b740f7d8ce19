"""Messages that were let in, and what each of them does."""

import logging
import time
from collections.abc import Callable

from armguard.station.desk.desk import (
    HAS_WISH,
    NOW,
    OUTCOMES,
    SENDER,
    SEQUENCE,
    SIZE,
    TOKEN,
    WATCHDOG,
    WISH_OUTCOME,
)
from armguard.station.desk.taking import take_state, take_wish
from armguard.station.service.calls import Calls, read_call, refusal
from armguard.station.service.counters import DROPS, PLACE
from armguard.station.service.cycles import NANO, Cycles
from armguard.station.service.hub import Hub
from armguard.station.service.objects import AHEAD
from armguard.station.service.peers import Address, Peer
from armguard.station.service.welcome import Welcome
from armguard.station.wire.keys import Role
from armguard.station.wire.layout import (
    CHALLENGE,
    CLAIM,
    GIVE_BACK,
    GRANT,
    HEADER,
    HELLO,
    MOST,
    REPLY,
    SEAL,
    Kind,
)
from armguard.station.wire.words import Cause

RECEIVED = PLACE["received"]
ACCEPTED = PLACE["accepted"]
STATES = PLACE["states"]
WISHES = PLACE["wishes"]
CALLS = PLACE["calls"]
CALLS_REFUSED = PLACE["calls_refused"]
HELLOS = PLACE["hellos"]
CLAIMS = PLACE["claims"]
CLAIMS_REFUSED = PLACE["claims_refused"]

# What is told of a call has to fit into a message [bytes].
LONGEST_REPLY = MOST - HEADER.size - SEAL - REPLY.size

# HELLOs that are answered from one heartbeat to the next.
MOST_HELLOS = 256


class Reception:
    """Reads messages, one at a time.

    Args:
        hub: What all parts of the loop share.
        cycles: Told of states.
        calls: Done on request.
        welcome: What a HELLO is answered with.
        buffer: Where messages come in; the desk looks at the same bytes.
    """

    def __init__(
        self,
        hub: Hub,
        cycles: Cycles,
        calls: Calls,
        welcome: Welcome,
        buffer: bytearray,
    ) -> None:
        self._hub, self._cycles = hub, cycles
        self._calls, self._welcome = calls, welcome
        self._buffer, self._message = buffer, memoryview(buffer)
        given = hub.judge.desk.given.data
        self._given, self._given_u = given, given.cast("B").cast("Q")
        given[WATCHDOG] = int(hub.settings.controller_watchdog * NANO)
        self._wish_limit = int(hub.settings.wish_watchdog * NANO)
        self._call_limit = int(hub.settings.commander_watchdog * NANO)
        self._hellos_left = MOST_HELLOS
        self._kinds: dict[int, Callable[[Peer, memoryview, int], str]] = {
            Kind.STATE: self._take_state,
            Kind.WISH: self._take_wish,
            Kind.HEARTBEAT: self._take_nothing,
            Kind.CLAIM: self._take_claim,
            Kind.GIVE_BACK: self._take_give_back,
            Kind.CALL: self._take_call,
            Kind.STOP: self._take_stop,
            Kind.BYE: self._take_bye,
        }

    def read(self) -> bool:
        """Take one message over; False if there was none. Raises nothing."""
        hub = self._hub
        found = hub.post.receive(self._buffer, hub.complaints)
        if found is None:
            return False
        size, address = found
        if size < 0:
            return True
        now = time.monotonic_ns()
        count = hub.counters.count
        count(RECEIVED)
        message = self._message[:size]
        peer = None
        try:
            peer = hub.door.admit(message, address, now)
            drop = hub.door.drop
            if not drop and hub.door.kind == Kind.HELLO:
                drop = self._take_hello(peer, message, address, now)
            elif not drop and peer is not None:
                drop = self._kinds[hub.door.kind](peer, message, now)
        except Exception as error:  # nothing of what others send may end the loop
            drop = "payload"
            hub.complaints.name("message", f"{type(error).__name__}: {error}", now)
        if drop:
            count(PLACE[f"dropped_{drop}"])
            hub.complaints.name(drop, f"{DROPS[drop]}, from {address}", now)
            if peer is not None:
                hub.refuse(peer, drop, DROPS[drop], now)
        else:
            count(ACCEPTED)
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
        role, every, cookie = HELLO.unpack_from(payload)
        hub = self._hub
        door, peers = hub.door, hub.peers
        if peer is None:
            assert door.seal is not None
            name = bytes(payload[HELLO.size : HELLO.size + 64]).decode(errors="replace")
            new = Peer(
                door.sender, name, Role(role), door.seal, address, door.sequence, now
            )
            if not door.opened:
                self._challenge(new)
                return ""
            if not door.knows(cookie, address):
                return "challenge"
            if peers.full(new.role):
                hub.refuse(new, "too_many_senders", DROPS["too_many_senders"], now)
                return "too_many_senders"
            peer = new
            peers.greet(peer)
            sentence = (
                f"client '{name}' at {address[0]}:{address[1]} has connected; its key "
                f"is for '{peer.role.word}'"
            )
            hub.complaints.name("hello", sentence, now, logging.INFO)
        peer.every = every
        hub.counters.count(HELLOS)
        self._welcome.send(hub, peer, door.stamp, now)
        return ""

    def _challenge(self, new: Peer) -> None:
        """Give a client that is not known yet the cookie of its next HELLO."""
        hub = self._hub
        cookie = hub.door.challenges.give(new.sender, new.address)
        CHALLENGE.pack_into(hub.outbox.payload, 0, hub.door.stamp, cookie)
        hub.send(hub.outbox.seal(Kind.CHALLENGE, CHALLENGE.size), new)

    def _take_state(self, peer: Peer, message: memoryview, now: int) -> str:
        """Take over measured joints, and the wish that may follow them."""
        hub = self._hub
        self._hand_over(peer, message, now)
        drop = take_state(hub.judge.address)
        if drop:
            return OUTCOMES[drop]
        if not peer.controls:
            peer.controls = True
            hub.post.favour(peer.address)
        hub.states.look()
        hub.counters.count(STATES)
        self._cycles.begin_with(peer, hub.door.sequence, now)
        if not hub.states.complete:
            stop = hub.answers.write_stop(
                hub.states, 0, Cause.WAITING, now, hub.command.sender
            )
            hub.send(stop, peer)
        if self._given[HAS_WISH]:
            return self._look_at_wish(self._given[WISH_OUTCOME], now)
        return ""

    def _take_wish(self, peer: Peer, message: memoryview, now: int) -> str:
        """Take a wish over."""
        self._hand_over(peer, message, now)
        return self._look_at_wish(take_wish(self._hub.judge.address), now)

    def _hand_over(self, peer: Peer, message: memoryview, now: int) -> None:
        """Say on the desk which message lies there."""
        command, given = self._hub.command, self._given_u
        given[SIZE], given[NOW] = len(message), now
        given[SENDER], given[SEQUENCE] = peer.sender, self._hub.door.sequence
        # A wish that does not count because of its age shows a token that never fits.
        self._age = self._age_of(now, self._wish_limit, "wish_late")
        owns = peer.sender == command.sender and not self._age
        given[TOKEN] = command.token if owns else 0

    def _look_at_wish(self, outcome: int, now: int) -> str:
        """Why a wish was dropped, "" if it counts."""
        hub, drop = self._hub, OUTCOMES[outcome]
        if not drop:
            hub.wishes.heard = min(now, hub.door.stamp)
            hub.counters.count(WISHES)
        elif drop == "wish_not_finite":
            # A wish that is no number asks for no motion.
            hub.wishes.drop()
        elif drop == "not_commander" and self._age:
            return self._age
        return drop

    def _age_of(self, now: int, limit: int, late: str) -> str:
        """Why the message that was let in last is too old, or from the future."""
        age = now - self._hub.door.stamp
        if age > limit:
            return late
        return "ahead" if age < -AHEAD else ""

    def _take_nothing(self, peer: Peer, message: memoryview, now: int) -> str:
        """Note that a client is alive."""
        return "" if len(message) == HEADER.size + SEAL else "payload"

    def _take_claim(self, peer: Peer, message: memoryview, now: int) -> str:
        """Grant the command, or say that another client has it."""
        if len(message) != HEADER.size + CLAIM.size + SEAL:
            return "payload"
        if drop := self._age_of(now, self._call_limit, "call_late"):
            return drop
        force, _ = CLAIM.unpack_from(message, HEADER.size)
        hub = self._hub
        command, before = hub.command, hub.command.sender
        granted = command.claim(
            peer.sender, bool(force) and peer.role >= Role.ADMINISTER
        )
        hub.counters.count(CLAIMS if granted else CLAIMS_REFUSED)
        if granted and before != peer.sender:
            hub.wishes.drop()
            hub.judge.note(
                "commander", sender=peer.sender, name=peer.name, before=before
            )
        GRANT.pack_into(
            hub.outbox.payload,
            0,
            granted,
            0,
            command.token if granted else 0,
            command.sender,
            hub.settings.commander_watchdog,
            hub.door.sequence,
        )
        hub.send(hub.outbox.seal(Kind.GRANT, GRANT.size), peer)
        return ""

    def _take_give_back(self, peer: Peer, message: memoryview, now: int) -> str:
        """Take the command back from its holder."""
        if len(message) != HEADER.size + GIVE_BACK.size + SEAL:
            return "payload"
        (token,) = GIVE_BACK.unpack_from(message, HEADER.size)
        command = self._hub.command
        if peer.sender != command.sender or token != command.token:
            return "not_commander"
        self._hub.lose_command("given back")
        return ""

    def _take_call(self, peer: Peer, message: memoryview, now: int) -> str:
        """Do what is called for, and reply."""
        hub, sequence = self._hub, self._hub.door.sequence
        if peer.calls_left <= 0:
            return "busy"
        peer.calls_left -= 1
        if drop := self._age_of(now, self._call_limit, "call_late"):
            return drop
        request = read_call(bytes(message[HEADER.size : -SEAL]))
        if request is None:
            return "call_unreadable"
        hub.counters.count(CALLS)
        if peer.last_call is not None and peer.last_call[0] == request.number:
            reply = peer.last_call[1]
        else:
            commands = peer.sender == hub.command.sender
            done, reply = self._calls.do(request, peer, commands)
            if len(reply) > LONGEST_REPLY:
                done, reply = False, refusal(f"'{request.call}' has too much to tell")
            if not done:
                hub.counters.count(CALLS_REFUSED)
            peer.last_call = request.number, reply
        payload = hub.outbox.payload
        REPLY.pack_into(payload, 0, sequence)
        payload[REPLY.size : REPLY.size + len(reply)] = reply
        hub.send(hub.outbox.seal(Kind.REPLY, REPLY.size + len(reply)), peer)
        return ""

    def _take_stop(self, peer: Peer, message: memoryview, now: int) -> str:
        """Stop all robots, which every client may order."""
        self._hub.order_stop(peer.name)
        return ""

    def _take_bye(self, peer: Peer, message: memoryview, now: int) -> str:
        """Let a client go."""
        hub = self._hub
        hub.peers.leave(peer)
        hub.post.disfavour(peer.address)
        hub.states.release(peer.sender)
        if peer.sender == hub.command.sender:
            hub.lose_command("said good-bye")
        return ""
