"""The one place where messages of clients are checked."""

import secrets
from collections.abc import Mapping
from hashlib import blake2s
from struct import Struct

from armguard.service.server.peers import Address, Peer, Peers
from armguard.service.wire import Keys, Kind, Role, Seal
from armguard.service.wire.layout import (
    HEADER,
    HELLO,
    LEAST,
    MAGIC,
    MOST,
    SEAL,
    VERSION,
)

# Kinds that clients send, and the role each needs.
ROLES: Mapping[int, Role] = {
    **dict.fromkeys(
        (Kind.HELLO, Kind.HEARTBEAT, Kind.CALL, Kind.STOP, Kind.BYE), Role.OBSERVE
    ),
    **dict.fromkeys((Kind.CELLS, Kind.HEALTH), Role.SENSE),
    **dict.fromkeys((Kind.STATE, Kind.WISH, Kind.CLAIM, Kind.GIVE_BACK), Role.COMMAND),
}

# A cookie: its number, and a code that this start of the service alone can make.
COOKIE = Struct("<Q8s")

# Cookies that are valid at a time; an older one is refused.
WINDOW = 1 << 16


class Cookies:
    """Gives cookies out and takes each of them back once.

    A cookie is a number and a code over the number, the sender and its address, keyed
    with a secret of this start. Nothing is kept of a client before it has answered.
    """

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)
        self._given = 0
        self._open = bytearray(WINDOW)

    def give(self, sender: int, address: Address) -> bytes:
        """A new cookie for a sender at an address, 16 bytes."""
        self._given = number = self._given + 1
        self._open[number % WINDOW] = 1
        return COOKIE.pack(number, self._code(number, sender, address))

    def take(self, cookie: bytes, sender: int, address: Address) -> bool:
        """Whether a cookie is valid for a sender at an address; it is not again."""
        number, code = COOKIE.unpack(cookie)
        place = number % WINDOW
        recent = self._given - WINDOW < number <= self._given
        if not (recent and self._open[place]):
            return False
        if not secrets.compare_digest(code, self._code(number, sender, address)):
            return False
        self._open[place] = 0
        return True

    def _code(self, number: int, sender: int, address: Address) -> bytes:
        text = f"{number} {sender} {address[0]} {address[1]}".encode()
        return blake2s(text, key=self._secret, digest_size=8).digest()


class Authenticator:
    """Checks messages; nothing of one that does not pass is looked at further.

    Attributes:
        scene: The first eight bytes of the scene's hash.
        cookies: Cookies of HELLOs.
        drop: Why the last message did not pass, "" if it did.
        head: Header of the last message.
        seal: Seal that fits it.
        opened: Whether it names the session of this start.

    Args:
        keys: Keys of the service.
        session: Its session.
        peers: Its clients.
    """

    def __init__(self, keys: Keys, session: int, peers: Peers) -> None:
        self.scene = 0
        self.cookies = Cookies()
        self.drop = ""
        self.head = HEADER.unpack_from(bytes(HEADER.size))
        self.seal: Seal | None = None
        self.opened = False
        self._seals = {int(role): Seal(key) for role, key in keys.items()}
        self._session, self._peers = session, peers

    def admit(self, message: memoryview, address: Address, now: int) -> Peer | None:
        """The client that sent a message that passes; None for a new one's HELLO.

        Args:
            message: All that was received.
            address: Its sender's.
            now: Monotonic clock [ns].
        """
        self.drop = self._check_form(message)
        if self.drop:
            return None
        head = self.head
        peer = self._peers.find(head.sender)
        self.drop = self._check_seal(peer, message) or self._check_head(peer)
        if self.drop or peer is None:
            return None
        if head.sequence <= peer.sequence:
            again = head.sequence == peer.sequence
            self.drop = "replayed" if again else "out_of_order"
        elif peer.address != address:
            self.drop = "address"
        else:
            self._peers.hear(peer, head.sequence, now)
            if peer.role < ROLES[head.kind]:
                self.drop = "role"
            return peer
        return None

    def _check_form(self, message: memoryview) -> str:
        """Why a message is none, from any sender."""
        size = len(message)
        if size < LEAST:
            return "too_short"
        if size > MOST:
            return "oversized"
        self.head = head = HEADER.unpack_from(message)
        if head.magic != MAGIC:
            return "magic"
        if head.version != VERSION:
            return "version"
        if head.length != size:
            return "length"
        return "" if head.kind in ROLES else "kind"

    def _check_seal(self, peer: Peer | None, message: memoryview) -> str:
        """Why a message is not its sender's."""
        if peer is not None:
            self.seal = peer.seal
        elif self.head.kind != Kind.HELLO:
            return "unknown_sender"
        elif len(message) < HEADER.size + HELLO.size + SEAL:
            return "payload"
        else:
            self.seal = self._seals.get(HELLO.unpack_from(message, HEADER.size).role)
        if self.seal is None or not self.seal.fits(message):
            return "seal"
        return ""

    def _check_head(self, peer: Peer | None) -> str:
        """Why a message is of another session or scene."""
        head, hello = self.head, self.head.kind == Kind.HELLO
        # A new client's first HELLO cannot name a session.
        self.opened = head.session == self._session
        first = hello and peer is None and head.session == 0
        if not (self.opened or first):
            return "session"
        if head.scene != self.scene and not hello:
            return "scene"
        return "" if head.sender else "unknown_sender"
