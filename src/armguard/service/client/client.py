"""A client of the service: controller, commander, observer, or all of them."""

import logging
from collections.abc import Mapping
from pathlib import Path
from time import monotonic, monotonic_ns
from typing import Any, Self

from numpy.typing import ArrayLike

from armguard.errors import NoServiceError, RefusedError
from armguard.service.client.answer import NANO, Answer, words
from armguard.service.client.arguments import (
    LONG_ANSWER,
    LONG_REPLY,
    MOST_EVERY,
    PORTS,
    names_of,
    numbers_of,
    role_of,
    seconds_of,
    text_of,
    twist_rows,
    whole_number_of,
)
from armguard.service.client.exchange import Exchange, request_of
from armguard.service.client.welcome import Welcome
from armguard.service.wire import Cause, Form, Keys, Kind, Role
from armguard.service.wire.keys import awaited_key
from armguard.service.wire.layout import CLAIM, GIVE_BACK, HELLO, NO_COOKIE, WISH

log = logging.getLogger("armguard.client")

# A refusal explains a missing answer for that long [s].
RECENT = 0.5


class Client(Exchange):
    """Exchanges messages with a service; from one thread.

    Its watchdog needs no thread: `latest` is a stop if the newest answer is too old,
    however long it was not read. It compares clocks in messages, and not the times
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
        every: Cycles to one answer beside those to its own states; 0 for none.

    Example:
        >>> from armguard.service.client import Client
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
        port = whole_number_of(port, "port", 1, PORTS)
        super().__init__((text_of(host, "host"), port), watchdog)
        self._role, self._keys = role_of(role), keys
        self._name = text_of(name, "name").encode()[:64]
        self._every = whole_number_of(every, "every", 0, MOST_EVERY)
        # A call that is sent again has the same number, and is not done again.
        self._call_number = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def port(self) -> int:
        """Port of the service."""
        return self._connection.address[1]

    @property
    def sender(self) -> int:
        """Number by which the service knows this client."""
        return self._connection.sender

    def fileno(self) -> int:
        """Its socket, for a loop that waits for other inputs too; -1 if it has none.

        With it `select`, `poll` and `asyncio` take a client for a file. When it can be
        read, call `receive` until that is None; and ask something at least every 0.2 s,
        so that the service hears that this client lives, and `latest` that the service
        does not. It is another number after `connect`.
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
        end = monotonic() + seconds_of(timeout, "timeout", LONG_REPLY)
        self.close()
        self._forget()
        key, source = awaited_key(self._keys, self.port, self._role, end)
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
            RefusedError: A robot is not there, or an array has the wrong length.
        """
        if robots is not None:
            robots = names_of(robots, "a robot")
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
        self.check_connected()
        timeout = seconds_of(timeout, "timeout", LONG_REPLY)

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
            RefusedError: There is no such tool, or a twist is no six numbers.
        """
        self._send_desired(Form.TWISTS, twist_rows(twists, self.welcome.tools))

    def cycle(
        self,
        q: ArrayLike,
        v_desired: ArrayLike,
        velocity: ArrayLike | None = None,
        stamp: float | None = None,
        timeout: float | None = None,
    ) -> Answer:
        """Controller and commander in one: state, desired motion, and their answer.

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
            RefusedError: An array has another number of joints; or, with the first one
                only, another client has the command.
        """
        connection = self._connection
        if timeout is not None:
            timeout = seconds_of(timeout, "timeout", LONG_ANSWER)
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
        """The next answer that came in; None if there is none within `timeout` [s].

        While the reflex stops the robots, a controller gets stops, the first at once.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
        """
        self.check_connected()
        if timeout:
            timeout = seconds_of(timeout, "timeout", LONG_REPLY)
        return self._next_answer(timeout)

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
            call: Its name, of `armguard.recording.calls.CALLS`.
            timeout: How long to wait for the reply [s].
            arguments: Its arguments; poses as `Pose` or transforms (4, 4).

        Raises:
            RefusedError: The service refused, or an argument cannot be sent.
            NoServiceError: It does not answer.
        """
        self.check_connected()
        timeout = seconds_of(timeout, "timeout", LONG_REPLY)
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
        if remark := reply.get("remark"):
            log.warning("%s: %s", call, remark)
        if reply["ok"]:
            return reply["result"]
        raise RefusedError(reply["sentence"], reply["error"], reply.get("reason", ""))

    def stop(self) -> None:
        """Order a stop of all robots; every client may.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
        """
        self.check_connected()
        self._connection.say(Kind.STOP)

    def close(self) -> None:
        """Say good-bye."""
        if self._welcome is not None and not self._gone:
            self._connection.say(Kind.BYE)
        self._connection.close()
        if self._pulses is not None:
            self._pulses.close()
            self._pulses = None
        self._welcome = None
        self._states.clear()
        self._measured = 0

    def _hello(self) -> None:
        head = HELLO.pack(self._role, self._every, self._cookie)
        self._connection.say(Kind.HELLO, head, self._name)

    def _send_desired(self, form: Form, values: ArrayLike) -> None:
        """Send a desired motion of that form."""
        count = None if form is Form.TWISTS else len(self.welcome.names)
        row = numbers_of(values, "the desired motion", count).reshape(-1)
        head = WISH.pack(self._token, form, len(row))
        self._connection.say(Kind.WISH, head, row.tobytes())
