"""Seals of messages over Zenoh; docs/zenoh.md has them byte by byte."""

import secrets
from collections.abc import Sequence
from hashlib import blake2s
from hmac import compare_digest
from struct import Struct
from typing import NamedTuple

from armguard.bridges.zenoh_bridge.schema import DroppedError
from armguard.recording.rights import Role

# Magic, role, bytes of the key expression, sequence, stamp on the service's clock [ns],
# session of the sender, what the message refers to.
HEADER = Struct("<4sHHQq16s16s")
MAGIC = b"AGZ1"

# Bytes of a MAC, a session, and of what a message refers to.
MAC = 16
NOTHING = bytes(16)

NANO = 1e-9

# Role in the header of the bridge's messages.
BRIDGE = 0

# The bridge's messages have a MAC for each role, in the order of roles.
ROLES = tuple(Role)


class Sender(NamedTuple):
    """A sender of sealed messages."""

    role: int  # whose key seals them; `BRIDGE` for the bridge
    session: bytes  # random, 16 bytes

    @property
    def name(self) -> str:
        """Its public name; it does not disclose the session."""
        return blake2s(self.session, digest_size=8).hexdigest()


class Mark(NamedTuple):
    """Header of a sealed message."""

    sender: Sender
    sequence: int  # rises within a session
    stamp: int  # when it was sent, on the service's clock [ns]
    about: bytes  # to the bridge: its session; in a reply: the MAC of the query


class Sealer:
    """Seals the messages of one sender.

    Attributes:
        sender: That sender, with a new session.
        sequence: Number of the last message.

    Args:
        role: Role that the messages claim; `BRIDGE` for the bridge.
        keys: A key for each MAC; where it is empty the MAC is zero.
    """

    def __init__(self, role: int, keys: Sequence[bytes]) -> None:
        self.sender = Sender(role, secrets.token_bytes(16))
        self.sequence = 0
        self._keys = tuple(keys)

    def seal(
        self, expression: str, payload: bytes, stamp: int, about: bytes = NOTHING
    ) -> bytes:
        """The attachment of the next message.

        Args:
            expression: Zenoh key of the message.
            payload: Its payload.
            stamp: The service's clock now [ns].
            about: What it refers to, 16 bytes.
        """
        self.sequence += 1
        name, (role, session) = expression.encode(), self.sender
        counts = role, len(name), self.sequence, stamp
        header = HEADER.pack(MAGIC, *counts, session, about)
        macs = (mac(key, header, name, payload) for key in self._keys)
        return header + b"".join(macs)


def mac(key: bytes, header: bytes, name: bytes, payload: bytes) -> bytes:
    """MAC of a message; zeros without a key."""
    if not key:
        return NOTHING
    state = blake2s(header, key=key, digest_size=MAC)
    state.update(name)
    state.update(payload)
    return state.digest()


def mark_of(attachment: bytes, macs: int) -> Mark:
    """What an attachment says; nothing of it is checked yet.

    Args:
        attachment: The attachment.
        macs: Number of MACs that it must have.

    Raises:
        DroppedError: It is no seal.
    """
    if len(attachment) != HEADER.size + macs * MAC or attachment[:4] != MAGIC:
        raise DroppedError("seal", "the message has no seal in its attachment")
    _, role, _, sequence, stamp, session, about = HEADER.unpack_from(attachment)
    return Mark(Sender(role, session), sequence, stamp, about)


def check(
    attachment: bytes, slot: int, key: bytes, expression: str, payload: bytes
) -> None:
    """Check one MAC of an attachment that `mark_of` has read.

    Args:
        attachment: The attachment.
        slot: Which of its MACs.
        key: The key of that MAC.
        expression: Zenoh key of the message.
        payload: Its payload.

    Raises:
        DroppedError: It was made with another key, or for another message.
    """
    header = attachment[: HEADER.size]
    name = expression.encode()
    at = HEADER.size + slot * MAC
    fits = compare_digest(mac(key, header, name, payload), attachment[at : at + MAC])
    if not key or not fits or int.from_bytes(header[6:8], "little") != len(name):
        raise DroppedError(
            "seal", "the seal does not fit the message; use the service's present keys"
        )
