"""A socket to one service, and which of the messages that come in count."""

import secrets
import select
import socket
import time
from collections.abc import Callable
from math import nan
from typing import NamedTuple

from armguard.station.client.answer import (
    BODY_A,
    BODY_B,
    CAUSE,
    CAUSES,
    FIELDS,
    JOINTS,
    NANO,
    ROBOTS,
    SAME,
    SEQUENCE,
    Answer,
)
from armguard.station.client.welcome import NOTHING, Welcome
from armguard.station.errors import NoServiceError
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
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.seal import Seal

# The service forgets a client that is silent for longer than a few of these [ns].
ALIVE = 200_000_000


class Head(NamedTuple):
    """Header of a message that counts."""

    kind: int
    session: int
    scene: int
    sequence: int
    stamp: int


class Connection:
    """One end of the messages; each `open` makes it another sender.

    Attributes:
        address: Host and port of the service.
        sender: Number by which the service knows this end.
        seal: Seals messages.
        outbox: Where messages are written.
        last: Number of the newest message of the service that counted.
        socket: The socket; None before `open` and after `close`.
        opened: When it was opened, monotonic [ns].
        dropped: Messages that could not be sent, and others that did not count.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        self.address = address
        self.socket: socket.socket | None = None
        self.dropped = self.opened = self._sent = 0
        # The same socket once more, which waits: for how long it was asked to [s], and
        # whole milliseconds of that.
        self._patient: socket.socket | None = None
        self._wait, self._milliseconds = nan, 0
        # Room beyond the longest message shows that one is too long.
        self._buffer = bytearray(MOST + 8)
        self._all = memoryview(self._buffer)
        # Fits nothing until `open` brings a key.
        self._begin(secrets.token_bytes(16))

    def _begin(self, key: bytes) -> None:
        """Become a new sender, which knows no service yet."""
        # The service remembers the sequence of the sender that was here before.
        self.sender, self.seal = secrets.randbits(63) | 1, Seal(key)
        self.outbox = Outbox(self.seal, self.sender)
        self.last = 0
        self.expect(0, 0, NOTHING, float)
        # No COMMAND counts before the service is known.
        self._size = -1

    def expect(
        self, session: int, scene: int, welcome: Welcome, clock: Callable[[], float]
    ) -> None:
        """Let in the messages of this service about this scene from now on.

        Args:
            session: The service's session.
            scene: The scene as headers name it.
            welcome: Description of the service.
            clock: Its clock [s].
        """
        joints, robots = len(welcome.names), len(welcome.robots)
        self._session = session
        self._size = size = ROBOTS_AT + robots * ROBOT.size + 16 * joints + SEAL
        self._command = self._all[:size]
        head = MAGIC, VERSION, Kind.COMMAND, size, session, scene, 0, 0, 0
        self._same = SAME.unpack_from(HEADER.pack(*head))
        self._shape, self._bodies = (joints, robots), len(welcome.bodies)
        self._welcome, self._clock = welcome, clock

    @property
    def place(self) -> str:
        """Host and port of the service."""
        return "{}:{}".format(*self.address)

    def open(self, key: bytes) -> None:
        """Send and receive messages that are sealed with a key, from now on.

        Raises:
            NoServiceError: There is no way there.
        """
        self.opened = time.monotonic_ns()
        self._begin(key)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.connect(self.address)
        except OSError as error:
            self.close()
            raise NoServiceError(f"{self.place}: {error}") from error
        self.socket.setblocking(False)
        self._patient = self.socket.dup()
        self._wait, self._milliseconds = nan, 0

    def close(self) -> None:
        """Nothing is sent or received any more."""
        for one in (self.socket, self._patient):
            if one is not None:
                one.close()
        self.socket = self._patient = None

    def say(self, kind: Kind, size: int = 0) -> int:
        """Send what is in the outbox, with `size` bytes of payload; its number."""
        self.send(self.outbox.seal(kind, size), time.monotonic_ns())
        return self.outbox.sequence

    def send(self, message: memoryview, now: int) -> None:
        """Send a message at `now`, monotonic [ns]; what cannot be sent is lost."""
        self._sent = now
        if self.socket is not None:
            try:
                self.socket.send(message)
            except OSError:
                self.dropped += 1

    def keep_alive(self) -> None:
        """Send a heartbeat where nothing else was sent for a while."""
        if time.monotonic_ns() - self._sent > ALIVE:
            self.say(Kind.HEARTBEAT)

    def receive(self) -> int:
        """Receive a message; its size, -1 if there is none."""
        while self.socket is not None:
            try:
                return self.socket.recv_into(self._buffer)
            except BlockingIOError:
                return -1
            except OSError:
                # The service's machine reports that the port is closed.
                continue
        return -1

    def receive_within(self, wait: float) -> int:
        """Wait for a message, for at most `wait` [s]; its size, -1 if there is none.

        One call of Python waits and receives. It waits whole milliseconds and not for
        longer than this end may be silent: it may return before the time is over.
        """
        if wait != self._wait:
            self._set_wait(wait)
        if self._patient is None or not self._milliseconds:
            return -1
        try:
            return self._patient.recv_into(self._buffer)
        except OSError:
            return -1

    def sleep(self, wait: float) -> None:
        """Sleep until there may be a message, for at most `wait` [s]."""
        if self.socket is not None:
            select.select((self.socket,), (), (), min(wait, ALIVE * NANO))

    def answer(self, size: int) -> Answer | None:
        """The answer in a message of `size` bytes; None if it is none that counts."""
        if size != self._size:
            return None
        fields = FIELDS.unpack_from(self._buffer)
        sequence, a, b = fields[SEQUENCE], fields[BODY_A], fields[BODY_B]
        message = self._command
        if (
            fields[:SEQUENCE] != self._same
            or sequence <= self.last
            or fields[JOINTS : ROBOTS + 1] != self._shape
            or fields[CAUSE] not in CAUSES
            or (a != NOBODY and not (a < self._bodies and b < self._bodies))
            or not self.seal.fits(message)
        ):
            return None
        self.last = sequence
        # The one copy: the next message comes into the same buffer.
        return Answer(bytes(message), fields, self._welcome, self._clock)

    def head(self, size: int) -> Head | None:
        """The header of a message of `size` bytes; None if it does not count."""
        if not LEAST <= size <= MOST:
            return None
        message = self._all[:size]
        head = HEADER.unpack_from(message)
        magic, version, kind, length, session, scene, sender, sequence, stamp = head
        if (magic, version, length, sender) != (MAGIC, VERSION, size, 0):
            return None
        if sequence <= (self.last if session == self._session else 0):
            return None
        if not self.seal.fits(message):
            return None
        return Head(kind, session, scene, sequence, stamp)

    def payload(self, size: int) -> memoryview:
        """The payload of a message of that size; good until the next one comes."""
        return self._all[HEADER.size : size - SEAL]

    def _set_wait(self, wait: float) -> None:
        """Set for how long `receive_within` waits [s]."""
        self._wait = wait
        milliseconds = int(min(max(wait, 0.0), ALIVE * NANO) * 1e3)
        if self._patient is not None and milliseconds not in (0, self._milliseconds):
            # The socket rounds up to milliseconds.
            self._patient.settimeout(milliseconds * 1e-3 - 1e-6)
        self._milliseconds = milliseconds
