"""A socket to one service, which of its messages count, and the STATEs to it."""

import secrets
import select
import socket
import time
from collections.abc import Callable
from math import nan
from reprlib import repr as brief
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import NoServiceError, RefusedError, known_names
from armguard.service.client.answer import CAUSES, NANO, Answer
from armguard.service.client.arguments import numbers_of
from armguard.service.client.welcome import NOTHING, Welcome
from armguard.service.wire import Form, Kind, Outbox, Seal
from armguard.service.wire.layout import (
    COMMAND,
    HAS_VELOCITY,
    HAS_WISH,
    HEADER,
    LEAST,
    MAGIC,
    MOST,
    NO_BODY,
    SEAL,
    STATE,
    VERSION,
    WISH,
    Header,
    command_size,
)
from armguard.service.wire.pulses import Pulses

Floats = NDArray[np.float64]

# The service forgets a client that is silent for longer than a few of these [ns].
ALIVE = 200_000_000


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
        # The same socket once more, which waits: the time of the last wait [s], and
        # whole milliseconds of that.
        self._patient: socket.socket | None = None
        self._wait, self._milliseconds = nan, 0
        # Room beyond the longest message shows that one is too long.
        self._buffer = bytearray(MOST + 8)
        self._all = memoryview(self._buffer)
        # Fits nothing until `open` brings a key.
        self._begin(secrets.token_bytes(16))

    def _begin(self, key: bytes) -> None:
        """Become a new sender that knows no service yet."""
        # The service remembers the sequence of the sender before.
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
        self._size = size = command_size(robots, joints)
        self._command = self._all[:size]
        # What is the same in the headers of all its COMMANDs.
        self._same = MAGIC, VERSION, Kind.COMMAND, size, session, scene, 0
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

    def say(self, kind: Kind, *parts: bytes) -> int:
        """Send a message whose payload is these parts; its number."""
        self.send(self.outbox.message(kind, *parts), time.monotonic_ns())
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

    def sleep(self, wait: float, *beside: Pulses) -> None:
        """Sleep until there may be a message or a pulse, for at most `wait` [s]."""
        if self.socket is not None:
            sources: list[Any] = [self.socket, *beside]
            select.select(sources, (), (), min(wait, ALIVE * NANO))

    def answer(self, size: int) -> Answer | None:
        """The answer in a message of `size` bytes; None if it is none that counts."""
        if size != self._size:
            return None
        message, head = self._command, HEADER.values(self._buffer)
        sequence, stamp = head[-2:]
        command = COMMAND.unpack_from(self._buffer, HEADER.size)
        a, b = command.body_a, command.body_b
        if (
            head[:-2] != self._same
            or sequence <= self.last
            or (command.joints, command.robots) != self._shape
            or command.cause not in CAUSES
            or (a != NO_BODY and not (a < self._bodies and b < self._bodies))
            or not self.seal.fits(message)
        ):
            return None
        self.last = sequence
        # The one copy: the next message is received into the same buffer.
        sent = stamp * NANO
        return Answer(bytes(message), command, sent, self._welcome, self._clock)

    def head(self, size: int) -> Header | None:
        """The header of a message of `size` bytes; None if it does not count."""
        if not LEAST <= size <= MOST:
            return None
        message = self._all[:size]
        head = HEADER.unpack_from(message)
        right = MAGIC, VERSION, size, 0
        last = self.last if head.session == self._session else 0
        if (head.magic, head.version, head.length, head.sender) != right:
            return None
        return head if head.sequence > last and self.seal.fits(message) else None

    def payload(self, size: int) -> memoryview:
        """The payload of a message of that size; good until the next `receive`."""
        return self._all[HEADER.size : size - SEAL]

    def _set_wait(self, wait: float) -> None:
        """Set for how long `receive_within` waits [s]."""
        self._wait = wait
        milliseconds = int(min(max(wait, 0.0), ALIVE * NANO) * 1e3)
        if self._patient is not None and milliseconds not in (0, self._milliseconds):
            # The socket rounds up to milliseconds.
            self._patient.settimeout(milliseconds * 1e-3 - 1e-6)
        self._milliseconds = milliseconds


class StateMessage:
    """The STATEs of one client about the same robots.

    Attributes:
        bits: Its robots: bit k for robot k.

    Args:
        connection: Sends them; it knows session and scene by now.
        welcome: Description of the service.
        robots: Names of the robots, or the name of one; all if None.
        velocities: Whether it holds velocities.
        desired: Whether it holds desired velocities.

    Raises:
        RefusedError: There is no robot of that name.
    """

    def __init__(
        self,
        connection: Connection,
        welcome: Welcome,
        robots: str | tuple[str, ...] | None,
        *,
        velocities: bool,
        desired: bool,
    ) -> None:
        self._outbox, self._seal = connection.outbox, connection.seal
        named = welcome.robots if robots is None else robots
        names = (named,) if isinstance(named, str) else named
        for name in names:
            if name not in welcome.robots:
                raise RefusedError(
                    f"the scene has no robot '{name}'; {known_names(welcome.robots)}"
                )
        own = {welcome.robots.index(name) for name in names}
        self.bits = sum(1 << k for k in own)
        self._joints = joints = sum(welcome.parts[k].count for k in own)
        row = ("<f8", (joints,))
        fields: list[Any] = [("head", HEADER.dtype), ("state", STATE.dtype)]
        fields.append(("q", *row))
        if velocities:
            fields.append(("velocity", *row))
        if desired:
            fields += [("request", WISH.dtype), ("desired", *row)]
        message = np.zeros(1, np.dtype([*fields, ("seal", "u1", (SEAL,))]))
        self._message = message.view(np.uint8).data
        outbox, size = self._outbox, message.itemsize
        scene = outbox.session, outbox.scene, connection.sender
        HEADER.put(self._message, 0, MAGIC, VERSION, Kind.STATE, size, *scene, 0, 0)
        flags = (HAS_VELOCITY if velocities else 0) | (HAS_WISH if desired else 0)
        message["state"]["robots"], message["state"]["flags"] = self.bits, flags
        # All that changes from one to the next. A memoryview takes as many float64 as
        # there are and nothing else, and takes them faster than an array.
        head = message["head"]
        self._sequence, self._sent = head["sequence"].data, head["stamp"].data
        self._stamp: Any = message["state"]["stamp"].data
        self._q: Any = message["q"][0].data
        self._q[:] = np.full(joints, np.nan)
        self._velocity: Any = message["velocity"][0].data if velocities else None
        self._desired: Any = message["desired"][0].data if desired else None
        if desired:
            request = message["request"]
            request["form"], request["numbers"] = Form.VELOCITIES, joints
            self._token = request["token"].data

    @property
    def q(self) -> Floats:
        """Positions in the last one, NaN before it, shape (k,) [rad or m]."""
        return np.array(self._q)

    def write(
        self,
        now: int,
        stamp: float,
        q: ArrayLike,
        velocity: ArrayLike | None,
        desired: ArrayLike | None = None,
        token: int = 0,
    ) -> memoryview:
        """The next one; good until the one after it.

        Args:
            now: The client's monotonic clock [ns].
            stamp: When it was measured, on the service's clock [s].
            q: Positions, shape (k,) [rad or m].
            velocity: Velocities, shape (k,), if it holds any [rad/s or m/s].
            desired: Desired velocities, shape (k,), if it holds any [rad/s or m/s].
            token: The commander's token.

        Raises:
            RefusedError: An array has another number of joints.
        """
        outbox = self._outbox
        outbox.sequence = sequence = outbox.sequence + 1
        self._sequence[0], self._sent[0] = sequence, now + outbox.ahead
        try:
            self._stamp[0] = stamp
        except TypeError:
            said = f"stamp is {brief(stamp)}; it must be a number [s]"
            raise RefusedError(said) from None
        # Without numbers here those of the last message would be sent again.
        if self._desired is not None:
            self._token[0] = token
        try:
            self._q[:] = q
            if velocity is not None:
                self._velocity[:] = velocity
            if self._desired is not None:
                self._desired[:] = desired
        except (TypeError, ValueError, NotImplementedError):
            self._convert(self._q, q, "q")
            if velocity is not None:
                self._convert(self._velocity, velocity, "velocity")
            if self._desired is not None:
                self._convert(self._desired, desired, "the desired motion")
        self._seal.put(self._message)
        return self._message

    def _convert(self, row: Any, values: ArrayLike | None, name: str) -> None:
        """Write numbers of another kind."""
        row[:] = numbers_of(values, name, self._joints)
