"""The seal at the end of a message: without the key nobody can make it."""

from hashlib import blake2s
from hmac import compare_digest

from armguard.station.wire.layout import SEAL


class Seal:
    """Seals messages and tells sealed ones from others.

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
