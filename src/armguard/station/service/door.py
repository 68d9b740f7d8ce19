"""What is let in: the one place where messages of others are looked at."""

from armguard.station.service.peers import Address, Peer, Peers
from armguard.station.wire.layout import (
    HEADER,
    LEAST,
    MAGIC,
    MOST,
    VERSION,
    Kind,
)
from armguard.station.wire.seal import Seal

# What clients send.
FROM_CLIENTS = frozenset(
    {
        Kind.HELLO,
        Kind.STATE,
        Kind.WISH,
        Kind.HEARTBEAT,
        Kind.CLAIM,
        Kind.GIVE_BACK,
        Kind.CALL,
        Kind.STOP,
        Kind.BYE,
    }
)


class Door:
    """Checks messages; nothing of one that does not pass is looked at further.

    Attributes:
        scene: The first eight bytes of the scene's hash.
        drop: Why the last message did not pass, "" if it did.
        kind: Kind of the last message that passed.
        stamp: Its sender's monotonic clock [ns].
        sender: Its sender.
        sequence: Its number.

    Args:
        seal: Seal of the service.
        session: Its session.
        scene: See there.
        peers: Who is known.
    """

    def __init__(self, seal: Seal, session: int, scene: int, peers: Peers) -> None:
        self.scene = scene
        self.drop = ""
        self.kind = self.stamp = self.sender = self.sequence = 0
        self._seal = seal
        self._session = session
        self._peers = peers

    def admit(self, message: memoryview, address: Address, now: int) -> Peer | None:
        """The sender of a message that passes; a HELLO's may be None.

        Args:
            message: All that came in.
            address: Where it came from.
            now: Monotonic clock [ns].
        """
        self.drop = self._check(message)
        if self.drop:
            return None
        peer = self._peers.find(self.sender)
        if peer is None:
            if self.kind != Kind.HELLO:
                self.drop = "unknown_sender"
            return None
        if self.sequence <= peer.sequence:
            again = self.sequence == peer.sequence
            self.drop = "replayed" if again else "out_of_order"
            return None
        if peer.address != address:
            self.drop = "address"
            return None
        self._peers.hear(peer, self.sequence, now)
        return peer

    def _check(self, message: memoryview) -> str:
        """Why a message does not pass, whoever sent it."""
        size = len(message)
        if size < LEAST:
            return "too_short"
        if size > MOST:
            return "oversized"
        head = HEADER.unpack_from(message)
        magic, version, kind, length, session, scene = head[:6]
        self.sender, self.sequence, self.stamp = head[6:]
        self.kind = kind
        if magic != MAGIC:
            return "magic"
        if version != VERSION:
            return "version"
        if length != size:
            return "length"
        if not self._seal.fits(message):
            return "seal"
        if kind not in FROM_CLIENTS:
            return "kind"
        # Who says hello may not know session and scene yet.
        hello = kind == Kind.HELLO
        if session != self._session and not (hello and session == 0):
            return "session"
        if scene != self.scene and not hello:
            return "scene"
        return ""
