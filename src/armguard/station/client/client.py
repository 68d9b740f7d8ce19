"""A client of the service: controller, commander, observer, or all of them."""

import json
import math
import secrets
import select
import socket
import time
from collections import deque
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.station.client.answer import Answer, read_answer, stop_answer
from armguard.station.client.clock import ServiceClock
from armguard.station.client.enums import words
from armguard.station.client.welcome import Welcome, read_welcome
from armguard.station.errors import NoServiceError, RefusedError
from armguard.station.wire.boot import boot_id
from armguard.station.wire.layout import (
    CLAIM,
    GIVE_BACK,
    GRANT,
    HAS_VELOCITY,
    HAS_WISH,
    HEADER,
    HEARTBEAT,
    HELLO,
    LEAST,
    MAGIC,
    MOST,
    REPLY,
    SEAL,
    SENSOR,
    STATE,
    TWIST,
    VERSION,
    WELCOME,
    WISH,
    Form,
    Kind,
)
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.seal import Seal
from armguard.station.wire.words import Cause

Floats = NDArray[np.float64]

# Answers that wait to be received; older ones are given up.
KEPT = 256

# A question that was not answered is asked again after this time [s].
AGAIN = 0.2

# Who listens says so this often, or the service forgets him [s].
ALIVE = 0.2

NANO = 1e-9


class Client:
    """Talks to a service; from one thread.

    Its watchdog needs no thread: whoever asks for `latest` gets a stop if the newest
    answer is too old, however long nobody asked.

    Attributes:
        clock: The service's clock; `client.clock()` is its time now [s].
        dropped: Messages that came in and were none, or old.

    Args:
        port: Port of the service.
        host: Its address.
        key: Its key; empty for the public word.
        watchdog: After that much silence of the service its last answer is a stop [s].
        name: What to be called in its log.
        sensor: Whether to place and remove objects without commanding.
        every: Cycles to one answer of those this client did not ask for; 0 for none.

    Example:
        >>> from armguard.station.client import Client
        >>> Client(port=1).latest.cause.name
        'NOT_CONNECTED'
    """

    def __init__(
        self,
        port: int = 47800,
        host: str = "127.0.0.1",
        key: bytes = b"",
        watchdog: float = 0.1,
        *,
        name: str = "",
        sensor: bool = False,
        every: int = 1,
    ) -> None:
        self.clock = ServiceClock()
        self.dropped = 0
        self._address = (host, port)
        self._watchdog = watchdog
        self._name = name.encode()[:64]
        self._flags = SENSOR if sensor else 0
        self._every = every
        self._seal = Seal(key)
        self._sender = secrets.randbits(63) | 1
        self._outbox = Outbox(self._seal, self._sender)
        self._socket: socket.socket | None = None
        self._buffer = bytearray(MOST + 8)
        self._message = memoryview(self._buffer)
        self._welcome: Welcome | None = None
        self._parts: dict[int, bytes] = {}
        self._part_of = 0
        self._answers: deque[Answer] = deque(maxlen=KEPT)
        self._newest: Answer | None = None
        self._position: Floats = np.zeros(0)
        self._heard = self._sent = 0.0
        self._gone = False
        self._token = 0
        self._grant: tuple[bool, int, int] | None = None
        self._replies: dict[int, bytes] = {}
        self._calls = 0
        self._asked = False
        # Number of the service's last message, and of a call under way: of its
        # message, and its own.
        self._last = 0
        self._waiting = (0, 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def welcome(self) -> Welcome:
        """What the service told about itself.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
        """
        if self._welcome is None:
            raise NoServiceError("not connected: call connect() first")
        return self._welcome

    @property
    def connected(self) -> bool:
        """Whether a service has said what it is."""
        return self._welcome is not None

    @property
    def sender(self) -> int:
        """Number by which the service knows this client."""
        return self._sender

    @property
    def commands(self) -> bool:
        """Whether this client has the command, as far as it has heard."""
        return self._token != 0

    def connect(self, timeout: float = 3.0) -> Welcome:
        """Say hello, also to a service that was started anew.

        Args:
            timeout: How long to wait for an answer [s].

        Raises:
            NoServiceError: None came.
        """
        words()
        self.close()
        # A new sender: the service remembers the old one's sequence.
        self._sender = secrets.randbits(63) | 1
        self._outbox = Outbox(self._seal, self._sender)
        self._welcome, self._newest, self._gone = None, None, False
        self._parts, self._token, self._asked = {}, 0, False
        self._answers.clear()
        self._last = 0
        self.clock = ServiceClock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            # From now on it takes messages of the service alone.
            self._socket.connect(self._address)
        except OSError as error:
            self.close()
            host, port = self._address
            raise NoServiceError(f"{host}:{port}: {error}") from error
        self._socket.setblocking(False)
        end = time.monotonic() + timeout
        while not self.connected:
            left = end - time.monotonic()
            if left <= 0.0:
                self.close()
                host, port = self._address
                raise NoServiceError(
                    f"no service answers at {host}:{port} within {timeout} s; either "
                    "none runs there, or it has another key"
                )
            self._hello()
            self._wait(lambda: self.connected, min(left, AGAIN))
        return self.welcome

    def send_state(
        self,
        q: ArrayLike,
        velocity: ArrayLike | None = None,
        stamp: float | None = None,
        *,
        robots: str | tuple[str, ...] | None = None,
    ) -> int:
        """Tell what was measured, as a controller.

        Args:
            q: Positions of the robots' joints in their order, shape (k,) [rad or m].
            velocity: Their velocities, shape (k,); the guard estimates them if None.
            stamp: When they were measured, on the service's clock; now if None [s].
            robots: Which robots; all of them if None.

        Returns:
            Number of the message.
        """
        size = self._put_state(q, velocity, stamp, robots, 0)
        return self._send(Kind.STATE, size)

    def claim(self, force: bool = False, timeout: float = 1.0) -> None:
        """Take the command.

        Args:
            force: Whether to take it from who has it.
            timeout: How long to wait for the answer [s].

        Raises:
            RefusedError: Somebody else has it.
            NoServiceError: The service does not answer.
        """
        self._grant = None
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0.0:
            CLAIM.pack_into(self._outbox.payload, 0, force, 0)
            self._send(Kind.CLAIM, CLAIM.size)
            self._wait(lambda: self._granted() is not None, min(left, AGAIN))
            grant = self._granted()
            if grant is not None:
                granted, token, holder = grant
                if not granted:
                    raise RefusedError(
                        f"client {holder:x} has the command; wait until it gives it "
                        "back, or claim it with force"
                    )
                self._token = token
                return
        raise NoServiceError("the service does not answer")

    def give_back(self) -> None:
        """Give the command back."""
        if self._token:
            GIVE_BACK.pack_into(self._outbox.payload, 0, self._token)
            self._send(Kind.GIVE_BACK, GIVE_BACK.size)
            self._token = 0

    def send_velocities(self, velocities: ArrayLike) -> None:
        """Wish for joint velocities, as the commander; again and again.

        Args:
            velocities: In the order of `Welcome.names`, shape (n,) [rad/s or m/s].
        """
        self._send(Kind.WISH, self._put_wish(0, Form.VELOCITIES, vector(velocities)))

    def send_positions(self, positions: ArrayLike) -> None:
        """Wish for joint positions, as the commander; again and again.

        Args:
            positions: In the order of `Welcome.names`, shape (n,) [rad or m].
        """
        self._send(Kind.WISH, self._put_wish(0, Form.POSITIONS, vector(positions)))

    def send_twists(self, twists: Mapping[str, ArrayLike]) -> None:
        """Wish for velocities of tools, as the commander; again and again.

        Args:
            twists: By tool, see `Guard.filter_twists`, shape (6,) [m/s], [rad/s].

        Raises:
            RefusedError: There is no such tool.
        """
        tools = self.welcome.tools
        rows = []
        for name, twist in twists.items():
            if name not in tools:
                raise RefusedError(f"the scene has no tool '{name}'")
            rows.append(np.concatenate(([tools.index(name)], vector(twist))))
        values = np.concatenate(rows) if rows else np.zeros(0)
        if len(values) != TWIST * len(rows):
            raise RefusedError("a twist has six numbers")
        self._send(Kind.WISH, self._put_wish(0, Form.TWISTS, values))

    def cycle(
        self,
        q: ArrayLike,
        v_desired: ArrayLike,
        velocity: ArrayLike | None = None,
        stamp: float | None = None,
        timeout: float | None = None,
    ) -> Answer:
        """Controller and commander in one: a state, a wish, and the answer to both.

        The command is claimed with the first one.

        Args:
            q: Measured positions, see `send_state`, shape (n,).
            v_desired: Velocities the operators want, shape (n,) [rad/s or m/s].
            velocity: Measured velocities, shape (n,).
            stamp: When they were measured [s].
            timeout: How long to wait; the watchdog if None [s].

        Returns:
            The answer; a stop if none came in time.

        Raises:
            RefusedError: Somebody else has the command; with the first one only.
        """
        if not self._asked:
            self.claim()
            self._asked = True
        start = self._put_state(q, velocity, stamp, None, HAS_WISH)
        wish = np.asarray(v_desired, dtype=np.float64)
        sequence = self._send(Kind.STATE, self._put_wish(start, Form.VELOCITIES, wish))

        def answered() -> bool:
            newest = self._newest
            return newest is not None and newest.answers(self._sender, sequence)

        wait = self._watchdog if timeout is None else timeout
        self._wait(answered, wait)
        self._answers.clear()
        if self._newest is not None and answered():
            return self._newest
        latest = self.latest
        return latest if latest.cause.stops else self._stopped(Cause.NO_ANSWER)

    def receive(self, timeout: float = 0.0) -> Answer | None:
        """The next answer that came in; None if there is none in time."""
        self._drain()
        if not self._answers and timeout > 0.0:
            self._wait(lambda: bool(self._answers), timeout)
        self._keep_alive()
        return self._answers.popleft() if self._answers else None

    @property
    def latest(self) -> Answer:
        """The newest answer, or a stop where that is older than the watchdog."""
        if self._welcome is None:
            return self._stopped(Cause.NOT_CONNECTED)
        self._drain()
        self._keep_alive()
        if self._gone:
            return self._stopped(Cause.SERVICE_GONE)
        limit = self._watchdog + self._uncertain()
        newest, now = self._newest, self.clock()
        if newest is not None and now - newest.sent <= limit:
            return newest
        silent = now - self._heard > limit
        return self._stopped(Cause.SERVICE_SILENT if silent else Cause.NO_ANSWER)

    def call(self, call: str, /, *, timeout: float = 10.0, **arguments: Any) -> Any:
        """Call something between two cycles, see docs/service.md.

        Args:
            call: What: "engage", "grasp", "release", "allow", "swap_model", "place",
                "remove", "retreat", "field_goal", "reset", "configure", "why", "stop",
                "ping".
            timeout: How long to wait for the reply [s].
            arguments: Its arguments; poses as `Pose` or transforms (4, 4).

        Raises:
            RefusedError: The service refused; its sentence says why.
            NoServiceError: It does not answer.
        """
        self._calls += 1
        number = self._calls
        request = {"id": number, "call": call, "arguments": arguments}
        data = json.dumps(request, default=as_json).encode()
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0.0:
            payload = self._outbox.payload
            if len(data) > len(payload):
                raise RefusedError(f"call '{call}' is too long for a message")
            payload[: len(data)] = data
            sequence = self._send(Kind.CALL, len(data))
            self._replies.setdefault(number, b"")
            self._waiting = (sequence, number)
            self._wait(lambda: bool(self._replies[number]), min(left, AGAIN))
            if self._replies[number]:
                reply = json.loads(self._replies.pop(number))
                if reply["ok"]:
                    return reply["result"]
                raise RefusedError(reply["sentence"], reply["error"])
        self._replies.pop(number, None)
        raise NoServiceError(f"the service does not answer the call '{call}'")

    def stop(self) -> None:
        """Order a stop of all robots; whoever is connected may."""
        self._send(Kind.STOP, 0)

    def close(self) -> None:
        """Say good-bye."""
        if self._socket is None:
            return
        if self._welcome is not None and not self._gone:
            self._send(Kind.BYE, 0)
        self._socket.close()
        self._socket = None
        self._welcome = None

    def _put_state(
        self,
        q: ArrayLike,
        velocity: ArrayLike | None,
        stamp: float | None,
        robots: str | tuple[str, ...] | None,
        flags: int,
    ) -> int:
        """Write a STATE; how many bytes of payload it has."""
        welcome, payload = self.welcome, self._outbox.payload
        if robots is None:
            bits = (1 << len(welcome.robots)) - 1
        else:
            named = (robots,) if isinstance(robots, str) else robots
            bits = sum(1 << welcome.robots.index(name) for name in named)
        values = vector(q)
        at = STATE.size + values.nbytes
        payload[STATE.size : at] = values.view(np.uint8).data
        if velocity is not None:
            flags |= HAS_VELOCITY
            values = vector(velocity)
            payload[at : at + values.nbytes] = values.view(np.uint8).data
            at += values.nbytes
        when = self.clock() if stamp is None else stamp
        STATE.pack_into(payload, 0, bits, flags, when)
        return at

    def _put_wish(self, start: int, form: Form, values: Floats) -> int:
        """Write a wish behind what is there; how many bytes of payload there are."""
        payload = self._outbox.payload
        WISH.pack_into(payload, start, self._token, form, len(values))
        at = start + WISH.size
        payload[at : at + values.nbytes] = values.view(np.uint8).data
        return at + values.nbytes

    def _send(self, kind: Kind, size: int) -> int:
        """Send what was written; its number. What cannot be sent is lost."""
        message = self._outbox.seal(kind, size)
        self._sent = time.monotonic()
        if self._socket is not None:
            try:
                self._socket.send(message)
            except OSError:
                self.dropped += 1
        return self._outbox.sequence

    def _granted(self) -> tuple[bool, int, int] | None:
        """The answer to a claim: whether it was granted, token, who has the command."""
        return self._grant

    def _hello(self) -> None:
        """Say hello."""
        payload = self._outbox.payload
        HELLO.pack_into(payload, 0, self._flags, self._every)
        end = HELLO.size + len(self._name)
        payload[HELLO.size : end] = self._name
        self._send(Kind.HELLO, end)

    def _keep_alive(self) -> None:
        """Let the service know that somebody listens."""
        if time.monotonic() - self._sent > ALIVE:
            self._send(Kind.HEARTBEAT, 0)

    def _uncertain(self) -> float:
        """What the service's clock may be wrong by [s]."""
        bound = self.clock.bound
        return bound if math.isfinite(bound) else 0.0

    def _stopped(self, cause: Cause) -> Answer:
        """What is told where nothing was heard."""
        welcome = self._welcome or NOTHING
        position = self._position
        if len(position) != len(welcome.names):
            position = welcome.home
        return stop_answer(cause, position, welcome, self.clock)

    def _wait(self, done: Any, timeout: float) -> None:
        """Take messages over until something is true, or for that long."""
        end = time.monotonic() + timeout
        while self._socket is not None:
            self._drain(done)
            left = end - time.monotonic()
            if done() or left <= 0.0:
                return
            self._keep_alive()
            select.select((self._socket,), (), (), min(left, ALIVE))

    def _drain(self, done: Any = None) -> None:
        """Take over all messages there are."""
        while self._socket is not None:
            try:
                size = self._socket.recv_into(self._buffer)
            except BlockingIOError:
                return
            except OSError:
                # Nobody listens there: told by the machine of the service.
                continue
            if not self._take(self._message[:size]):
                self.dropped += 1
            elif done is not None and done():
                return

    def _take(self, message: memoryview) -> bool:
        """Take a message over; False if it is none for this client."""
        if not LEAST <= len(message) <= MOST:
            return False
        head = HEADER.unpack_from(message)
        magic, version, kind, length, session, scene, sender, sequence, stamp = head
        if (magic, version, length, sender) != (MAGIC, VERSION, len(message), 0):
            return False
        if not self._seal.fits(message) or sequence <= self._sequence_of(session):
            return False
        if kind == Kind.WELCOME:
            return self._take_welcome(message, session, scene, sequence)
        if self._welcome is None or session != self._outbox.session:
            return False
        self._last = sequence
        self._heard = max(self._heard, stamp * NANO)
        if kind == Kind.COMMAND:
            if scene != self._outbox.scene:
                return False
            try:
                answer = read_answer(message, stamp, self._welcome, self.clock)
            except (ValueError, IndexError):
                return False
            self._newest = answer
            self._answers.append(answer)
            if answer.commander != self._sender:
                # What came before the grant was sent before it, and came before it.
                self._token = 0
        elif kind == Kind.HEARTBEAT:
            if len(message) < HEADER.size + HEARTBEAT.size + SEAL:
                return False
            if HEARTBEAT.unpack_from(message, HEADER.size)[1] != self._sender:
                self._token = 0
        elif kind == Kind.GRANT:
            granted, _, token, holder, _, _ = GRANT.unpack_from(message, HEADER.size)
            self._grant = bool(granted), token, holder
        elif kind == Kind.REPLY:
            (asked,) = REPLY.unpack_from(message, HEADER.size)
            if asked == self._waiting[0]:
                data = bytes(message[HEADER.size + REPLY.size : -SEAL])
                self._replies[self._waiting[1]] = data
        elif kind == Kind.BYE:
            self._gone = True
        return True

    def _sequence_of(self, session: int) -> int:
        """Number of the last message of a session."""
        return self._last if session == self._outbox.session else 0

    def _take_welcome(
        self, message: memoryview, session: int, scene: int, sequence: int
    ) -> bool:
        """Take a part of a WELCOME over."""
        answered = time.monotonic_ns()
        head = WELCOME.unpack_from(message, HEADER.size)
        part, parts, _, _, _, asked, read = head
        if session != self._outbox.session and self._welcome is not None:
            # A service that was started anew has to be connected to anew.
            return False
        if self._welcome is not None:
            self._last = sequence
        if scene != self._part_of:
            self._part_of, self._parts = scene, {}
        self._parts[part] = bytes(message[HEADER.size + WELCOME.size : -SEAL])
        if asked:
            self.clock.learn(asked, read, answered)
        if len(self._parts) < parts:
            return True
        welcome = read_welcome(b"".join(self._parts[k] for k in range(parts)))
        self._parts = {}
        if welcome.boot_id and welcome.boot_id == boot_id():
            self.clock.share()
        if scene != self._outbox.scene:
            self._newest = None
        self._outbox.session, self._outbox.scene = session, scene
        self._welcome = welcome
        return True


# What is known before anybody was connected to.
NOTHING = Welcome(
    names=(),
    robots=(),
    parts=(),
    bodies=(),
    tools=(),
    period=0.0,
    home=np.zeros(0),
    scene_file="",
    scene_hash="",
    ring="",
    counters="",
    session=0,
    version="",
    watchdogs={},
    reasons={},
    boot_id="",
    text={},
)


def vector(values: ArrayLike) -> Floats:
    """Numbers as a row of float64 in one piece."""
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


def as_json(value: Any) -> Any:
    """What JSON has no word for: poses and arrays."""
    if hasattr(value, "matrix"):
        return value.matrix().tolist()
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be sent")
