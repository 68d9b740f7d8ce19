"""What is heard of one service, and asking it until it answers."""

import struct
from collections import deque
from collections.abc import Callable
from math import inf
from time import monotonic, monotonic_ns

import numpy as np

from armguard.station.client.answer import NANO, Answer
from armguard.station.client.calls import Calls
from armguard.station.client.clock import ServiceClock
from armguard.station.client.command import Command
from armguard.station.client.connection import Connection
from armguard.station.client.handshake import Handshake
from armguard.station.client.inbox import Head
from armguard.station.client.states import States
from armguard.station.client.stop import stop_answer
from armguard.station.client.watchdog import Watchdog
from armguard.station.client.welcome import NOTHING, Welcome
from armguard.station.wire.layout import (
    CHALLENGE,
    HEARTBEAT,
    NO_COOKIE,
    REFUSAL,
    Kind,
)
from armguard.station.wire.words import Cause

# Answers that wait to be received; older ones are given up.
KEPT = 256

# A question that was not answered is asked again after this time [s].
AGAIN = 0.2

# A refusal explains a missing answer for that long [s].
RECENT = 0.5


class Dialogue:
    """Takes over what a service says, from its WELCOME on.

    Attributes:
        connection: Where it comes from.
        calls: Calls of the service, and what came of them.
        clock: The service's clock.
        watchdog: Says whether the newest answer counts.
        command: Whether this client has the command.
        states: What is sent to it again and again.
        answers: Answers that wait to be received, oldest first.
        welcome: What it told about itself; None before that and after `end`.
        cookie: What the next HELLO shows; zeros before the service has given one.
        refusal: Cause and sentence of the newest REFUSAL; None if there was none.

    Args:
        connection: See there.
        calls: See there.
        limit: An answer older than that is a stop [s].
    """

    def __init__(self, connection: Connection, calls: Calls, limit: float) -> None:
        self.connection, self.calls = connection, calls
        self.clock = ServiceClock()
        self.watchdog = Watchdog(limit, self.clock)
        self.command = Command()
        self.states = States(connection)
        self.answers: deque[Answer] = deque(maxlen=KEPT)
        self.welcome: Welcome | None = None
        self.cookie = NO_COOKIE
        self.refusal: tuple[str, str] | None = None
        self._refused = -inf
        self._handshake = Handshake(self.clock)

    def end(self) -> None:
        """Nobody is talked to any more."""
        self.welcome = None
        self.states.expect(None)

    def await_answer(self, own: tuple[int, int], timeout: float) -> Answer | None:
        """The answer to a state, or to a later one of its sender; None if none came.

        Args:
            own: Sender and number of the state.
            timeout: How long to wait [s].
        """

        def answered() -> bool:
            newest = self.watchdog.newest
            return newest is not None and newest.answers(*own)

        self.wait(answered, timeout)
        return self.watchdog.newest if answered() else None

    @property
    def may_not(self) -> bool:
        """Whether the newest refusal is about this client's role."""
        return self.refusal is not None and self.refusal[0] == "role"

    @property
    def unanswered(self) -> Cause:
        """Why a state has no answer, though the service lives."""
        told = self.refusal is not None and self.refusal[0] == "second_controller"
        recent = monotonic() - self._refused < RECENT
        return Cause.NOT_YOURS if told and recent else Cause.NO_ANSWER

    def stopped(self, cause: Cause) -> Answer:
        """What robots are told where nothing counts that was heard."""
        welcome, newest = self.welcome or NOTHING, self.watchdog.newest
        position = self.states.q
        if position is None and newest is not None:
            position = newest.position
        if position is None or len(position) != len(welcome.names):
            # Nowhere, rather than where robots may not be.
            position = np.full(len(welcome.names), np.nan)
        return stop_answer(cause, position, welcome, self.clock)

    def ask(
        self, say: Callable[[], None], done: Callable[[], object], timeout: float
    ) -> bool:
        """Say something again and again until it is answered; whether it was."""
        end = monotonic() + timeout
        while (left := end - monotonic()) > 0.0:
            say()
            self.wait(done, min(left, AGAIN))
            if done():
                return True
        return False

    def wait(self, done: Callable[[], object], timeout: float) -> None:
        """Take messages over until something is true, or for that long."""
        end = monotonic() + timeout
        while self.connection.socket is not None:
            self.drain(done)
            left = end - monotonic()
            if done() or left <= 0.0:
                return
            self.connection.keep_alive()
            self.connection.sleep(left)

    def drain(self, done: Callable[[], object] | None = None) -> None:
        """Take all messages over that there are, or until something is true."""
        while (size := self.connection.receive()) >= 0:
            self.take(size)
            if done is not None and done():
                return

    def take(self, size: int) -> None:
        """Take a message over that was received; one that does not count is dropped."""
        connection = self.connection
        answer = connection.inbox.answer(size)
        if answer is not None:
            self.watchdog.newest = answer
            self.answers.append(answer)
            if answer.commander != connection.sender:
                # What came before the grant was sent before it, and came before it.
                self.command.token = 0
            return
        head = connection.inbox.head(size)
        try:
            if head is None or not self._take_other(
                head, connection.inbox.payload(size)
            ):
                connection.dropped += 1
        except (struct.error, ValueError, KeyError):
            # Its payload is none of its kind.
            connection.dropped += 1

    def _take_other(self, head: Head, payload: memoryview) -> bool:
        """Take over what is no answer; False if it does not count."""
        connection, kind = self.connection, head.kind
        if kind == Kind.WELCOME:
            return self._take_welcome(head, payload)
        if kind == Kind.CHALLENGE:
            return self._take_challenge(head, payload)
        if kind == Kind.REFUSAL and head.session == connection.outbox.session:
            cause, _, sentence = bytes(payload[REFUSAL.size :]).decode().partition(":")
            self.refusal, self._refused = (cause, sentence), monotonic()
            return True
        if self.welcome is None or head.session != connection.outbox.session:
            return False
        connection.inbox.last = head.sequence
        self.watchdog.heard = max(self.watchdog.heard, head.stamp * NANO)
        if kind == Kind.COMMAND:
            return False
        if kind == Kind.HEARTBEAT:
            if HEARTBEAT.unpack_from(payload)[1] != connection.sender:
                self.command.token = 0
        elif kind == Kind.GRANT:
            self.command.take(payload)
        elif kind == Kind.REPLY:
            self.calls.take(payload)
        elif kind == Kind.BYE:
            self.watchdog.gone = True
        return True

    def _take_challenge(self, head: Head, payload: memoryview) -> bool:
        """Take over the cookie for the next HELLO; False if it is an older one's."""
        asked, cookie = CHALLENGE.unpack_from(payload)
        if self.welcome is not None or asked < self.connection.opened:
            return False
        self.connection.outbox.session, self.cookie = head.session, cookie
        return True

    def _take_welcome(self, head: Head, payload: memoryview) -> bool:
        """Take a part of a WELCOME over; False if it is another service's."""
        outbox, inbox = self.connection.outbox, self.connection.inbox
        if self.welcome is not None:
            if head.session != outbox.session:
                # A service that was started anew has to be connected to anew.
                return False
            inbox.last = head.sequence
        welcome = self._handshake.take(payload, head.scene, monotonic_ns())
        if welcome is None:
            return True
        if head.scene != outbox.scene:
            self.watchdog.newest = None
        outbox.session, outbox.scene = head.session, head.scene
        # The earliest time it may be: a message is never older than its stamp says.
        outbox.ahead = round((self.clock.offset - self.clock.bound) / NANO)
        inbox.expect(head.session, head.scene, welcome, self.clock)
        self.states.expect(welcome)
        self.welcome = welcome
        return True
