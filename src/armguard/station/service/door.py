"""The one place where messages of clients are checked."""

from collections.abc import Mapping

from armguard.station.service.challenges import Challenges
from armguard.station.service.peers import Address, Peer, Peers
from armguard.station.wire.keys import Keys, Role
from armguard.station.wire.layout import (
    HEADER,
    HELLO,
    LEAST,
    MAGIC,
    MOST,
    NO_COOKIE,
    SEAL,
    VERSION,
    Kind,
)
from armguard.station.wire.seal import Seal

# What clients send, and the role it needs.
ROLES: Mapping[int, Role] = {
    Kind.HELLO: Role.OBSERVE,
    Kind.HEARTBEAT: Role.OBSERVE,
    Kind.CALL: Role.OBSERVE,
    Kind.STOP: Role.OBSERVE,
    Kind.BYE: Role.OBSERVE,
    Kind.STATE: Role.COMMAND,
    Kind.WISH: Role.COMMAND,
    Kind.CLAIM: Role.COMMAND,
    Kind.GIVE_BACK: Role.COMMAND,
}


class Door:
    """Checks messages; nothing of one that does not pass is looked at further.

    Attributes:
        scene: The first eight bytes of the scene's hash.
        challenges: Cookies of HELLOs.
        drop: Why the last message did not pass, "" if it did.
        kind: Kind of the last message that passed.
        stamp: When it was sent, see `HEADER` [ns].
        sender: Its sender.
        sequence: Its number.
        seal: Seal that fits it.
        opened: Whether it names the session of this start.

    Args:
        keys: Keys of the service.
        session: Its session.
        scene: See there.
        peers: Its clients.
    """

    def __init__(self, keys: Keys, session: int, scene: int, peers: Peers) -> None:
        self.scene = scene
        self.challenges = Challenges()
        self.drop = ""
        self.kind = self.stamp = self.sender = self.sequence = 0
        self._seals = {int(role): Seal(key) for role, key in keys.items()}
        self.seal: Seal | None = None
        self.opened = False
        self._session = session
        self._peers = peers

    def admit(self, message: memoryview, address: Address, now: int) -> Peer | None:
        """The client that sent a message that passes; None for a new one's HELLO.

        Args:
            message: All that came in.
            address: Where it came from.
            now: Monotonic clock [ns].
        """
        self.drop = self._check_form(message)
        if self.drop:
            return None
        peer = self._peers.find(self.sender)
        self.drop = self._check_seal(peer, message) or self._check_head(peer)
        if self.drop or peer is None:
            return None
        if self.sequence <= peer.sequence:
            again = self.sequence == peer.sequence
            self.drop = "replayed" if again else "out_of_order"
        elif peer.address != address:
            self.drop = "address"
        else:
            self._peers.hear(peer, self.sequence, now)
            if peer.role < ROLES[self.kind]:
                self.drop = "role"
            return peer
        return None

    def knows(self, cookie: bytes, address: Address) -> bool:
        """Whether the HELLO that was checked last shows a cookie that is good."""
        return cookie != NO_COOKIE and self.challenges.take(
            cookie, self.sender, address
        )

    def _check_form(self, message: memoryview) -> str:
        """Why a message is none, whoever sent it."""
        size = len(message)
        if size < LEAST:
            return "too_short"
        if size > MOST:
            return "oversized"
        head = HEADER.unpack_from(message)
        magic, version, self.kind, length, self._of_session, self._of_scene = head[:6]
        self.sender, self.sequence, self.stamp = head[6:]
        if magic != MAGIC:
            return "magic"
        if version != VERSION:
            return "version"
        if length != size:
            return "length"
        if self.kind not in ROLES:
            return "kind"
        return ""

    def _check_seal(self, peer: Peer | None, message: memoryview) -> str:
        """Why a message is not its sender's."""
        if peer is not None:
            self.seal = peer.seal
        elif self.kind != Kind.HELLO:
            return "unknown_sender"
        elif len(message) < HEADER.size + HELLO.size + SEAL:
            return "payload"
        else:
            role, _, _ = HELLO.unpack_from(message, HEADER.size)
            self.seal = self._seals.get(role)
        if self.seal is None or not self.seal.fits(message):
            return "seal"
        return ""

    def _check_head(self, peer: Peer | None) -> str:
        """Why a message is of another session or scene."""
        hello = self.kind == Kind.HELLO
        # A new client's first HELLO cannot name a session.
        self.opened = self._of_session == self._session
        first = hello and peer is None and self._of_session == 0
        if not (self.opened or first):
            return "session"
        if self._of_scene != self.scene and not hello:
            return "scene"
        if self.sender == 0:
            return "unknown_sender"
        return ""
