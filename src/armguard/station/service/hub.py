"""What all parts of the loop share."""

from dataclasses import dataclass

from armguard.station.service.answers import Answers
from armguard.station.service.complaints import Complaints
from armguard.station.service.counters import Counters
from armguard.station.service.door import Door
from armguard.station.service.judge import Judge
from armguard.station.service.peers import Address, Peers
from armguard.station.service.post import Post
from armguard.station.service.settings import ServiceSettings
from armguard.station.service.states import States
from armguard.station.service.wishes import Command, Wishes
from armguard.station.wire.outbox import Outbox


@dataclass(slots=True)
class Hub:
    """Who is there, what is known, and where to say something.

    Attributes:
        settings: Settings of the service.
        post: Its socket.
        counters: What it counts.
        complaints: What its log says.
        peers: Who talks to it.
        door: What is let in.
        outbox: Where messages are written.
        answers: Stops where nothing could be judged, and what was told last.
        judge: The guard.
        states: What was measured.
        wishes: What is wished for.
        command: Who commands.
        ordered: Whether somebody ordered a stop that nobody has ended yet.
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
    ordered: bool = False

    def send(self, message: memoryview, address: Address) -> None:
        """Send a message to somebody."""
        self.post.send(message, address, self.counters)

    def send_to_all(self, message: memoryview) -> None:
        """Send a message to everybody who is here."""
        for peer in self.peers.here:
            self.post.send(message, peer.address, self.counters)

    def lose_command(self, why: str) -> None:
        """Nobody commands any more."""
        sender = self.command.sender
        self.command.give_back()
        self.wishes.drop()
        self.judge.note("commander", sender=0, before=sender, why=why)
