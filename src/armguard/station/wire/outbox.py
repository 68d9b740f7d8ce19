"""Writing messages into a buffer that is there already."""

import time

from armguard.station.wire.layout import HEADER, MAGIC, MOST, SEAL, VERSION, Kind
from armguard.station.wire.seal import Seal


class Outbox:
    """Writes messages of one sender.

    Attributes:
        session: Session of the service; 0 before it is known.
        scene: The first eight bytes of the scene's hash; 0 before it is known.
        sequence: Number of the message written last.
        ahead: How far the service's clock is ahead of this machine's; 0 before that is
            known [ns].

    Args:
        seal: Seals them; None if each receiver has a seal of its own.
        sender: Number of their sender.
        session: See there.
        scene: See there.
    """

    def __init__(
        self, seal: Seal | None, sender: int, session: int = 0, scene: int = 0
    ) -> None:
        self.session = session
        self.scene = scene
        self.sequence = self.ahead = 0
        self._seal = seal
        self._sender = sender
        self._buffer = memoryview(bytearray(MOST))

    @property
    def buffer(self) -> memoryview:
        """Room for a whole message, its header first."""
        return self._buffer

    @property
    def payload(self) -> memoryview:
        """Room for the payload of the next message."""
        return self._buffer[HEADER.size : MOST - SEAL]

    def seal(self, kind: Kind, size: int) -> memoryview:
        """The message whose payload was written; good until the next one is written.

        Args:
            kind: What it is.
            size: Bytes of its payload.
        """
        self.sequence += 1
        length = HEADER.size + size + SEAL
        HEADER.pack_into(
            self._buffer,
            0,
            MAGIC,
            VERSION,
            kind,
            length,
            self.session,
            self.scene,
            self._sender,
            self.sequence,
            time.monotonic_ns() + self.ahead,
        )
        message = self._buffer[:length]
        if self._seal is not None:
            self._seal.put(message)
        return message

    def message(self, kind: Kind, payload: bytes = b"") -> memoryview:
        """A message with that payload."""
        self.payload[: len(payload)] = payload
        return self.seal(kind, len(payload))
