"""The clients of a service."""

from dataclasses import dataclass, field

from armguard.service.wire import Role, Seal

Address = tuple[str, int]

# Clients that get messages at a time: each costs the loop some microseconds a cycle.
MOST_HERE = 64

# As many of them are kept free for clients that may command.
RESERVED = 16

# Silent clients that are remembered, so that they can go on without a HELLO.
MOST_SILENT = 1024

# Calls of one client that are done from one heartbeat to the next.
MOST_CALLS = 16


@dataclass(slots=True)
class Peer:
    """A client."""

    sender: int  # its number
    name: str  # its own name for itself
    role: Role  # what its key allows
    seal: Seal  # seals messages from it and to it
    address: Address
    sequence: int  # number of its last message
    heard: int  # when its last message was received, monotonic [ns]
    every: int = 1  # cycles to one COMMAND; 0 for answers to its own states only
    here: bool = True  # whether it gets messages
    controls: bool = False  # whether it has sent states
    calls_left: int = MOST_CALLS  # calls that are done before the next heartbeat
    # When it was last sent a REFUSAL, by cause, monotonic [ns].
    refused: dict[str, int] = field(default_factory=dict)
    # Its last call, by the client's number of it, and the reply.
    last_call: tuple[int, bytes] | None = None


class Peers:
    """The clients of this start of the service.

    Attributes:
        here: Those that get messages.

    Args:
        forget: After that much silence a client gets none any more [ns].
    """

    def __init__(self, forget: int) -> None:
        self.here: tuple[Peer, ...] = ()
        self._forget = forget
        # In the order in which they fell silent, if they did.
        self._known: dict[int, Peer] = {}

    def full(self, role: Role) -> bool:
        """Whether there is no room for another client of a role."""
        reserved = 0 if role >= Role.COMMAND else RESERVED
        return len(self.here) >= MOST_HERE - reserved

    def find(self, sender: int) -> Peer | None:
        """A client by its number, silent or not; None if it is not known."""
        return self._known.get(sender)

    def names(self, name: str) -> bool:
        """Whether a client of that name gets messages."""
        return any(peer.name == name for peer in self.here)

    def greet(self, peer: Peer) -> None:
        """Add a client."""
        self._known[peer.sender] = peer
        self._gather()

    def hear(self, peer: Peer, sequence: int, now: int) -> None:
        """Note that a message of a client came in."""
        peer.sequence, peer.heard = sequence, now
        if not peer.here and not self.full(peer.role):
            peer.here = True
            self._gather()

    def leave(self, peer: Peer) -> None:
        """Forget a client that has said good-bye."""
        self._known.pop(peer.sender, None)
        self._gather()

    def look(self, now: int) -> list[Peer]:
        """Grant new calls, and send nothing more to clients that have fallen silent.

        Returns:
            Those clients.
        """
        silent = []
        for peer in self.here:
            peer.calls_left = MOST_CALLS
            if now - peer.heard > self._forget:
                peer.here = False
                silent.append(peer)
                self._known[peer.sender] = self._known.pop(peer.sender)
        if silent:
            self._gather()
            idle = [one for one in self._known.values() if not one.here]
            for peer in idle[: max(0, len(idle) - MOST_SILENT)]:
                del self._known[peer.sender]
        return silent

    def _gather(self) -> None:
        self.here = tuple(peer for peer in self._known.values() if peer.here)
