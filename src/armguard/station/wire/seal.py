"""The seal at the end of a message: who does not have the key cannot make it."""

from hashlib import blake2s
from hmac import compare_digest
from pathlib import Path

from armguard.station.errors import KeyFileError
from armguard.station.wire.layout import SEAL

# On loopback the seal guards against accidents, not against anybody.
PUBLIC = b"armguard"

# Lengths of a key: BLAKE2s takes no longer one, and a shorter one can be guessed.
LEAST_KEY, MOST_KEY = 16, 32


class Seal:
    """Seals messages and tells sealed ones from others.

    Args:
        key: The key, 16 to 32 bytes; empty for the public word.
    """

    def __init__(self, key: bytes = b"") -> None:
        self._start = blake2s(key=key or PUBLIC, digest_size=SEAL)

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


def read_key(path: Path) -> bytes:
    """The key in a file, white space around it left out.

    Raises:
        KeyFileError: There is no such file, or the key is too short or too long.
    """
    try:
        key = path.read_bytes().strip()
    except OSError as error:
        raise KeyFileError(f"{path}: no key can be read: {error.strerror}") from error
    if not LEAST_KEY <= len(key) <= MOST_KEY:
        raise KeyFileError(
            f"{path}: the key has {len(key)} bytes; it must have {LEAST_KEY} to "
            f"{MOST_KEY}"
        )
    return key
