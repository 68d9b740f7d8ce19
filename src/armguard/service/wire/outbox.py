"""Messages in a buffer that is there already, and the seal at the end of each."""

import time
from hashlib import blake2s
from hmac import compare_digest

from armguard.service.wire.layout import HEADER, MAGIC, MOST, SEAL, VERSION, Kind


class Seal:
    """Seals messages and recognises its own: it cannot be made without the key.

    Args:
        key: The key, 16 to 32 bytes.
    """

    def __init__(self, key: bytes) -> None:
        self._start = blake2s(key=key, digest_size=SEAL)

    def put(self, message: memoryview) -> None:
        """Seal a message: write its last bytes."""
        state = self._start.copy()
        state.update(message[:-SEAL])
        message[-SEAL:] = state.digest()

    def fits(self, message: memoryview) -> bool:
        """Whether it is sealed with this key and nothing in it was changed."""
        state = self._start.copy()
        state.update(message[:-SEAL])
        return compare_digest(state.digest(), message[-SEAL:])


class Outbox:
    """Writes messages of one sender.

    Attributes:
        session: Session of the service; 0 before it is known.
        scene: The first eight bytes of the scene's hash; 0 before it is known.
        sequence: Number of the message written last.
        ahead: How far the service's clock is ahead of this machine's; 0 before that is
            known [ns].
        buffer: Room for a whole message, its header first.
        payload: Room for the payload of the next message.

    Args:
        seal: Seals them; None if each receiver has a seal of its own.
        sender: Number of their sender.
        session: See there.
        scene: See there.
    """

    def __init__(
        self, seal: Seal | None, sender: int, session: int = 0, scene: int = 0
    ) -> None:
        self.session, self.scene = session, scene
        self.sequence = self.ahead = 0
        self._seal, self._sender = seal, sender
        self.buffer = memoryview(bytearray(MOST))
        self.payload = self.buffer[HEADER.size : -SEAL]

    def seal(self, kind: Kind, size: int) -> memoryview:
        """The message whose payload was written; good until the next one is written.

        Args:
            kind: Its kind.
            size: Length of its payload [bytes].
        """
        self.sequence += 1
        message = self.buffer[: HEADER.size + size + SEAL]
        HEADER.put(
            *(message, 0, MAGIC, VERSION, kind, len(message)),
            *(self.session, self.scene, self._sender, self.sequence),
            time.monotonic_ns() + self.ahead,
        )
        if self._seal is not None:
            self._seal.put(message)
        return message

    def message(self, kind: Kind, *parts: bytes) -> memoryview:
        """A message whose payload is these parts one after another."""
        payload = b"".join(parts)
        self.payload[: len(payload)] = payload
        return self.seal(kind, len(payload))
