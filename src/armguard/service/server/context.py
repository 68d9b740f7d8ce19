"""State that all parts of the loop share."""

import logging
import secrets
from dataclasses import dataclass

from armguard.recording.counters import Counters
from armguard.service.server.answers import Answers
from armguard.service.server.authenticator import Authenticator
from armguard.service.server.judge import Judge
from armguard.service.server.peers import Peer, Peers
from armguard.service.server.settings import ServiceSettings
from armguard.service.server.sockets import Sockets
from armguard.service.server.throttled_log import ThrottledLog
from armguard.service.wire import Cause, Kind, Outbox
from armguard.service.wire.layout import REFUSAL
from armguard.service.wire.pulses import Pulses

log = logging.getLogger("armguard.service")

# A client is informed of drops of one cause no more often than this [ns].
REFUSE_AGAIN = 100_000_000


@dataclass(slots=True)
class Command:
    """The right to command: its holder, and when the desired motion was last heard."""

    watchdog: int  # a desired motion older than that counts as none [ns]
    sender: int = 0  # the holder; 0 for none
    token: int = 0  # the holder shows it with every WISH
    heard: int = 0  # when the newest one was received, monotonic; 0 for none [ns]

    def claim(self, sender: int, force: bool) -> bool:
        """Whether a sender has the command from now on."""
        if self.sender not in (0, sender) and not force:
            return False
        if self.sender != sender:
            self.sender, self.token, self.heard = sender, secrets.randbits(63) | 1, 0
        return True

    def give_back(self) -> None:
        """Leave the command without a holder."""
        self.sender = self.token = self.heard = 0

    def cause(self, now: int) -> Cause:
        """Why the desired motion does not count; NONE if it does."""
        if not self.sender:
            return Cause.NO_COMMANDER
        if not self.heard:
            return Cause.NO_WISH
        return Cause.WISH_OLD if now - self.heard > self.watchdog else Cause.NONE


@dataclass(slots=True)
class Context:
    """Clients, the guard, the right to command, and where messages are written."""

    settings: ServiceSettings
    sockets: Sockets
    counters: Counters
    log: ThrottledLog
    peers: Peers
    authenticator: Authenticator
    outbox: Outbox
    answers: Answers
    judge: Judge
    command: Command
    pulses: Pulses | None  # of the reflex; None without one
    welcome: tuple[bytes, ...] = ()  # parts of the description for clients
    # Why robots stay stopped until they are engaged: `STOP_ORDERED`, `RESTARTED`, or a
    # stop of the reflex that may be over; and why the reflex stops them now.
    ordered: Cause = Cause.NONE
    reflex: Cause = Cause.NONE
    changed: int = 0  # until then answers say that objects were changed [ns]

    def send(self, message: memoryview, peer: Peer) -> None:
        """Send a message to a client, sealed with its key."""
        peer.seal.put(message)
        self.sockets.send(message, peer.address, self.counters)

    def send_to_all(self, message: memoryview) -> None:
        """Send a message to all clients."""
        for peer in self.peers.here:
            self.send(message, peer)

    def refuse(self, peer: Peer, cause: str, sentence: str, now: int) -> None:
        """Inform a client, at most ten times a second, what is wrong with its messages.

        Args:
            peer: The client.
            cause: The cause, see `DROPS`, or "unit".
            sentence: The same in words.
            now: Monotonic clock [ns].
        """
        if now - peer.refused.get(cause, -REFUSE_AGAIN) < REFUSE_AGAIN:
            return
        peer.refused[cause] = now
        head = REFUSAL.pack(self.authenticator.head.sequence)
        text = f"{cause}:{sentence}".encode()
        self.send(self.outbox.message(Kind.REFUSAL, head, text), peer)

    def order_stop(self, name: str) -> None:
        """Stop all robots until the commander engages them; a client ordered it."""
        self.counters.count("stop_orders")
        if self.ordered is not Cause.STOP_ORDERED:
            self.ordered = Cause.STOP_ORDERED
            self.judge.note("stop ordered", by=name)
            log.warning("a stop was ordered by %r", name)

    def look_at_reflex(self, now: int) -> None:
        """Stop all robots while the reflex does, and then until they are engaged.

        Args:
            now: Monotonic clock [ns].
        """
        if self.pulses is None:
            return
        before, self.reflex = self.reflex, self.pulses.hear(now)
        if self.reflex is before:
            return
        says = self.pulses.sentence
        self.judge.note("reflex", cause=self.reflex.name, why=says)
        if self.reflex:
            self.ordered = self.ordered or self.reflex
            log.warning("%s: %s", self.reflex.name, says)
        else:
            log.info("the reflex was reset; the commander has to engage")

    def lose_command(self, why: str) -> None:
        """Take the command from its holder."""
        sender = self.command.sender
        self.command.give_back()
        self.judge.note("commander", sender=0, before=sender, why=why)
