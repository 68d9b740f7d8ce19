"""Who talks to the service."""

from dataclasses import dataclass

Address = tuple[str, int]

# Senders that are remembered in one session, so that nothing of them can be replayed.
MOST_SENDERS = 4096


@dataclass(slots=True)
class Peer:
    """A sender.

    Attributes:
        sender: Its number.
        name: What it calls itself.
        address: Where it sends from.
        sequence: Number of its last message.
        heard: When its last message came in, monotonic [ns].
        every: Cycles to one COMMAND; 0 for answers to its own states only.
        sensor: Whether it may place and remove objects.
        here: Whether it gets messages.
        last_call: Its last call, by the number it gave it, and the reply.
    """

    sender: int
    name: str
    address: Address
    sequence: int
    heard: int
    every: int = 1
    sensor: bool = False
    here: bool = True
    last_call: tuple[int, bytes] | None = None


class Peers:
    """All senders of a session.

    Attributes:
        here: Those that get messages.

    Args:
        forget: After that much silence a sender gets none any more [ns].
    """

    def __init__(self, forget: int) -> None:
        self.here: tuple[Peer, ...] = ()
        self._forget = forget
        self._known: dict[int, Peer] = {}

    @property
    def full(self) -> bool:
        """Whether there is no room for another sender."""
        return len(self._known) >= MOST_SENDERS

    def find(self, sender: int) -> Peer | None:
        """A sender, whether it is here or was."""
        return self._known.get(sender)

    def greet(self, peer: Peer) -> None:
        """Somebody new said hello."""
        self._known[peer.sender] = peer
        self._gather()

    def hear(self, peer: Peer, sequence: int, now: int) -> None:
        """A message of somebody came in."""
        peer.sequence, peer.heard = sequence, now
        if not peer.here:
            peer.here = True
            self._gather()

    def leave(self, peer: Peer) -> None:
        """Somebody said good-bye."""
        peer.here = False
        self._gather()

    def forget_silent(self, now: int) -> None:
        """Send nothing more to who has been silent for long."""
        silent = [peer for peer in self.here if now - peer.heard > self._forget]
        for peer in silent:
            peer.here = False
        if silent:
            self._gather()

    def _gather(self) -> None:
        self.here = tuple(peer for peer in self._known.values() if peer.here)
