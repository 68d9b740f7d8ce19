"""What all parts of the loop share."""

import logging
from dataclasses import dataclass

from armguard.station.service.answers import Answers
from armguard.station.service.complaints import Complaints
from armguard.station.service.counters import PLACE, Counters
from armguard.station.service.door import Door
from armguard.station.service.judge import Judge
from armguard.station.service.peers import Peer, Peers
from armguard.station.service.post import Post
from armguard.station.service.settings import ServiceSettings
from armguard.station.service.states import States
from armguard.station.service.wishes import Command, Wishes
from armguard.station.wire.layout import REFUSAL, Kind
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.words import Cause

log = logging.getLogger("armguard.service")

STOP_ORDERS = PLACE["stop_orders"]

# A client is told of drops of one cause no more often than this [ns].
REFUSE_AGAIN = 100_000_000


@dataclass(slots=True)
class Hub:
    """Clients, states, the desired motion, the guard, and where messages are written.

    Attributes:
        settings: Settings of the service.
        post: Its socket.
        counters: What it counts.
        complaints: What its log says.
        peers: Its clients.
        door: Checks their messages.
        outbox: Where messages are written.
        answers: Stops where nothing could be judged, and what was told last.
        judge: The guard.
        states: What was measured.
        wishes: What is wished for.
        command: Who commands.
        ordered: Why robots stand still until they are engaged: `STOP_ORDERED` or
            `RESTARTED`; `NONE` if they may move.
        changed: Until when answers say that objects were changed, monotonic [ns].
    """

    settings: ServiceSettings
    post: Post
    counters: Counters
    complaints: Complaints
    peers: Peers
    door: Door
    outbox: Outbox
    answers: Answers
    judge: Judge
    states: States
    wishes: Wishes
    command: Command
    ordered: Cause = Cause.NONE
    changed: int = 0

    def send(self, message: memoryview, peer: Peer) -> None:
        """Send a message to a client, sealed with its key."""
        peer.seal.put(message)
        self.post.send(message, peer.address, self.counters)

    def send_to_all(self, message: memoryview) -> None:
        """Send a message to all clients."""
        for peer in self.peers.here:
            self.send(message, peer)

    def refuse(self, peer: Peer, cause: str, sentence: str, now: int) -> None:
        """Tell a client that its last message was dropped, at most ten times a second.

        Args:
            peer: The client.
            cause: The cause, as counters name it.
            sentence: The same for people.
            now: Monotonic clock [ns].
        """
        if now - peer.refused.get(cause, -REFUSE_AGAIN) < REFUSE_AGAIN:
            return
        peer.refused[cause] = now
        text = f"{cause}:{sentence}".encode()
        payload = self.outbox.payload
        REFUSAL.pack_into(payload, 0, self.door.sequence)
        end = REFUSAL.size + len(text)
        payload[REFUSAL.size : end] = text
        self.send(self.outbox.seal(Kind.REFUSAL, end), peer)

    def order_stop(self, who: str) -> None:
        """Stop all robots until the commander engages them."""
        self.counters.count(STOP_ORDERS)
        if self.ordered is not Cause.STOP_ORDERED:
            self.ordered = Cause.STOP_ORDERED
            self.judge.note("stop ordered", by=who)
            log.warning("a stop was ordered by %r", who)

    def lose_command(self, why: str) -> None:
        """Nobody commands any more."""
        sender = self.command.sender
        self.command.give_back()
        self.wishes.drop()
        self.judge.note("commander", sender=0, before=sender, why=why)
