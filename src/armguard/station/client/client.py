"""A client of the service: controller, commander, observer, or all of them."""

from collections.abc import Mapping
from pathlib import Path
from time import monotonic, monotonic_ns, sleep
from types import TracebackType
from typing import Any, Self

from numpy.typing import ArrayLike

from armguard.station.client.answer import NANO, Answer
from armguard.station.client.calls import Calls
from armguard.station.client.connection import Connection
from armguard.station.client.dialogue import Dialogue
from armguard.station.client.enums import words
from armguard.station.client.welcome import Welcome
from armguard.station.client.wishes import put_wish, twist_rows
from armguard.station.errors import NoServiceError, RefusedError
from armguard.station.wire.keys import (
    Keys,
    Role,
    found_keys,
    key_of,
)
from armguard.station.wire.layout import GIVE_BACK, HELLO, NO_COOKIE, Form, Kind
from armguard.station.wire.words import Cause

# A key file that is not there yet is looked for that often [s].
KEYS_EVERY = 0.02


class Client:
    """Talks to a service; from one thread.

    Its watchdog needs no thread: whoever asks for `latest` gets a stop if the newest
    answer is too old, however long nobody asked.

    Attributes:
        clock: The service's clock; `client.clock()` is its time now [s].

    Args:
        port: Port of the service.
        host: Its address.
        role: What this client is to be allowed; the service knows it by the key that
            seals its messages.
        keys: The service's keys, or a file that holds them; if None the file that
            `ARMGUARD_KEYS` names, else the one that a service of this user on this
            machine has written.
        watchdog: After that much silence of the service its last answer is a stop [s].
        name: What to be called in its log.
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
        self._calls = Calls()
        self._forget()

    def _forget(self) -> None:
        """Nothing is known of a service yet."""
        self._dialogue = Dialogue(self._connection, self._calls, self._limit)
        self.clock = self._dialogue.clock

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
        if self._dialogue.welcome is None:
            raise NoServiceError("not connected: call connect() first")
        return self._dialogue.welcome

    @property
    def connected(self) -> bool:
        """Whether a service has said what it is."""
        return self._dialogue.welcome is not None

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
        return self._dialogue.command.token != 0

    @property
    def refusal(self) -> tuple[str, str] | None:
        """Why the service dropped a message of this client last: cause and sentence."""
        return self._dialogue.refusal

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
        dialogue = self._dialogue
        if dialogue.ask(
            self._hello, lambda: dialogue.cookie != NO_COOKIE, end - monotonic()
        ):
            dialogue.ask(
                self._hello,
                lambda: self.connected or dialogue.refusal,
                end - monotonic(),
            )
        if not self.connected:
            self.close()
            place = self._connection.place
            if dialogue.refusal:
                raise RefusedError(f"the service at {place}: {dialogue.refusal[1]}")
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
        """Tell what was measured, as a controller.

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
        state = self._dialogue.states.of(robots, velocity is not None, False)
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
        connection, command = self._connection, self._dialogue.command

        def claim() -> None:
            size = command.write(connection.outbox.payload, force)
            connection.say(Kind.CLAIM, size)

        dialogue = self._dialogue
        dialogue.refusal = None

        def answered() -> bool:
            return command.grant is not None or dialogue.may_not

        if not dialogue.ask(claim, answered, timeout):
            raise NoServiceError("the service does not answer")
        if dialogue.may_not:
            raise RefusedError(
                f"only a client with the key for 'command' may claim the command; this "
                f"one has the key for '{self._role.word}'"
            )
        granted, token, holder = command.grant or (False, 0, 0)
        if not granted:
            raise RefusedError(
                f"client {holder:x} has the command; wait until it gives it back, or "
                "claim it with force and the key for 'administer'"
            )
        command.token = token

    def give_back(self) -> None:
        """Give the command back."""
        if self._dialogue.command.token:
            outbox = self._connection.outbox
            GIVE_BACK.pack_into(outbox.payload, 0, self._dialogue.command.token)
            self._connection.say(Kind.GIVE_BACK, GIVE_BACK.size)
            self._dialogue.command.token = 0

    def send_velocities(self, velocities: ArrayLike) -> None:
        """Wish for joint velocities, as the commander; again and again.

        Args:
            velocities: In the order of `Welcome.names`, shape (n,) [rad/s or m/s].
        """
        self._wish(Form.VELOCITIES, velocities)

    def send_positions(self, positions: ArrayLike) -> None:
        """Wish for joint positions, as the commander; again and again.

        Args:
            positions: In the order of `Welcome.names`, shape (n,) [rad or m].
        """
        self._wish(Form.POSITIONS, positions)

    def send_twists(self, twists: Mapping[str, ArrayLike]) -> None:
        """Wish for velocities of tools, as the commander; again and again.

        Args:
            twists: By tool, see `Guard.filter_twists`, shape (6,) [m/s], [rad/s].

        Raises:
            RefusedError: There is no such tool.
        """
        self._wish(Form.TWISTS, twist_rows(self.welcome.tools, twists))

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
                one only, somebody else has the command.
        """
        dialogue, connection = self._dialogue, self._connection
        command, watchdog = dialogue.command, dialogue.watchdog
        if not command.claimed:
            self.claim()
            command.claimed = True
        state = dialogue.states.of(None, velocity is not None, True)
        now = monotonic_ns()
        when = now * NANO + self.clock.offset if stamp is None else stamp
        message = state.write(now, when, q, velocity, v_desired, command.token)
        connection.send(message, now)
        own = connection.sender, connection.outbox.sequence
        wait = self._limit if timeout is None else timeout
        size = connection.receive_within(wait)
        if size >= 0:
            dialogue.take(size)
        answer = watchdog.newest
        if answer is None or answer.began != own:
            # Something else came, or nothing; or others begin the cycles.
            answer = dialogue.await_answer(own, now * NANO + wait - monotonic())
        dialogue.answers.clear()
        cause = watchdog.cause
        if cause is Cause.NONE and answer is not None:
            return answer
        return dialogue.stopped(cause or dialogue.unanswered)

    def receive(self, timeout: float = 0.0) -> Answer | None:
        """The next answer that came in; None if there is none in time."""
        self._dialogue.drain()
        if not self._dialogue.answers and timeout > 0.0:
            self._dialogue.wait(lambda: bool(self._dialogue.answers), timeout)
        self._connection.keep_alive()
        return self._dialogue.answers.popleft() if self._dialogue.answers else None

    @property
    def latest(self) -> Answer:
        """The newest answer; a stop if it is too old, or not judged by own states."""
        if self._dialogue.welcome is None:
            return self._dialogue.stopped(Cause.NOT_CONNECTED)
        self._dialogue.drain()
        self._connection.keep_alive()
        dialogue = self._dialogue
        cause, newest = dialogue.watchdog.cause, dialogue.watchdog.newest
        if cause is Cause.NONE and newest is not None:
            if dialogue.states.own(newest, self.sender):
                return newest
            cause = Cause.NOT_YOURS
        return dialogue.stopped(cause)

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
        connection, calls = self._connection, self._calls
        data = calls.write(call, arguments)
        if len(data) > len(connection.outbox.payload):
            raise RefusedError(f"call '{call}' is too long for a message")

        def ask() -> None:
            connection.outbox.payload[: len(data)] = data
            calls.was_sent(connection.say(Kind.CALL, len(data)))

        if not self._dialogue.ask(ask, lambda: calls.reply is not None, timeout):
            raise NoServiceError(f"the service does not answer the call '{call}'")
        return calls.result()

    def stop(self) -> None:
        """Order a stop of all robots; every client may."""
        self._connection.say(Kind.STOP)

    def close(self) -> None:
        """Say good-bye."""
        if self._dialogue.welcome is not None and not self._dialogue.watchdog.gone:
            self._connection.say(Kind.BYE)
        self._connection.close()
        self._dialogue.end()

    def _hello(self) -> None:
        payload = self._connection.outbox.payload
        HELLO.pack_into(payload, 0, self._role, self._every, self._dialogue.cookie)
        end = HELLO.size + len(self._name)
        payload[HELLO.size : end] = self._name
        self._connection.say(Kind.HELLO, end)

    def _wish(self, form: Form, values: ArrayLike) -> None:
        payload = self._connection.outbox.payload
        size = put_wish(payload, self._dialogue.command.token, form, values)
        self._connection.say(Kind.WISH, size)
