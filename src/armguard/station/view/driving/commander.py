"""The one client that driving goes through; several threads may ask it."""

import threading
import time
from collections.abc import Callable
from typing import Any

from armguard.errors import ArmguardError
from armguard.station.client import Client, Welcome
from armguard.station.view.driving.wishes import Wish
from armguard.station.wire import Cause, Role

# A call that is not answered for so long is given up; wishes wait meanwhile [s].
PATIENCE = 2.0

# The same where nobody is to wait: a stop has to wait for a call as well [s].
SOON = 0.3

# Answers may not tell yet who commands for so long after a claim [s].
FRESH = 0.5

# What a client says that hears nothing of its service.
SILENT = (Cause.NOT_CONNECTED, Cause.SERVICE_SILENT, Cause.SERVICE_GONE)


class Commander:
    """Has the command or not, and says why something was refused.

    Attributes:
        role: What the client may do.
        cause: What the service, or its silence, has to say beside the guard's reason.
        changed: Whether objects were placed or removed within the last second.
        taken: Whether another client has the command.

    Args:
        client: The client, connected; nobody else may use it from now on.
        role: What it may do.
        complain: Called with the sentence of whatever was refused.
    """

    def __init__(
        self, client: Client, role: Role, complain: Callable[[str], None]
    ) -> None:
        self.role = role
        self.changed = self.taken = False
        self._client, self._complain = client, complain
        self._refusal: tuple[str, str] | None = None
        self._lock = threading.Lock()
        self._commands = False
        self._claimed = -float("inf")
        self.cause = Cause.NONE

    @property
    def commands(self) -> bool:
        """Whether it has the command, as far as was heard."""
        return self._commands

    @property
    def alive(self) -> bool:
        """Whether the service was heard of lately."""
        return self.cause not in SILENT

    @property
    def remark(self) -> str:
        """Why the service stops everything, whatever the guard says; else empty."""
        said = self.cause.stops and self.cause < Cause.NOT_CONNECTED
        return self.cause.sentence if said else ""

    def connect(self, timeout: float) -> Welcome:
        """Say hello anew, to a service that was started anew.

        Args:
            timeout: How long to wait for an answer [s].

        Raises:
            NoServiceError: None came.
        """
        with self._lock:
            self._commands = False
            return self._client.connect(timeout)

    def listen(self) -> None:
        """Take over what came in; who was silent for too long has lost the command."""
        with self._lock:
            latest = self._client.latest
            self.cause = latest.cause
            while self._client.receive() is not None:
                pass
            # Only the service knows who commands; its silence says nothing of that.
            said = latest.cycle >= 0 and time.monotonic() - self._claimed > FRESH
            other = latest.commander != self._client.sender
            self.changed = latest.objects_changed
            self.taken = bool(latest.commander) and other
            lost = self._commands and said and other
            refusal, known = self._client.refusal, self._refusal
            self._refusal = refusal
            self._commands = self._commands and not lost
        if lost:
            self._complain(
                "the command is gone: somebody took it, or the service heard nothing "
                "of this page for too long"
            )
        if refusal is not None and refusal != known:
            self._complain(refusal[1])

    def claim(self, force: bool = False) -> bool:
        """Take the command; whether that was granted."""
        if force:
            granted = self._try(
                lambda: self._client.claim(force=True, timeout=PATIENCE)
            )
        else:
            try:
                with self._lock:
                    self._client.claim(timeout=PATIENCE)
                granted = True
            except ArmguardError:
                granted = False
        self._claimed = time.monotonic()
        self._commands = granted
        return granted

    def engage(self) -> None:
        """Let all robots go on that wait for a person.

        That is for the commander: another one loses the command for that long, if this
        client may take it.
        """
        commands = self._commands
        if commands or self.claim() or self.claim(force=True):
            self.call("engage")
            if not commands:
                self.give_back()

    def give_back(self) -> None:
        """Give the command back."""
        self._commands = False
        self._try(self._client.give_back)

    def stop(self) -> None:
        """Order a stop of all robots; nobody needs the command for that."""
        self._try(self._client.stop)

    def call(self, what: str, /, **arguments: Any) -> bool:
        """Call something of the service; whether it was done."""
        return self._try(lambda: self._client.call(what, timeout=PATIENCE, **arguments))

    def objects(self) -> dict[str, Any]:
        """Where things were put since the service's start; nothing if it is silent."""
        found: dict[str, Any] = {}

        def ask() -> None:
            count = 1
            while len(found) < count:
                told = self._client.call("objects", timeout=SOON, first=len(found))
                found.update(told["objects"])
                count = told["count"] if told["objects"] else 0

        self._try(ask)
        return found

    def send(self, wish: Wish) -> None:
        """Ask for something, in the form it is in."""
        with self._lock:
            if wish.twists:
                self._client.send_twists(wish.twists)
            elif wish.positions is not None:
                self._client.send_positions(wish.positions)
            else:
                self._client.send_velocities(wish.velocities)

    def close(self) -> None:
        """Give the command back, and say good-bye."""
        with self._lock:
            if self._commands:
                self._client.give_back()
            self._client.close()

    def _try(self, what: Callable[[], Any]) -> bool:
        try:
            with self._lock:
                what()
        except ArmguardError as error:
            self._complain(str(error))
            return False
        return True
