"""What a client knows of its service, from the messages that it takes over."""

import json
import struct
from collections import deque
from collections.abc import Callable, Mapping
from math import inf
from pathlib import Path
from reprlib import repr as brief
from time import monotonic, monotonic_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import NoServiceError, RefusedError
from armguard.service.client.answer import NANO, Answer, stop_answer
from armguard.service.client.arguments import text_of, watchdog_of
from armguard.service.client.clock import ServiceClock
from armguard.service.client.connection import Connection, StateMessage
from armguard.service.client.welcome import NOTHING, Welcome, read_welcome
from armguard.service.wire import Cause, Kind
from armguard.service.wire.boot import boot_id
from armguard.service.wire.layout import (
    CHALLENGE,
    GRANT,
    HEARTBEAT,
    NO_COOKIE,
    REFUSAL,
    REPLY,
    WELCOME,
    Grant,
    Header,
)
from armguard.service.wire.pulses import Pulses

Floats = NDArray[np.float64]

# Answers that wait to be received; older ones are given up.
KEPT = 256

# Stops of the service after which robots wait until they are engaged.
UNTIL_ENGAGED = (
    Cause.STOP_ORDERED,
    Cause.RESTARTED,
    Cause.REFLEX_STOPPED,
    Cause.REFLEX_SILENT,
)

# A question that was not answered is asked again after this time [s].
AGAIN = 0.2


class Exchange:
    """Takes messages of a service over, and knows when its newest answer is too old.

    Attributes:
        clock: The service's clock; `clock()` is its time now [s].
        refusal: Cause and sentence of the newest refusal of a message of this client;
            None if there was none.

    Args:
        address: Host and port of the service.
        watchdog: After that much silence of the service its last answer is a stop [s].
    """

    def __init__(self, address: tuple[str, int], watchdog: float) -> None:
        self._limit = watchdog_of(watchdog)
        self._connection = Connection(address)
        # Pulses of the reflex, which a controller hears; why it stopped the arms and
        # the guard has not yet, since when [s], and whether `receive` has to say so.
        self._pulses: Pulses | None = None
        self._reflex, self._reflex_at, self._reflex_news = Cause.NONE, 0.0, False
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

    @property
    def welcome(self) -> Welcome:
        """Description of the service.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
        """
        self.check_connected()
        assert self._welcome is not None
        return self._welcome

    def check_connected(self) -> None:
        """Raise an error if no service has described itself yet.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
        """
        if self._welcome is None:
            raise NoServiceError("not connected: call connect() first")

    @property
    def connected(self) -> bool:
        """Whether a service has described itself."""
        return self._welcome is not None

    @property
    def commands(self) -> bool:
        """Whether this client has the command, as far as it has heard."""
        return self._token != 0

    @property
    def dropped(self) -> int:
        """Messages that could not be sent, and received ones that did not count."""
        return self._connection.dropped

    def _state(
        self, robots: str | tuple[str, ...] | None, velocities: bool, desired: bool
    ) -> StateMessage:
        """The STATE of these robots, see `StateMessage`: numbers have to be written.

        Raises:
            NoServiceError: No service has named its robots.
            RefusedError: There is no robot of that name.
            StationError: The scene has a reflex, whose pulses cannot be heard here.
        """
        form = robots, velocities, desired
        state = self._states.get(form)
        if state is None:
            reflex = self.welcome.text.get("reflex")
            if reflex and self._pulses is None:
                self._pulses = Pulses(Path(reflex))
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

    def _next_answer(self, timeout: float) -> Answer | None:
        """The next answer, or a stop of the reflex; see `Client.receive`."""
        self._drain()

        def done() -> bool:
            return bool(self._answers or (self._reflex_cause() and self._reflex_news))

        if not done() and timeout > 0.0:
            self._wait(done, timeout)
        self._connection.keep_alive()
        answer = self._answers.popleft() if self._answers else None
        cause = self._reflex_cause()
        if cause and (answer is not None or self._reflex_news):
            self._reflex_news = False
            return self._stopped(cause)
        return answer

    def _await_answer(self, own: tuple[int, int], timeout: float) -> Answer | None:
        """The answer to a state of that sender and number, or to a later one of it."""

        def answered() -> bool:
            return self._newest is not None and self._newest.answers(*own)

        self._wait(answered, timeout)
        return self._newest if answered() else None

    def _reflex_cause(self) -> Cause:
        """Why the reflex stops the robots of this controller; NONE if it does not.

        Such a stop is over when the guard has one that lasts until the robots are
        engaged; where it has none, one is ordered.
        """
        if self._pulses is None:
            return Cause.NONE
        now, newest = monotonic_ns(), self._newest
        cause = self._pulses.hear(now)
        if cause is not Cause.NONE:
            self._reflex_news |= self._reflex is Cause.NONE
            self._reflex, self._reflex_at = cause, now * NANO + self.clock.offset
        elif self._reflex and newest is not None and newest.sent > self._reflex_at:
            if newest.cause in UNTIL_ENGAGED:
                self._reflex = Cause.NONE
            else:
                self._connection.say(Kind.STOP)
        return self._reflex

    def _cause(self) -> Cause:
        """Why the newest answer does not count; NONE if it does."""
        reflex = self._reflex_cause()
        return self._service_cause() or reflex

    def _service_cause(self) -> Cause:
        """Why the newest answer does not count, as far as the service matters."""
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
            self._connection.sleep(left, *filter(None, (self._pulses,)))

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
    """The JSON of a call, by the number of the call.

    Raises:
        RefusedError: The call is no text, or an argument cannot be sent.
    """
    request = {"id": number, "call": text_of(call, "a call"), "arguments": arguments}
    try:
        return json.dumps(request, default=as_json).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise RefusedError(f"call '{call}' cannot be sent: {error}") from None


def as_json(value: Any) -> Any:
    """Poses, arrays and shapes, for which JSON has no word."""
    if hasattr(value, "matrix"):
        return value.matrix().tolist()
    if hasattr(value, "tolist"):
        return value.tolist()
    # A client without shapes does not load their kernels.
    from armguard.geometry.shapes import Shape
    from armguard.recording.shape_words import words_of

    if isinstance(value, Shape):
        return words_of(value)
    raise TypeError(
        f"{brief(value)} is a {type(value).__name__}; give numbers, text, a Pose, an "
        "array or a shape"
    )
