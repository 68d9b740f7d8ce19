"""A HELLO counts once: it shows a cookie that this start of the service gave out."""

import secrets
from hashlib import blake2s
from struct import Struct

from armguard.station.service.peers import Address

COOKIE = Struct("<Q8s")

# Cookies that are good at a time; an older one is refused.
WINDOW = 1 << 16


class Challenges:
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
        """Whether a cookie is good for a sender at an address; it is not again."""
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
