"""Which messages count: the service's, whole, sealed, newer than the last."""

from collections.abc import Callable
from typing import NamedTuple

from armguard.station.client.answer import CAUSES, Answer
from armguard.station.client.fields import (
    BODY_A,
    BODY_B,
    CAUSE,
    FIELDS,
    JOINTS,
    ROBOTS,
    SAME,
    SEQUENCE,
)
from armguard.station.client.welcome import NOTHING, Welcome
from armguard.station.wire.layout import (
    HEADER,
    LEAST,
    MAGIC,
    MOST,
    NOBODY,
    ROBOT,
    ROBOTS_AT,
    SEAL,
    VERSION,
    Kind,
)
from armguard.station.wire.seal import Seal


class Head(NamedTuple):
    """What the header of a message says that was let in."""

    kind: int
    session: int
    scene: int
    sequence: int
    stamp: int


class Inbox:
    """Holds one message at a time, and tells whether it counts.

    Attributes:
        buffer: Where a message is received.
        last: Number of the last message that was let in.

    Args:
        seal: Seals of the service fit it.
    """

    def __init__(self, seal: Seal) -> None:
        # A message that is too long is seen to be so.
        self.buffer = bytearray(MOST + 8)
        self.last = 0
        self._seal = seal
        self._all = memoryview(self.buffer)
        self._session = self._size = 0
        self._command = self._all[:0]
        self._same: tuple[int, ...] = ()
        self._welcome = NOTHING
        self._clock: Callable[[], float] = float
        self._shape: tuple[int, ...] = ()
        self._bodies = 0

    def expect(
        self, session: int, scene: int, welcome: Welcome, clock: Callable[[], float]
    ) -> None:
        """Let in what this service says of this scene from now on.

        Args:
            session: The service's session.
            scene: The scene as headers name it.
            welcome: What the service told about itself.
            clock: Its clock [s].
        """
        joints, robots = len(welcome.names), len(welcome.robots)
        self._session = session
        self._size = size = ROBOTS_AT + robots * ROBOT.size + 16 * joints + SEAL
        self._command = self._all[:size]
        head = MAGIC, VERSION, Kind.COMMAND, size, session, scene, 0, 0, 0
        self._same = SAME.unpack_from(HEADER.pack(*head))
        self._shape = joints, robots
        self._bodies = len(welcome.bodies)
        self._welcome, self._clock = welcome, clock

    def answer(self, size: int) -> Answer | None:
        """The answer in a COMMAND; None if it is none, or one that does not count.

        Args:
            size: How much was received [bytes].
        """
        if size != self._size:
            return None
        fields = FIELDS.unpack_from(self.buffer)
        sequence, a, b = fields[SEQUENCE], fields[BODY_A], fields[BODY_B]
        message = self._command
        if (
            fields[:SEQUENCE] != self._same
            or sequence <= self.last
            or fields[JOINTS : ROBOTS + 1] != self._shape
            or fields[CAUSE] not in CAUSES
            or (a != NOBODY and not (a < self._bodies and b < self._bodies))
            or not self._seal.fits(message)
        ):
            return None
        self.last = sequence
        # The one copy: the next message comes into the same buffer.
        return Answer(bytes(message), fields, self._welcome, self._clock)

    def head(self, size: int) -> Head | None:
        """The header of any message; None if it does not count.

        Args:
            size: How much was received [bytes].
        """
        if not LEAST <= size <= MOST:
            return None
        message = self._all[:size]
        head = HEADER.unpack_from(message)
        magic, version, kind, length, session, scene, sender, sequence, stamp = head
        if (magic, version, length, sender) != (MAGIC, VERSION, size, 0):
            return None
        if sequence <= (self.last if session == self._session else 0):
            return None
        if not self._seal.fits(message):
            return None
        return Head(kind, session, scene, sequence, stamp)

    def payload(self, size: int) -> memoryview:
        """The payload of a message of that size; good until the next one comes."""
        return self._all[HEADER.size : size - SEAL]
