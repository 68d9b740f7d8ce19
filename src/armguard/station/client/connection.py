"""A socket to one service: what is sent and received, and when anything was."""

import secrets
import select
import socket
import time
from math import nan

from armguard.station.client.inbox import Inbox
from armguard.station.errors import NoServiceError
from armguard.station.wire.layout import Kind
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.seal import Seal

# Who listens says so this often, or the service forgets him [ns].
ALIVE = 200_000_000

NANO = 1e-9


class Connection:
    """One end of the messages; who opens it anew is another sender.

    Attributes:
        address: Host and port of the service.
        sender: Number by which the service knows this end.
        seal: Seals messages.
        outbox: Where messages are written.
        inbox: Where messages are received.
        socket: The socket; None before `open` and after `close`.
        opened: When it was opened, monotonic [ns].
        dropped: Messages that could not be sent, and others that did not count.

    Args:
        address: See there.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        # Fits nothing until `open` brings a key.
        self.seal = Seal(secrets.token_bytes(16))
        self.sender = secrets.randbits(63) | 1
        self.outbox = Outbox(self.seal, self.sender)
        self.inbox = Inbox(self.seal)
        self.socket: socket.socket | None = None
        self.dropped = self.opened = 0
        self.address = address
        # The same socket once more, which waits: for how long it was asked to [s], and
        # whole milliseconds of that.
        self._patient: socket.socket | None = None
        self._wait = nan
        self._milliseconds = 0
        self._sent = 0

    @property
    def place(self) -> str:
        """Where the service is."""
        host, port = self.address
        return f"{host}:{port}"

    def open(self, key: bytes) -> None:
        """Send and receive messages that are sealed with a key, from now on.

        Args:
            key: The key.

        Raises:
            NoServiceError: There is no way there.
        """
        # The service remembers the sequence of the sender that was here before.
        self.opened = time.monotonic_ns()
        self.sender, self.seal = secrets.randbits(63) | 1, Seal(key)
        self.outbox, self.inbox = Outbox(self.seal, self.sender), Inbox(self.seal)
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
        """Send what was written into the outbox; its number.

        Args:
            kind: What it is.
            size: Bytes of its payload.
        """
        self.send(self.outbox.seal(kind, size), time.monotonic_ns())
        return self.outbox.sequence

    def send(self, message: memoryview, now: int) -> None:
        """Send a message; what cannot be sent is lost.

        Args:
            message: The message.
            now: Monotonic clock [ns].
        """
        self._sent = now
        if self.socket is not None:
            try:
                self.socket.send(message)
            except OSError:
                self.dropped += 1

    def keep_alive(self) -> None:
        """Let the service know that somebody listens."""
        if time.monotonic_ns() - self._sent > ALIVE:
            self.say(Kind.HEARTBEAT)

    def receive(self) -> int:
        """Receive a message into the inbox; its size, -1 if there is none."""
        while self.socket is not None:
            try:
                return self.socket.recv_into(self.inbox.buffer)
            except BlockingIOError:
                return -1
            except OSError:
                # Nobody listens there: told by the machine of the service.
                continue
        return -1

    def receive_within(self, wait: float) -> int:
        """Wait for a message; its size, -1 if there is none.

        One call of Python waits and receives. It waits whole milliseconds and not for
        longer than this end may be silent: it may return before the time is over.

        Args:
            wait: For how long at most [s].
        """
        if wait != self._wait:
            self._set_wait(wait)
        if self._patient is None or not self._milliseconds:
            return -1
        try:
            return self._patient.recv_into(self.inbox.buffer)
        except OSError:
            return -1

    def sleep(self, wait: float) -> None:
        """Sleep until there may be a message.

        Args:
            wait: For how long at most [s].
        """
        if self.socket is not None:
            select.select((self.socket,), (), (), min(wait, ALIVE * NANO))

    def _set_wait(self, wait: float) -> None:
        """For how long `receive_within` waits."""
        self._wait = wait
        milliseconds = int(min(max(wait, 0.0), ALIVE * NANO) * 1e3)
        if self._patient is not None and milliseconds not in (0, self._milliseconds):
            # The socket rounds up to milliseconds.
            self._patient.settimeout(milliseconds * 1e-3 - 1e-6)
        self._milliseconds = milliseconds
