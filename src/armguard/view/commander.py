"""The one client that the page drives and edits through; several threads may use it."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError
from armguard.recording.rights import Role
from armguard.service.client import Client, Welcome
from armguard.service.wire import Cause

Floats = NDArray[np.float64]

# A call that is not answered for so long is given up; desired motion waits meanwhile
# [s].
PATIENCE = 2.0

# The same where nothing is to wait: a stop has to wait for a call as well [s].
SOON = 0.3

# Answers may not have the new commander yet for so long after a claim [s].
FRESH = 0.5

# Causes of answers that confirm an ordered stop.
ORDERED = (Cause.STOP_ORDERED, Cause.RESTARTED)

# Causes of a client that receives nothing from its service.
SILENT = (Cause.NOT_CONNECTED, Cause.SERVICE_SILENT, Cause.SERVICE_GONE)


@dataclass(slots=True)
class DesiredMotion:
    """Velocities of joints, positions of them, or twists of tools.

    Attributes:
        velocities: Of all joints, shape (n,) [rad/s or m/s].
        positions: Of all joints, shape (n,) [rad or m]; sent in place of velocities
            where there are any.
        twists: By robot, shape (6,) [m/s], [rad/s]; likewise.
        engaged: Robots that are to be engaged first.
    """

    velocities: Floats
    positions: Floats | None = None
    twists: dict[str, Floats] = field(default_factory=dict)
    engaged: tuple[str, ...] = ()


class Commander:
    """Has the command or not, and reports refusals.

    Attributes:
        role: What the client may do.
        commands: Whether it has the command, as far as is known.
        cause: What the service, or its silence, adds to the guard's reason.
        changed: Whether objects were placed or removed within the last second.
        taken: Whether another client has the command.

    Args:
        client: The client, connected; not to be used elsewhere from now on.
        role: What it may do.
        complain: Called with the sentence of whatever was refused.
    """

    def __init__(
        self, client: Client, role: Role, complain: Callable[[str], None]
    ) -> None:
        self.role = role
        self.commands = self.changed = self.taken = False
        self.cause = Cause.NONE
        self._client, self._complain = client, complain
        self._refusal: tuple[str, str] | None = None
        self._lock = threading.Lock()
        self._claimed = -float("inf")
        # Until when a stop is ordered again that no answer has confirmed; 0 if none is.
        self._unconfirmed = 0.0
        # The newest cycle that was known when it was ordered: only a later one counts.
        self._ordered_after = -1

    @property
    def alive(self) -> bool:
        """Whether the service answered lately."""
        return self.cause not in SILENT

    @property
    def remark(self) -> str:
        """Why the service stops all robots, whatever the guard's reason; else empty."""
        stops = self.cause.stops and self.cause < Cause.NOT_CONNECTED
        return self.cause.sentence if stops else ""

    def connect(self, timeout: float) -> Welcome:
        """Connect anew, to a service that was started anew.

        Args:
            timeout: How long to wait for an answer [s].

        Raises:
            NoServiceError: None came.
        """
        with self._lock:
            self.commands = False
            return self._client.connect(timeout)

    def listen(self) -> None:
        """Take in the answers; a client that was silent too long lost the command."""
        with self._lock:
            latest = self._client.latest
            while self._client.connected and self._client.receive() is not None:
                pass
            # Only the service knows who commands; its silence says nothing of that.
            known = latest.cycle >= 0 and time.monotonic() - self._claimed > FRESH
            other = latest.commander != self._client.sender
            self.cause, self.changed = latest.cause, latest.objects_changed
            self.taken = bool(latest.commander) and other
            lost = self.commands and known and other
            refusal, before = self._client.refusal, self._refusal
            self._refusal = refusal
            self.commands = self.commands and not lost
            unanswered = self._repeat_stop(latest.cycle)
        if unanswered:
            self._complain(
                "the service does not confirm the stop: stop the robots by their own "
                "means"
            )
        if lost:
            self._complain(
                "the command is gone: another client took it, or the service heard "
                "nothing of this page for too long"
            )
        if refusal is not None and refusal != before:
            self._complain(refusal[1])

    def claim(self, force: bool = False) -> bool:
        """Take the command; whether that was granted. Only force reports a refusal."""
        granted = self._try(
            lambda: self._client.claim(force=force, timeout=PATIENCE), quiet=not force
        )
        self._claimed, self.commands = time.monotonic(), granted
        return granted

    def engage(self) -> None:
        """Engage all robots that wait for a person.

        That is for the commander: another one loses the command for that long, if this
        client may take it.
        """
        commands = self.commands
        if commands or self.claim() or self.claim(force=True):
            self.call("engage")
            if not commands:
                self.give_back()

    def give_back(self) -> None:
        """Give the command back."""
        self.commands = False
        self._try(self._client.give_back)

    def stop(self) -> None:
        """Order a stop of all robots, with or without the command.

        It is ordered again until an answer confirms it, since a message may be lost.
        """

        def order() -> None:
            self._ordered_after = self._client.latest.cycle
            self._unconfirmed = time.monotonic() + PATIENCE
            self._client.stop()

        self._try(order)

    def _repeat_stop(self, cycle: int) -> bool:
        """Order an unconfirmed stop again; whether it stayed unconfirmed to the end.

        Args:
            cycle: Number of the cycle that `cause` is of.
        """
        if not self._unconfirmed:
            return False
        over = time.monotonic() > self._unconfirmed
        if over or (self.cause in ORDERED and cycle > self._ordered_after):
            self._unconfirmed = 0.0
            return over and not self.cause.stops
        if self._client.connected:
            self._client.stop()
        return False

    def call(self, what: str, /, **arguments: Any) -> bool:
        """Call something of the service; whether it was done."""
        return self._try(lambda: self._client.call(what, timeout=PATIENCE, **arguments))

    def objects(self) -> dict[str, Any]:
        """Objects placed since the service's start; none if it is silent."""
        found: dict[str, Any] = {}

        def ask() -> None:
            count = 1
            while len(found) < count:
                reply = self._client.call("objects", timeout=SOON, first=len(found))
                found.update(reply["objects"])
                count = reply["count"] if reply["objects"] else 0

        self._try(ask)
        return found

    def send(self, desired: DesiredMotion) -> None:
        """Send a desired motion in the form it has."""
        with self._lock:
            if desired.twists:
                self._client.send_twists(desired.twists)
            elif desired.positions is not None:
                self._client.send_positions(desired.positions)
            else:
                self._client.send_velocities(desired.velocities)

    def close(self) -> None:
        """Give the command back, and disconnect."""
        with self._lock:
            if self.commands:
                self._client.give_back()
            self._client.close()

    def _try(self, what: Callable[[], Any], quiet: bool = False) -> bool:
        try:
            with self._lock:
                what()
        except ArmguardError as error:
            if not quiet:
                self._complain(str(error))
            return False
        return True
