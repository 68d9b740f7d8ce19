"""The bridge: a client of the service on one side, a Zenoh session on the other."""

import json
import select
import socket
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import zenoh

from armguard.errors import ArmguardError
from armguard.station.client import Answer, Client
from armguard.station.client.stop import stop_answer
from armguard.station.errors import RefusedError, StationError
from armguard.station.service.complaints import Complaints
from armguard.station.wire import Cause
from armguard.station.wire.words import OF_ALL, OF_SENSORS
from armguard.station.zenoh_bridge.authority import Authority, Controllers
from armguard.station.zenoh_bridge.schema import (
    DroppedError,
    Joints,
    command_of,
    read,
    verdict_of,
)
from armguard.station.zenoh_bridge.settings import BridgeSettings, open_session

# Messages that wait to be handled; older ones are given up.
WAITING = 1024

# Verdicts that say what the last one said are told this often [s].
VERDICTS = 0.04

# How long a call may take [s].
CALL = 5.0

# How often a service that is away is asked whether it is there again, and how long it
# gets to answer [s].
AGAIN, KNOCK = 0.5, 0.02

# A companion ends after the service has been away for that long: till then it tells
# everybody to stop [s].
GONE = 2.0

# States whose numbers are remembered until they are answered.
ASKED = 512

# Causes that say the service itself is away.
AWAY = (Cause.SERVICE_SILENT, Cause.SERVICE_GONE, Cause.NOT_CONNECTED)


class Bridge:
    """Carries messages between a service and Zenoh; from one thread.

    Zenoh's own threads put what comes in into a queue and wake that one up.

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
        self._client = Client(
            settings.port,
            settings.host,
            settings.key,
            settings.watchdog,
            name="zenoh",
            sensor=settings.sensor,
        )
        self._client.connect(timeout)
        self._adopt()
        self._complaints = Complaints()
        self._inbox: deque[tuple[str, Any]] = deque(maxlen=WAITING)
        self._woken, self._wake = socket.socketpair()
        self._woken.setblocking(False)
        self._wake.setblocking(False)
        self._told = 0.0
        self._shown: tuple[Any, ...] = ()
        try:
            self._session: Any = open_session(settings)
        except BaseException:
            self._client.close()
            raise
        root = settings.root
        self._out = {name: self._publisher(name) for name in TOLD}
        self._takes: dict[str, Callable[[dict[str, Any]], None]] = {
            "state": self._take_state,
            "wish/velocities": self._take_velocities,
            "wish/positions": self._take_positions,
            "wish/twists": self._take_twists,
            "stop": self._take_stop,
        }
        self._ends: list[Any] = [
            self._session.declare_subscriber(f"{root}/{name}", self._hears(name))
            for name in self._takes
        ]
        self._ends.append(
            self._session.declare_queryable(f"{root}/call/*", self._asked_for)
        )

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Carry messages until told otherwise.

        Args:
            until: Asked at least as often as there are heartbeats.
        """
        beat = time.monotonic()
        away = knocked = 0.0
        while not until():
            self._wait(beat)
            self._handle()
            while (answer := self._client.receive()) is not None:
                self._tell(answer)
            now = time.monotonic()
            if now < beat:
                continue
            beat = max(beat + self._settings.heartbeat, now)
            latest = self._latest()
            if latest.cycle < 0:
                self._tell(latest)
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
        """A last stop for everybody, and everything closed."""
        self._client.close()
        with suppress(zenoh.ZError):
            self._tell(self._latest())
            self._beat(self._latest())
        for end in self._ends:
            end.undeclare()
        self._session.close()
        self._woken.close()
        self._wake.close()

    def _adopt(self) -> None:
        """Take over what a service tells about itself."""
        self._welcome = welcome = self._client.welcome
        # Where robots were told to be last; nothing is known of that yet.
        self._position = np.full(len(welcome.names), np.nan)
        watchdogs = welcome.watchdogs
        self._joints = Joints(welcome)
        self._authority = Authority(watchdogs["commander"])
        self._controllers = Controllers(welcome.robots, watchdogs["controller"])
        self._asked: dict[int, tuple[str, int]] = {}

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
            self._client.connect(KNOCK)
            self._adopt()

    def _publisher(self, name: str) -> Any:
        """Where something is told: at once, and given up rather than waited for."""
        return self._session.declare_publisher(
            f"{self._settings.root}/{name}",
            encoding=zenoh.Encoding.APPLICATION_JSON,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )

    def _hears(self, name: str) -> Callable[[Any], None]:
        """What Zenoh calls with a sample of a key, on a thread of its own."""

        def hear(sample: Any) -> None:
            self._put(name, sample.payload.to_bytes())

        return hear

    def _asked_for(self, query: Any) -> None:
        """What Zenoh calls with a query, on a thread of its own."""
        self._put("call", query)

    def _put(self, name: str, thing: Any) -> None:
        """Let the one thread handle something."""
        if len(self._inbox) == WAITING:
            self.counts["dropped_overrun"] += 1
        self._inbox.append((name, thing))
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
        while self._inbox:
            name, thing = self._inbox.popleft()
            if name == "call":
                self._answer(thing)
                continue
            try:
                self._takes[name](read(thing))
                self.counts[f"accepted_{name}"] += 1
            except DroppedError as error:
                self._drop(error.cause, f"{name}: {error}")
            except ArmguardError as error:
                self._drop("refused", f"{name}: {error}")
            except Exception as error:
                self._drop("fault", f"{name}: {type(error).__name__}: {error}")

    def _drop(self, cause: str, sentence: str) -> None:
        """Count a message that is dropped, and say so now and then."""
        self.counts[f"dropped_{cause}"] += 1
        self._complaints.name(cause, sentence, time.monotonic_ns())

    def _take_state(self, message: dict[str, Any]) -> None:
        """Somebody measured joints."""
        state = self._joints.state(message)
        self._controllers.check(state, time.monotonic())
        number = self._client.send_state(
            state.q, state.velocity, state.stamp, robots=state.robots
        )
        self._asked[number] = state.sender, state.sequence
        if len(self._asked) > ASKED:
            del self._asked[next(iter(self._asked))]

    def _check_wish(self, message: dict[str, Any]) -> None:
        """Whether a wish is the commander's, and new."""
        self._authority.check(message, time.monotonic())
        sequence = message.get("sequence")
        if isinstance(sequence, bool) or not isinstance(sequence, int):
            raise DroppedError("payload", "'sequence' must be a whole number")
        self._authority.in_order(sequence)

    def _take_velocities(self, message: dict[str, Any]) -> None:
        """The commander wants joint velocities."""
        self._check_wish(message)
        self._client.send_velocities(self._joints.wish(message, "velocities"))

    def _take_positions(self, message: dict[str, Any]) -> None:
        """The commander wants joint positions."""
        self._check_wish(message)
        self._client.send_positions(self._joints.wish(message, "positions"))

    def _take_twists(self, message: dict[str, Any]) -> None:
        """The commander wants velocities of tools."""
        self._check_wish(message)
        self._client.send_twists(self._joints.twists(message))

    def _take_stop(self, message: dict[str, Any]) -> None:
        """Somebody orders a stop, which everybody may."""
        self._client.stop()

    def _answer(self, query: Any) -> None:
        """Answer a query: what was called for, done or refused."""
        key = str(query.key_expr)
        call = key.rpartition("/")[2]
        try:
            payload = query.payload
            message = {} if payload is None else read(payload.to_bytes())
            reply = {"ok": True, "result": self._do(call, message)}
            self.counts["accepted_call"] += 1
        except DroppedError as error:
            self._drop(error.cause, f"call {call}: {error}")
            reply = {"ok": False, "error": error.cause, "sentence": str(error)}
        except RefusedError as error:
            self.counts["calls_refused"] += 1
            kind = error.kind or "RefusedError"
            reply = {"ok": False, "error": kind, "sentence": str(error)}
        except Exception as error:  # whatever it is, the bridge goes on
            kind = type(error).__name__
            self._drop("fault", f"call {call}: {kind}: {error}")
            reply = {"ok": False, "error": kind, "sentence": str(error)}
        with suppress(zenoh.ZError), query:
            encoding = zenoh.Encoding.APPLICATION_JSON
            query.reply(key, json.dumps(reply), encoding=encoding)

    def _do(self, call: str, message: dict[str, Any]) -> Any:
        """What a call gives back."""
        now = time.monotonic()
        if call == "welcome":
            return dict(self._client.welcome.text)
        if call == "clock":
            clock = self._client.clock
            return {"time": clock(), "bound": clock.bound}
        if call == "claim":
            return self._claim(message, now)
        if call == "give_back":
            self._authority.check(message, now)
            self._client.give_back()
            self._authority.lose()
            return None
        free = OF_ALL + (OF_SENSORS if self._settings.sensor else ())
        if call not in free:
            self._authority.check(message, now)
        arguments = message.get("arguments", {})
        if not isinstance(arguments, dict) or "timeout" in arguments:
            raise DroppedError("payload", "'arguments' must be an object")
        return self._client.call(call, timeout=CALL, **arguments)

    def _claim(self, message: dict[str, Any], now: float) -> dict[str, Any]:
        """Somebody wants to command."""
        name, force = message.get("name"), message.get("force", False)
        if not isinstance(name, str) or not name or not isinstance(force, bool):
            raise DroppedError("payload", "'name' must be a word, 'force' a boolean")
        holder = self._authority.name
        if holder and not force:
            raise RefusedError(
                f"'{holder}' has the command; wait until it is given back, or claim it "
                "with force"
            )
        self._client.claim(force)
        return {
            "token": self._authority.grant(name, now),
            "watchdogs": dict(self._client.welcome.watchdogs),
        }

    def _watch_commander(self, now: float) -> None:
        """Who is silent for too long does not command any more."""
        if not self._authority.name:
            return
        taken = not self._client.commands
        if taken or self._authority.silent(now):
            self.counts["commander_lost"] += 1
            if not taken:
                self._client.give_back()
            self._authority.lose()

    def _tell(self, answer: Answer) -> None:
        """Tell what robots are told, and what was judged if that is news."""
        self._position = answer.position
        began_by = None
        if answer.began[0] == self._client.sender:
            began_by = self._asked.get(answer.began[1])
        self._publish("command", command_of(answer, began_by))
        now = time.monotonic()
        levels = tuple(row.level for row in answer.numbers)
        shown = answer.cause, answer.reason_number, answer.level_number, levels
        if shown != self._shown or now - self._told > VERDICTS:
            self._shown, self._told = shown, now
            self._publish("verdict", verdict_of(answer))

    def _beat(self, latest: Answer) -> None:
        """Say that the bridge lives, and whether the service does."""
        away = latest.cause in AWAY
        self._publish(
            "heartbeat",
            {
                "time": self._client.clock(),
                "cycle": latest.cycle,
                "service": latest.cause.name if away else "ALIVE",
                "commander": self._authority.name,
                "counts": dict(self.counts),
            },
        )

    def _publish(self, name: str, message: dict[str, Any]) -> None:
        """Tell something to whoever listens."""
        self._out[name].put(json.dumps(message, allow_nan=False))
        self.counts[f"told_{name}"] += 1


# What is told.
TOLD = ("command", "verdict", "heartbeat")
