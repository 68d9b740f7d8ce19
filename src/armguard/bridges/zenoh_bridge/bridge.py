"""The bridge: a client of the service on one side, a Zenoh session on the other."""

import json
import math
import select
import socket
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import zenoh

from armguard.bridges.zenoh_bridge.authority import Authority, Controllers, Sequences
from armguard.bridges.zenoh_bridge.schema import (
    DroppedError,
    Joints,
    command_of,
    read,
    verdict_of,
)
from armguard.bridges.zenoh_bridge.seal import (
    BRIDGE,
    MAC,
    NANO,
    NOTHING,
    ROLES,
    Mark,
    Sealer,
    check,
    mark_of,
)
from armguard.bridges.zenoh_bridge.settings import (
    PUBLISHED,
    BridgeSettings,
    open_session,
)
from armguard.errors import ArmguardError, RefusedError, StationError
from armguard.recording.calls import CALLS
from armguard.service.client import Answer, Client
from armguard.service.client.answer import stop_answer
from armguard.service.server.throttled_log import ThrottledLog
from armguard.service.wire import Cause, Keys, Role
from armguard.service.wire.keys import found_keys

# A longer message is dropped unread [bytes].
MOST = 64 * 1024

# Messages that wait to be handled; older ones are given up.
WAITING = 1024

# A verdict that equals the last one is published again after this time [s].
VERDICTS = 0.04

# How long a call may take [s].
CALL = 5.0

# How old a state or a call may be when it is handled, or by how much ahead [s].
LATE = 1.0

# How often a service that is away is asked whether it is there again, and how long it
# gets to answer [s].
AGAIN, KNOCK = 0.5, 0.02

# A companion ends after the service has been away for that long; until then it
# publishes stops [s].
GONE = 2.0

# Forms of a desired motion, and the word for one of each.
FORMS = {"velocities": "velocity", "positions": "position", "twists": "twist"}

# States whose numbers are remembered until they are answered.
ASKED = 512

# Causes that say the service itself is away.
AWAY = (Cause.SERVICE_SILENT, Cause.SERVICE_GONE, Cause.NOT_CONNECTED)


class Message(NamedTuple):
    """A message that came in over Zenoh and waits to be handled."""

    name: str  # "call", or the last parts of its key
    expression: str  # its key
    size: int  # of payload and attachment; if there are too many they are not kept
    payload: bytes
    attachment: bytes
    query: Any = None  # to reply to

    @property
    def kind(self) -> str:
        """What is numbered on its own: "state", "wish", "stop" or "call"."""
        return self.name.partition("/")[0]

    @property
    def call(self) -> str:
        """What a query calls for; "" if it is none."""
        return self.expression.rpartition("/")[2] if self.query else ""


def message_of(name: str, expression: str, source: Any, query: Any = None) -> Message:
    """The message in a sample or query of Zenoh."""
    parts = source.payload, source.attachment
    size = sum(len(part or b"") for part in parts)
    if size > MOST:
        return Message(name, expression, size, b"", b"", query)
    payload, attachment = (b"" if part is None else part.to_bytes() for part in parts)
    return Message(name, expression, size, payload, attachment, query)


class Bridge:
    """Carries messages between a service and Zenoh; from one thread.

    Zenoh's own threads put messages into a queue and wake that one up. Methods that
    take a message raise `DroppedError` if it does not count.

    Attributes:
        counts: Messages that were taken over, and dropped by cause.

    Args:
        settings: How.

    Raises:
        NoServiceError: No service answers.
        BridgeError: Zenoh cannot listen there.
    """

    def __init__(self, settings: BridgeSettings, timeout: float = 3.0) -> None:
        self._settings = settings
        self.counts: Counter[str] = Counter()
        self._clients: dict[Role, Client] = {}
        self._keys: Keys = {}
        self._connect(timeout)
        self._log = ThrottledLog()
        self._inbox: deque[Message] = deque(maxlen=WAITING)
        self._woken, self._wake = socket.socketpair()
        self._woken.setblocking(False)
        self._wake.setblocking(False)
        self._verdict_at = 0.0
        self._verdict: tuple[Any, ...] = ()
        try:
            self._session: Any = open_session(settings)
        except BaseException:
            self._leave()
            raise
        root = settings.root
        self._out = {name: self._publisher(name) for name in PUBLISHED}
        self._takes: dict[str, Callable[[Mark, dict[str, Any]], None]] = {
            "state": self._take_state,
            **{
                f"wish/{form}": partial(self._take_desired_motion, form)
                for form in FORMS
            },
            # Any role may order a stop.
            "stop": lambda mark, message: self._client.stop(),
        }
        self._ends: list[Any] = [
            self._session.declare_subscriber(f"{root}/{name}", self._puts(name))
            for name in self._takes
        ]
        self._ends.append(
            self._session.declare_queryable(f"{root}/call/*", self._put_query)
        )

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Carry messages until `until` is true: asked at least at each heartbeat."""
        beat = time.monotonic()
        away = knocked = 0.0
        while not until():
            self._wait(beat)
            self._handle()
            while (answer := self._client.receive()) is not None:
                self._publish_answer(answer)
            for client in self._clients.values():
                # The service sends commands to one of them only.
                if client.connected and client is not self._client:
                    client.receive()
            now = time.monotonic()
            if now < beat:
                continue
            beat = max(beat + self._settings.heartbeat, now)
            latest = self._latest()
            if latest.cycle < 0 and latest.cause is not Cause.NOT_YOURS:
                self._publish_answer(latest)
            self._watch_commander(now)
            self._beat(latest)
            if latest.cause not in AWAY:
                away = 0.0
                continue
            away = away or now
            if self._settings.companion:
                if now - away > GONE:
                    return
            elif now - knocked > AGAIN:
                knocked = now
                self._knock()

    def close(self) -> None:
        """Publish a last stop, and close everything."""
        self._leave()
        with suppress(zenoh.ZError):
            self._publish_answer(self._latest())
            self._beat(self._latest())
        for end in self._ends:
            end.undeclare()
        self._session.close()
        self._woken.close()
        self._wake.close()

    def _connect(self, timeout: float) -> None:
        """Connect to a service, under its present keys, within `timeout` [s].

        Raises:
            StationError: The key file has no keys, or no service answers.
        """
        settings = self._settings
        keys, _ = found_keys(settings.keys, settings.port)
        # States are sent, and commands received, by the client of this role.
        main = Role.COMMAND if Role.COMMAND in keys else max(keys)
        clients = {
            role: Client(
                settings.port,
                settings.host,
                settings.watchdog,
                role=role,
                keys=keys,
                name=f"zenoh {role.word}",
                every=1 if role is main else 0,
            )
            for role in keys
        }
        clients[main].connect(timeout)
        self._leave()
        self._clients, self._client = clients, clients[main]
        self._welcome = welcome = self._client.welcome
        # Positions that were published last; none yet.
        self._position = np.full(len(welcome.names), np.nan)
        watchdogs = welcome.watchdogs
        self._joints = Joints(welcome)
        self._authority = Authority(watchdogs["commander"])
        self._controllers = Controllers(welcome.robots, watchdogs["controller"])
        self._asked: dict[int, Mark] = {}
        if keys != self._keys:
            # A service that was only silent has the same keys: the session goes on.
            self._keys = keys
            self._sealer = Sealer(BRIDGE, [keys.get(role, b"") for role in ROLES])
            self._sequences = Sequences(2.0 * LATE)
        self._ages = {"wish": watchdogs["wish"], "stop": math.inf}

    def _client_of(self, role: Role) -> Client:
        """The client whose rights are those of a role.

        Raises:
            NoServiceError: The service does not answer.
        """
        client = self._clients[role]
        if not client.connected:
            client.connect(CALL)
        return client

    def _leave(self) -> None:
        """Say good-bye to the service."""
        for client in self._clients.values():
            client.close()

    def _latest(self) -> Answer:
        """The newest answer, or a stop of the robots there are."""
        if self._client.connected:
            latest = self._client.latest
            self._position = latest.position
            return latest
        # A client that is not connected does not know the robots; the bridge does.
        cause, clock = Cause.SERVICE_GONE, self._client.clock
        return stop_answer(cause, self._position, self._welcome, clock)

    def _knock(self) -> None:
        """See whether a service is there again."""
        with suppress(StationError):
            self._connect(KNOCK)

    def _publisher(self, name: str) -> Any:
        """A publisher that sends at once, and drops rather than waits."""
        return self._session.declare_publisher(
            f"{self._settings.root}/{name}",
            encoding=zenoh.Encoding.APPLICATION_JSON,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )

    def _puts(self, name: str) -> Callable[[Any], None]:
        """What Zenoh calls with a sample of a key, on a thread of its own."""
        expression = f"{self._settings.root}/{name}"
        return lambda sample: self._put(message_of(name, expression, sample))

    def _put_query(self, query: Any) -> None:
        """What Zenoh calls with a query, on a thread of its own."""
        self._put(message_of("call", str(query.key_expr), query, query))

    def _put(self, message: Message) -> None:
        """Let the one thread handle a message."""
        if len(self._inbox) == WAITING:
            self.counts["dropped_overrun"] += 1
        self._inbox.append(message)
        with suppress(OSError):
            self._wake.send(b"!")

    def _wait(self, beat: float) -> None:
        """Wait for either side, or the next heartbeat."""
        left = max(beat - time.monotonic(), 0.0)
        sources: list[int] = [self._woken.fileno()]
        if self._client.fileno() >= 0:
            sources.append(self._client.fileno())
        if not self._inbox:
            select.select(sources, (), (), left)
        with suppress(BlockingIOError):
            self._woken.recv(WAITING)

    def _handle(self) -> None:
        """Handle what came by Zenoh; nothing of it may end the bridge."""
        # Those that come meanwhile wait until the heartbeats were looked at.
        for _ in range(len(self._inbox)):
            message = self._inbox.popleft()
            name = message.name
            if name == "call":
                self._answer(message)
                continue
            try:
                mark = self._open(message)
                self._takes[name](mark, read(message.payload))
                self.counts[f"accepted_{name}"] += 1
            except DroppedError as error:
                self._drop(error.cause, f"{name}: {error}")
            except ArmguardError as error:
                self._drop("refused", f"{name}: {error}")
            except Exception as error:
                self._drop("fault", f"{name}: {type(error).__name__}: {error}")

    def _open(self, message: Message) -> Mark:
        """Check the seal of a message, its age and its number."""
        if message.size > MOST:
            text = f"{message.size} bytes; {MOST} are the most"
            raise DroppedError("oversized", text)
        mark = mark_of(message.attachment, 1)
        role = mark.sender.role
        if role not in self._keys:
            raise DroppedError("seal", f"the bridge has no key for role {role}")
        key = self._keys[Role(role)]
        check(message.attachment, 0, key, message.expression, message.payload)
        kind = message.kind
        if message.call == "clock":
            # Its reply gives the sender the session and the time.
            return mark
        if kind != "stop" and mark.about != self._sealer.sender.session:
            raise DroppedError(
                "session", "the bridge began a new session; connect to it again"
            )
        age = self._client.clock() - mark.stamp * NANO
        limit = self._ages.get(kind, LATE)
        if not abs(age) <= limit:
            raise DroppedError("late", f"sent {age:.3f} s ago; {limit} s is the limit")
        self._sequences.check(mark.sender, kind, mark.sequence, time.monotonic())
        return mark

    def _drop(self, cause: str, sentence: str) -> None:
        """Count a message that is dropped, and say so now and then."""
        self.counts[f"dropped_{cause}"] += 1
        self._log.report(cause, sentence, time.monotonic_ns())

    def _take_state(self, mark: Mark, message: dict[str, Any]) -> None:
        """A controller measured joints."""
        self._need(mark, "a state")
        state = self._joints.state(message)
        self._controllers.check(mark.sender, state.robots, time.monotonic())
        stamp = mark.stamp * NANO if state.stamp is None else state.stamp
        number = self._client.send_state(
            state.q, state.velocity, stamp, robots=state.robots
        )
        self._asked[number] = mark
        if len(self._asked) > ASKED:
            del self._asked[next(iter(self._asked))]

    def _need(self, mark: Mark, what: str) -> None:
        """Check that a sender has the key for commanding."""
        if mark.sender.role < Role.COMMAND:
            word = Role(mark.sender.role).word
            raise DroppedError(
                "role", f"{what} needs the key for 'command'; this one is for '{word}'"
            )

    def _commander(self, mark: Mark, what: str) -> Client:
        """The client of a sender, which must be the commander."""
        self._need(mark, what)
        self._authority.check(mark.sender, time.monotonic())
        return self._clients[Role(mark.sender.role)]

    def _take_desired_motion(
        self, form: str, mark: Mark, message: dict[str, Any]
    ) -> None:
        """The commander desires velocities, positions or twists."""
        client = self._commander(mark, f"a desired {FORMS[form]}")
        if form == "velocities":
            client.send_velocities(self._joints.desired_motion(message, form))
        elif form == "positions":
            client.send_positions(self._joints.desired_motion(message, form))
        else:
            client.send_twists(self._joints.twists(message))

    def _answer(self, message: Message) -> None:
        """Answer a query: what was called for, done or refused."""
        call, query = message.call, message.query
        key, encoding = message.expression, zenoh.Encoding.APPLICATION_JSON
        mark, reply = None, dict[str, Any]()
        try:
            mark = self._open(message)
            reply = {"ok": True, "result": self._do(call, mark, read(message.payload))}
            self.counts["accepted_call"] += 1
        except Exception as error:  # whatever it is, the bridge goes on
            kind = type(error).__name__
            if isinstance(error, DroppedError):
                kind = error.cause
                self._drop(kind, f"call {call}: {error}")
            elif isinstance(error, RefusedError):
                kind = error.kind or "RefusedError"
                self.counts["calls_refused"] += 1
            else:
                self._drop("fault", f"call {call}: {kind}: {error}")
            reply = {"ok": False, "error": kind, "sentence": str(error)}
        payload = json.dumps(reply).encode()
        if mark is None:
            # Not sealed: a seal would vouch for an answer to an unknown sender.
            with suppress(zenoh.ZError), query:
                query.reply_err(payload, encoding=encoding)
            return
        seal = self._seal(key, payload, message.attachment[-MAC:])
        with suppress(zenoh.ZError), query:
            query.reply(key, payload, encoding=encoding, attachment=seal)

    def _do(self, call: str, mark: Mark, message: dict[str, Any]) -> Any:
        """Do what is called for; the result."""
        if call == "welcome":
            return dict(self._client.welcome.text)
        if call == "clock":
            clock = self._client.clock
            return {"time": clock(), "bound": clock.bound}
        if call == "claim":
            return self._claim(mark, message)
        if call == "give_back":
            self._commander(mark, f"'{call}'").give_back()
            self._authority.lose()
            return None
        if call in CALLS and CALLS[call].right >= Role.COMMAND:
            self._commander(mark, f"'{call}'")
        arguments = message.get("arguments", {})
        if not isinstance(arguments, dict) or "timeout" in arguments:
            raise DroppedError("payload", "'arguments' must be an object")
        # The service judges what this role may do.
        client = self._client_of(Role(mark.sender.role))
        return client.call(call, timeout=CALL, **arguments)

    def _claim(self, mark: Mark, message: dict[str, Any]) -> dict[str, Any]:
        """Give the sender the command, if it may have it."""
        self._need(mark, "'claim'")
        name, force = message.get("name"), message.get("force", False)
        if not isinstance(name, str) or not name or not isinstance(force, bool):
            raise DroppedError("payload", "'name' must be a word, 'force' a boolean")
        if force and mark.sender.role < Role.ADMINISTER:
            raise RefusedError("to claim with force needs the key for 'administer'")
        holder = self._authority.name
        if holder and not force:
            raise RefusedError(
                f"'{holder}' has the command; wait until it is given back, or claim it "
                "with force"
            )
        self._client_of(Role(mark.sender.role)).claim(force)
        self._authority.grant(mark.sender, name, time.monotonic())
        return {"watchdogs": dict(self._welcome.watchdogs)}

    def _watch_commander(self, now: float) -> None:
        """A commander that is silent for too long loses the command."""
        holder = self._authority.holder
        if holder is None:
            return
        client = self._clients[Role(holder.role)]
        if not client.commands or self._authority.silent(now):
            self.counts["commander_lost"] += 1
            client.give_back()
            self._authority.lose()

    def _publish_answer(self, answer: Answer) -> None:
        """Publish a command, and its verdict if that is news."""
        self._position = answer.position
        self._publish("command", command_of(answer, self._source))
        now = time.monotonic()
        levels = tuple(row.level for row in answer.numbers)
        new = answer.cause, answer.reason_number, answer.level_number, levels
        if new != self._verdict or now - self._verdict_at > VERDICTS:
            self._verdict, self._verdict_at = new, now
            self._publish("verdict", verdict_of(answer))

    def _source(self, sender: int, sequence: int) -> dict[str, Any] | None:
        """Origin over Zenoh of a state, by the service's sender and number; or None."""
        mark = self._asked.get(sequence) if sender == self._client.sender else None
        return mark and {"sender": mark.sender.name, "sequence": mark.sequence}

    def _beat(self, latest: Answer) -> None:
        """Say that the bridge lives, and whether the service does."""
        message = {
            "time": self._client.clock(),
            "cycle": latest.cycle,
            "service": latest.cause.name if latest.cause in AWAY else "ALIVE",
            "commander": self._authority.name,
            "counts": dict(self.counts),
        }
        self._publish("heartbeat", message)

    def _publish(self, name: str, message: dict[str, Any]) -> None:
        """Publish a message under one of the bridge's own keys."""
        payload = json.dumps(message, allow_nan=False).encode()
        seal = self._seal(f"{self._settings.root}/{name}", payload)
        self._out[name].put(payload, attachment=seal)
        self.counts[f"told_{name}"] += 1

    def _seal(self, key: str, payload: bytes, about: bytes = NOTHING) -> bytes:
        """The seal of a message that is sent now."""
        stamp = int(self._client.clock() / NANO)
        return self._sealer.seal(key, payload, stamp, about)
