"""A program's end of the bridge: seals its messages, and checks the bridge's."""

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import zenoh

from armguard.bridges.zenoh_bridge.schema import DroppedError, read
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
from armguard.errors import NoServiceError, RefusedError
from armguard.recording.rights import Role
from armguard.service.client.clock import ServiceClock
from armguard.service.wire.keys import Keys, found_keys, key_of

# A clock query that is not answered is sent again after this time; one that is refused
# after the other [s].
PATIENCE, PAUSE = 0.5, 0.05


class ZenohClient:
    """A controller, commander or observer over Zenoh.

    Attributes:
        clock: The service's clock; `client.clock()` is its time now [s].
        dropped: Messages that came in and did not count, by cause.

    Args:
        session: A session of Zenoh that reaches the bridge.
        role: What this client is to be allowed.
        keys: The service's keys, or a file that holds them; if None the file that
            `ARMGUARD_KEYS` names, else that of the service of this user at `port`.
        port: Port of the service.
        root: What the bridge's keys begin with.
        watchdog: Messages of the bridge that are older than that are dropped [s].

    Example:
        >>> import zenoh
        >>> from armguard.bridges.zenoh_bridge import ZenohClient
        >>> ZenohClient(None, keys={}).dropped
        Counter()
    """

    def __init__(
        self,
        session: zenoh.Session,
        *,
        role: Role = Role.COMMAND,
        keys: Keys | str | Path | None = None,
        port: int = 47800,
        root: str = "armguard/guard",
        watchdog: float = 0.1,
    ) -> None:
        self.clock = ServiceClock()
        self.dropped: Counter[str] = Counter()
        self._zenoh = session
        self._role, self._keys, self._port = role, keys, port
        self._root, self._watchdog = root, watchdog
        self._key = b""
        self._sealer = Sealer(role, [])
        self._bridge = NOTHING
        self._last: dict[str, int] = {}
        # A message has to leave before one with a higher number does.
        self._lock = threading.Lock()

    @property
    def name(self) -> str:
        """What the bridge's commands call this client."""
        return self._sealer.sender.name

    def connect(self, timeout: float = 3.0) -> Mapping[str, Any]:
        """Learn the bridge's session and the clock, also of a bridge that began anew.

        Args:
            timeout: How long to wait for an answer [s].

        Returns:
            Description of the service.

        Raises:
            NoServiceError: No bridge answers that has the same key.
            KeyFileError: The key file cannot be used.
        """
        keys, source = found_keys(self._keys, self._port)
        self._key = key_of(self._role, keys, source)
        self._sealer = Sealer(self._role, [self._key])
        self._bridge, self._last = NOTHING, {}
        end = time.monotonic() + timeout
        while self._bridge == NOTHING:
            try:
                self._meet(min(timeout, PATIENCE))
            except NoServiceError:
                if time.monotonic() > end:
                    raise
                time.sleep(PAUSE)
        welcome: Mapping[str, Any] = self.call("welcome", timeout=timeout)
        return welcome

    def put(self, name: str, message: Mapping[str, Any] | bytes) -> int:
        """Send a message.

        Args:
            name: "state", "wish/velocities", "wish/positions", "wish/twists" or "stop".
            message: Its fields, see docs/zenoh.md; or the same as JSON.

        Returns:
            Its number.

        Raises:
            NoServiceError: `connect` was not called.
        """
        key = f"{self._root}/{name}"
        if isinstance(message, bytes):
            payload = message
        else:
            payload = json.dumps(message).encode()
        with self._lock:
            seal = self._seal(key, payload)
            self._zenoh.put(key, payload, attachment=seal, express=True)
            return self._sealer.sequence

    def call(self, name: str, /, *, timeout: float = 5.0, **message: Any) -> Any:
        """Call something.

        Args:
            name: What, see docs/zenoh.md.
            timeout: How long to wait for the reply [s].
            message: Its fields.

        Returns:
            The result.

        Raises:
            RefusedError: The service or the bridge refused; its sentence says why.
            NoServiceError: No bridge answers that has the same key.
        """
        _, result = self._ask(name, message, timeout)
        return result

    def subscribe(self, name: str, heard: Callable[[dict[str, Any]], None]) -> Any:
        """Receive messages of the bridge; forged, old and repeated ones are dropped.

        Args:
            name: "command", "verdict" or "heartbeat".
            heard: Is called with each, on a thread of Zenoh.

        Returns:
            The subscriber of Zenoh.
        """
        key = f"{self._root}/{name}"

        def take(sample: Any) -> None:
            try:
                payload = sample.payload.to_bytes()
                mark = self._mark(key, payload, sample.attachment)
                self._check_new(name, mark)
                message = read(payload)
            except DroppedError as error:
                self.dropped[error.cause] += 1
                return
            heard(message)

        return self._zenoh.declare_subscriber(key, take)

    def _meet(self, timeout: float) -> None:
        """Learn the bridge's session, and the clock from the round trip.

        Raises:
            NoServiceError: No bridge answers, or so late that its clock is not known.
        """
        asked = time.monotonic_ns()
        mark, _ = self._ask("clock", {}, timeout)
        clock = ServiceClock()
        clock.learn(asked, mark.stamp, time.monotonic_ns())
        if not clock.bound <= self._watchdog:
            raise NoServiceError(
                f"the service's clock is known to {clock.bound:.3f} s only; the way to "
                f"the bridge and back must take less than {2.0 * self._watchdog} s"
            )
        self.clock, self._bridge = clock, mark.sender.session

    def _ask(
        self, name: str, message: Mapping[str, Any], timeout: float
    ) -> tuple[Mark, Any]:
        """A query and the bridge's reply to it."""
        key, payload = f"{self._root}/call/{name}", json.dumps(message).encode()
        with self._lock:
            seal = self._seal(key, payload)
            replies = self._zenoh.get(
                key,
                payload=payload,
                attachment=seal,
                timeout=timeout,
                # Another program's reply does not take the place of the bridge's.
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
            )
        why = "none runs there, or its keys are not the same"
        reply: Any
        for reply in replies:
            if reply.ok is None:
                why = f"refused without a seal: {reply.err.payload.to_bytes()[:300]!r}"
                continue
            found = reply.ok.payload.to_bytes()
            try:
                mark = self._mark(key, found, reply.ok.attachment)
            except DroppedError as error:
                why = str(error)
                continue
            if mark.about != seal[-MAC:]:
                why = "its reply is to another query"
                continue
            result = read(found)
            if not result["ok"]:
                raise RefusedError(result["sentence"], result["error"])
            return mark, result["result"]
        raise NoServiceError(f"no bridge answers at '{key}': {why}")

    def _seal(self, key: str, payload: bytes) -> bytes:
        """The seal of a message that is sent now; NoServiceError before `connect`."""
        if not self._key:
            raise NoServiceError("not connected: call connect() first")
        stamp = int(self.clock.earliest() / NANO)
        return self._sealer.seal(key, payload, stamp, self._bridge)

    def _mark(self, key: str, payload: bytes, attachment: Any) -> Mark:
        """The header of a message that the bridge has sealed; else DroppedError."""
        seal = b"" if attachment is None else attachment.to_bytes()
        mark = mark_of(seal, len(ROLES))
        if mark.sender.role != BRIDGE:
            raise DroppedError("seal", "the message is not the bridge's")
        check(seal, ROLES.index(self._role), self._key, key, payload)
        return mark

    def _check_new(self, name: str, mark: Mark) -> None:
        """Raise DroppedError unless a message is of this bridge, new and in order."""
        if mark.sender.session != self._bridge:
            raise DroppedError("session", "another session of the bridge")
        if not abs(self.clock() - mark.stamp * NANO) <= self._watchdog:
            raise DroppedError("late", "sent too long ago")
        if mark.sequence <= self._last.get(name, 0):
            raise DroppedError("out_of_order", f"number {mark.sequence} came before")
        self._last[name] = mark.sequence
