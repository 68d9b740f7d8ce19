"""A client of the service: controller, commander, observer, or all of them."""

import json
import struct
from collections import deque
from collections.abc import Callable, Mapping
from math import inf
from pathlib import Path
from time import monotonic, monotonic_ns, sleep
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.station.client.answer import NANO, Answer, stop_answer, words
from armguard.station.client.clock import ServiceClock
from armguard.station.client.connection import Connection
from armguard.station.client.state_message import StateMessage
from armguard.station.client.welcome import NOTHING, Welcome, read_welcome
from armguard.station.errors import NoServiceError, RefusedError
from armguard.station.wire import Cause, Form, Keys, Kind, Role
from armguard.station.wire.boot import boot_id
from armguard.station.wire.keys import found_keys, key_of
from armguard.station.wire.layout import (
    CHALLENGE,
    CLAIM,
    GIVE_BACK,
    GRANT,
    HEARTBEAT,
    HELLO,
    NO_COOKIE,
    REFUSAL,
    REPLY,
    TWIST,
    WELCOME,
    WISH,
    Grant,
    Header,
)

Floats = NDArray[np.float64]

# A key file that is not there yet is looked for that often [s].
KEYS_EVERY = 0.02

# Answers that wait to be received; older ones are given up.
KEPT = 256

# A question that was not answered is asked again after this time [s].
AGAIN = 0.2

# A refusal explains a missing answer for that long [s].
RECENT = 0.5


class Client:
    """Exchanges messages with a service; from one thread.

    Its watchdog needs no thread: `latest` is a stop if the newest answer is too old,
    however long it was not asked for. It compares clocks in messages, and not the times
    at which they were read.

    Attributes:
        clock: The service's clock; `client.clock()` is its time now [s].
        refusal: Cause and sentence of the newest refusal of a message of this client;
            None if there was none.

    Args:
        port: Port of the service.
        host: Its address.
        role: Rights of this client; the service knows them by the key that seals its
            messages.
        keys: The service's keys, or a file that holds them; if None the file that
            `ARMGUARD_KEYS` names, else the one that a service of this user on this
            machine has written.
        watchdog: After that much silence of the service its last answer is a stop [s].
        name: Its name in the service's log.
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
        watchdog: float = 0.1,
        *,
        role: Role = Role.COMMAND,
        keys: Keys | str | Path | None = None,
        name: str = "",
        every: int = 1,
    ) -> None:
        self._limit = watchdog
        self._role, self._keys = role, keys
        self._name = name.encode()[:64]
        self._every = every
        self._connection = Connection((host, port))
        # A call that is sent again has the same number, and is not done again.
        self._call_number = 0
        self._forget()

    def _forget(self) -> None:
        """Nothing is known of a service yet."""
        self.clock = ServiceClock()
        self.refusal: tuple[str, str] | None = None
        self._refused = -inf
        self._welcome: Welcome | None = None
        self._cookie = NO_COOKIE
        # Parts of a WELCOME, and the scene of their headers.
        self._scene, self._parts = 0, dict[int, bytes]()
        # Answers that wait to be received, oldest first, and the newest.
        self._answers: deque[Answer] = deque(maxlen=KEPT)
        self._newest: Answer | None = None
        # When the service sent its newest other message, on its clock [s].
        self._heard, self._gone = 0.0, False
        # The commander's token, 0 without the command; the newest GRANT.
        self._token = 0
        self._grant: Grant | None = None
        self._claimed = False
        # Number of the message of the newest call, and its reply.
        self._asked = 0
        self._reply: Mapping[str, Any] = {}
        # Each kind of STATE is made once. Robots whose states were sent, as bits.
        self._states: dict[object, StateMessage] = {}
        self._whole: StateMessage | None = None
        self._measured = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def welcome(self) -> Welcome:
        """Description of the service.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
        """
        if self._welcome is None:
            raise NoServiceError("not connected: call connect() first")
        return self._welcome

    @property
    def connected(self) -> bool:
        """Whether a service has described itself."""
        return self._welcome is not None

    @property
    def port(self) -> int:
        """Port of the service."""
        return self._connection.address[1]

    @property
    def sender(self) -> int:
        """Number by which the service knows this client."""
        return self._connection.sender

    @property
    def commands(self) -> bool:
        """Whether this client has the command, as far as it has heard."""
        return self._token != 0

    @property
    def dropped(self) -> int:
        """Messages that could not be sent, or came in and were none, or old."""
        return self._connection.dropped

    def fileno(self) -> int:
        """Its socket, for a loop that waits for other things too; -1 if it has none.

        With it `select`, `poll` and `asyncio` take a client for a file. When it can be
        read, call `receive` until that is None. Something has to be asked at least
        every 0.2 s all the same: it is then that the service hears that this client
        lives, and `latest` that the service does not. It is another number after
        `connect`.
        """
        one = self._connection.socket
        return -1 if one is None else one.fileno()

    def connect(self, timeout: float = 3.0) -> Welcome:
        """Say hello, also to a service that was started anew.

        Args:
            timeout: How long to wait for an answer [s].

        Raises:
            NoServiceError: None came, or no service of this user runs there.
            KeyFileError: The key file cannot be used.
            RefusedError: The service has no room for another client.
        """
        words()
        self.close()
        self._forget()
        end = monotonic() + timeout
        key, source = self._key(end)
        self._connection.open(key)
        for done in (
            lambda: self._cookie != NO_COOKIE,
            lambda: self.connected or self.refusal,
        ):
            if not self._ask(self._hello, done, end - monotonic()):
                break
        if not self.connected:
            self.close()
            place = self._connection.place
            if self.refusal:
                raise RefusedError(f"the service at {place}: {self.refusal[1]}")
            raise NoServiceError(
                f"no service answers at {place} within {timeout} s; either none runs "
                f"there, or it speaks another version, or its key for "
                f"'{self._role.word}' is not the one in {source}; its log says which"
            )
        return self.welcome

    def _key(self, end: float) -> tuple[bytes, str]:
        """The key of this client's role, and where it came from.

        A service that starts writes its keys first.

        Args:
            end: Until when to wait for them, on the monotonic clock [s].

        Raises:
            NoServiceError: No service of this user has written keys for that port.
            KeyFileError: The file cannot be used, or has no such key.
        """
        while True:
            try:
                keys, source = found_keys(self._keys, self.port)
                break
            except NoServiceError:
                if monotonic() >= end:
                    raise
                sleep(KEYS_EVERY)
        return key_of(self._role, keys, source), source

    def send_state(
        self,
        q: ArrayLike,
        velocity: ArrayLike | None = None,
        stamp: float | None = None,
        *,
        robots: str | tuple[str, ...] | None = None,
    ) -> int:
        """Send measured positions, as a controller.

        Args:
            q: Positions of the robots' joints in their order, shape (k,) [rad or m].
            velocity: Their velocities, shape (k,); the guard estimates them if None.
            stamp: When they were measured, on the service's clock; now if None [s].
            robots: Which robots; all of them if None.

        Returns:
            Number of the message.

        Raises:
            RefusedError: A robot is not there, or something has another number of
                joints.
        """
        if robots is not None and not isinstance(robots, str):
            robots = tuple(robots)
        state = self._state(robots, velocity is not None, False)
        now = monotonic_ns()
        when = now * NANO + self.clock.offset if stamp is None else stamp
        self._connection.send(state.write(now, when, q, velocity), now)
        return self._connection.outbox.sequence

    def claim(self, force: bool = False, timeout: float = 1.0) -> None:
        """Take the command.

        Args:
            force: Whether to take it from its holder; that needs the role ADMINISTER.
            timeout: How long to wait for the answer [s].

        Raises:
            RefusedError: Another client has it, or this one's role may not.
            NoServiceError: The service does not answer.
        """

        def claim() -> None:
            self._grant = None
            self._connection.say(Kind.CLAIM, CLAIM.pack(force))

        self.refusal = None
        if not self._ask(
            claim, lambda: self._grant or self._refused_for("role"), timeout
        ):
            raise NoServiceError("the service does not answer")
        if self._refused_for("role"):
            raise RefusedError(
                f"only a client with the key for 'command' may claim the command; this "
                f"one has the key for '{self._role.word}'"
            )
        grant = self._grant
        assert grant is not None
        if not grant.granted:
            raise RefusedError(
                f"client {grant.holder:x} has the command; wait until it gives it "
                "back, or claim it with force and the key for 'administer'"
            )
        self._token = grant.token

    def give_back(self) -> None:
        """Give the command back."""
        if self._token:
            self._connection.say(Kind.GIVE_BACK, GIVE_BACK.pack(self._token))
            self._token = 0

    def send_velocities(self, velocities: ArrayLike) -> None:
        """Send desired joint velocities, as the commander; again and again.

        Args:
            velocities: In the order of `Welcome.names`, shape (n,) [rad/s or m/s].
        """
        self._send_desired(Form.VELOCITIES, velocities)

    def send_positions(self, positions: ArrayLike) -> None:
        """Send desired joint positions, as the commander; again and again.

        Args:
            positions: In the order of `Welcome.names`, shape (n,) [rad or m].
        """
        self._send_desired(Form.POSITIONS, positions)

    def send_twists(self, twists: Mapping[str, ArrayLike]) -> None:
        """Send desired velocities of tools, as the commander; again and again.

        Args:
            twists: By tool, see `Guard.filter_twists`, shape (6,) [m/s], [rad/s].

        Raises:
            RefusedError: There is no such tool.
        """
        tools, rows = self.welcome.tools, []
        for name, twist in twists.items():
            if name not in tools:
                raise RefusedError(f"the scene has no tool '{name}'")
            rows.append([tools.index(name), *np.asarray(twist, np.float64).flat])
        if any(len(row) != TWIST for row in rows):
            raise RefusedError("a twist has six numbers")
        self._send_desired(Form.TWISTS, rows)

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
            The answer; a stop if none came in time, or if it is too old by now.

        Raises:
            RefusedError: Something has another number of joints; or, with the first
                one only, another client has the command.
        """
        connection = self._connection
        if not self._claimed:
            self.claim()
            self._claimed = True
        state = self._state(None, velocity is not None, True)
        now = monotonic_ns()
        when = now * NANO + self.clock.offset if stamp is None else stamp
        message = state.write(now, when, q, velocity, v_desired, self._token)
        connection.send(message, now)
        own = connection.sender, connection.outbox.sequence
        wait = self._limit if timeout is None else timeout
        size = connection.receive_within(wait)
        if size >= 0:
            self._take(size)
        answer = self._newest
        if answer is None or answer.began != own:
            # Something else came, or nothing; or others begin the cycles.
            answer = self._await_answer(own, now * NANO + wait - monotonic())
        self._answers.clear()
        cause = self._cause()
        if cause is Cause.NONE and answer is not None:
            return answer
        if not cause:
            # The service lives, and has not answered.
            recent = monotonic() - self._refused < RECENT
            foreign = recent and self._refused_for("second_controller")
            cause = Cause.NOT_YOURS if foreign else Cause.NO_ANSWER
        return self._stopped(cause)

    def receive(self, timeout: float = 0.0) -> Answer | None:
        """The next answer that came in; None if there is none in time."""
        self._drain()
        if not self._answers and timeout > 0.0:
            self._wait(lambda: bool(self._answers), timeout)
        self._connection.keep_alive()
        return self._answers.popleft() if self._answers else None

    @property
    def latest(self) -> Answer:
        """The newest answer; a stop if it is too old, or not judged by own states."""
        if self._welcome is None:
            return self._stopped(Cause.NOT_CONNECTED)
        self._drain()
        self._connection.keep_alive()
        cause, newest = self._cause(), self._newest
        if cause is not Cause.NONE or newest is None:
            return self._stopped(cause)
        judged = all(
            row.sender == self.sender
            for k, row in enumerate(newest.numbers if self._measured else ())
            if self._measured >> k & 1
        )
        return newest if judged else self._stopped(Cause.NOT_YOURS)

    def call(self, call: str, /, *, timeout: float = 10.0, **arguments: Any) -> Any:
        """Call something between two cycles, see docs/service.md.

        Args:
            call: Its name, of `armguard.station.calls.CALLS`.
            timeout: How long to wait for the reply [s].
            arguments: Its arguments; poses as `Pose` or transforms (4, 4).

        Raises:
            RefusedError: The service refused; its sentence says why.
            NoServiceError: It does not answer.
        """
        connection = self._connection
        self._call_number += 1
        self._reply = {}
        data = request_of(self._call_number, call, arguments)
        if len(data) > len(connection.outbox.payload):
            raise RefusedError(f"call '{call}' is too long for a message")

        def ask() -> None:
            self._asked = connection.say(Kind.CALL, data)

        if not self._ask(ask, lambda: self._reply, timeout):
            raise NoServiceError(f"the service does not answer the call '{call}'")
        reply = self._reply
        if reply["ok"]:
            return reply["result"]
        raise RefusedError(reply["sentence"], reply["error"], reply.get("reason", ""))

    def stop(self) -> None:
        """Order a stop of all robots; every client may."""
        self._connection.say(Kind.STOP)

    def close(self) -> None:
        """Say good-bye."""
        if self._welcome is not None and not self._gone:
            self._connection.say(Kind.BYE)
        self._connection.close()
        self._welcome = None
        self._states.clear()
        self._measured = 0

    def _hello(self) -> None:
        head = HELLO.pack(self._role, self._every, self._cookie)
        self._connection.say(Kind.HELLO, head, self._name)

    def _send_desired(self, form: Form, values: ArrayLike) -> None:
        """Send a WISH of that form."""
        row = np.asarray(values, dtype=np.float64).reshape(-1)
        head = WISH.pack(self._token, form, len(row))
        self._connection.say(Kind.WISH, head, row.tobytes())

    def _state(
        self, robots: str | tuple[str, ...] | None, velocities: bool, desired: bool
    ) -> StateMessage:
        """The STATE of these robots, see `StateMessage`: numbers have to be written.

        Raises:
            NoServiceError: No service has named its robots.
            RefusedError: There is no robot of that name.
        """
        form = robots, velocities, desired
        state = self._states.get(form)
        if state is None:
            state = self._states[form] = StateMessage(
                *(self._connection, self.welcome, robots),
                velocities=velocities,
                desired=desired,
            )
        if robots is None:
            self._whole = state
        self._measured |= state.bits
        return state

    def _refused_for(self, cause: str) -> bool:
        """Whether this is the cause of the newest refusal."""
        return self.refusal is not None and self.refusal[0] == cause

    def _await_answer(self, own: tuple[int, int], timeout: float) -> Answer | None:
        """The answer to a state of that sender and number, or to a later one of it."""

        def answered() -> bool:
            return self._newest is not None and self._newest.answers(*own)

        self._wait(answered, timeout)
        return self._newest if answered() else None

    def _cause(self) -> Cause:
        """Why the newest answer does not count; NONE if it does."""
        newest, clock = self._newest, self.clock
        now = monotonic() + clock.offset
        # What the clock may be wrong by counts for the answer, if it is known.
        bound = clock.bound
        limit = self._limit + bound if bound < inf else self._limit
        if self._gone:
            return Cause.SERVICE_GONE
        heard = self._heard
        if newest is not None:
            if now - newest.sent <= limit:
                return Cause.NONE
            heard = max(heard, newest.sent)
        return Cause.NO_ANSWER if now - heard <= limit else Cause.SERVICE_SILENT

    def _stopped(self, cause: Cause) -> Answer:
        """A stop, where no message of the service counts."""
        welcome, newest = self._welcome or NOTHING, self._newest
        position: Floats | None = None
        if self._whole is not None:
            position = self._whole.q
        elif newest is not None:
            position = newest.position
        if position is None or len(position) != len(welcome.names):
            # Unknown, rather than where robots may not be.
            position = np.full(len(welcome.names), np.nan)
        return stop_answer(cause, position, welcome, self.clock)

    def _ask(
        self, say: Callable[[], None], done: Callable[[], object], timeout: float
    ) -> bool:
        """Say something again and again until it is answered; whether it was."""
        end = monotonic() + timeout
        while (left := end - monotonic()) > 0.0:
            say()
            self._wait(done, min(left, AGAIN))
            if done():
                return True
        return False

    def _wait(self, done: Callable[[], object], timeout: float) -> None:
        """Take messages over until something is true, or for that long."""
        end = monotonic() + timeout
        while self._connection.socket is not None:
            self._drain(done)
            left = end - monotonic()
            if done() or left <= 0.0:
                return
            self._connection.keep_alive()
            self._connection.sleep(left)

    def _drain(self, done: Callable[[], object] | None = None) -> None:
        """Take all messages over that there are, or until something is true."""
        while (size := self._connection.receive()) >= 0:
            self._take(size)
            if done is not None and done():
                return

    def _take(self, size: int) -> None:
        """Take a message over that was received; one that does not count is dropped."""
        connection = self._connection
        answer = connection.answer(size)
        if answer is not None:
            self._newest = answer
            self._answers.append(answer)
            if answer.commander != connection.sender:
                # What came before the grant was sent before it, and came before it.
                self._token = 0
            return
        head = connection.head(size)
        try:
            if head is None or not self._take_other(head, connection.payload(size)):
                connection.dropped += 1
        except (struct.error, ValueError, KeyError):
            # Its payload is none of its kind.
            connection.dropped += 1

    def _take_other(self, head: Header, payload: memoryview) -> bool:
        """Take over what is no answer; False if it does not count."""
        connection, kind = self._connection, head.kind
        known = head.session == connection.outbox.session
        if kind == Kind.WELCOME:
            return self._take_welcome(head, payload)
        if kind == Kind.CHALLENGE:
            challenge = CHALLENGE.unpack_from(payload)
            if self._welcome is not None or challenge.asked < connection.opened:
                # It is that of an older HELLO.
                return False
            connection.outbox.session = head.session
            self._cookie = challenge.cookie
            return True
        if kind == Kind.REFUSAL and known:
            text = bytes(payload[REFUSAL.size :]).decode()
            cause, _, sentence = text.partition(":")
            self.refusal, self._refused = (cause, sentence), monotonic()
            return True
        if self._welcome is None or not known:
            return False
        connection.last = head.sequence
        self._heard = max(self._heard, head.stamp * NANO)
        if kind == Kind.HEARTBEAT:
            if HEARTBEAT.unpack_from(payload).commander != connection.sender:
                self._token = 0
        elif kind == Kind.GRANT:
            self._grant = GRANT.unpack_from(payload)
        elif kind == Kind.REPLY:
            if REPLY.unpack_from(payload).sequence == self._asked:
                self._reply = json.loads(bytes(payload[REPLY.size :]))
        elif kind == Kind.BYE:
            self._gone = True
        return kind != Kind.COMMAND

    def _take_welcome(self, head: Header, payload: memoryview) -> bool:
        """Take a part of a WELCOME over; False if it is another service's."""
        connection, outbox = self._connection, self._connection.outbox
        if self._welcome is not None:
            if head.session != outbox.session:
                # A service that was started anew has to be connected to anew.
                return False
            connection.last = head.sequence
        found = WELCOME.unpack_from(payload)
        if head.scene != self._scene:
            # Parts about another scene are given up.
            self._scene, self._parts = head.scene, {}
        self._parts[found.part] = bytes(payload[WELCOME.size :])
        if found.asked:
            self.clock.learn(found.asked, found.received, monotonic_ns())
        if len(self._parts) < found.parts:
            return True
        text = b"".join(self._parts[k] for k in range(found.parts))
        self._parts = {}
        welcome = read_welcome(text)
        if welcome.boot_id and welcome.boot_id == boot_id():
            self.clock.share()
        if head.scene != outbox.scene:
            self._newest = None
        outbox.session, outbox.scene = head.session, head.scene
        # The earliest time it may be: a message is never older than its stamp says.
        outbox.ahead = round((self.clock.offset - self.clock.bound) / NANO)
        connection.expect(head.session, head.scene, welcome, self.clock)
        self._welcome = welcome
        self._states.clear()
        self._measured = 0
        return True


def request_of(number: int, call: str, arguments: Mapping[str, Any]) -> bytes:
    """The JSON of a call, by the number of the call."""
    request = {"id": number, "call": call, "arguments": arguments}
    return json.dumps(request, default=as_json).encode()


def as_json(value: Any) -> Any:
    """Poses and arrays, for which JSON has no word."""
    if hasattr(value, "matrix"):
        return value.matrix().tolist()
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be sent")
