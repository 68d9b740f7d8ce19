"""An operator as the commander of a running service."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from armguard.errors import StationError
from armguard.respond.command import Action
from armguard.service.client import Answer, Client
from armguard.service.wire import Cause
from armguard.simulation.operator import Hands

Floats = NDArray[np.float64]

# Time between two desired motions [s].
EVERY = 0.02

# Time between two claims while another client has the command [s].
ASKS = 1.0

# How long the service gets to answer [s].
AN_ANSWER = 0.1

# Time from a brake of an arm to its reset [s].
LOOKS_AFTER = 2.0

# What a client says that has lost its service.
LOST = (Cause.NOT_CONNECTED, Cause.SERVICE_SILENT, Cause.SERVICE_GONE)


class DrivingOperator:
    """Claims the command when it is free, and drives until another client takes it.

    Attributes:
        client: The client it commands through.
        pressed: Set by a person who presses the button that engages all arms, whatever
            stopped them.

    Args:
        client: A client that is connected.
        hands: Source of desired motion and of engagements.
    """

    def __init__(self, client: Client, hands: Hands) -> None:
        self.client = client
        self.pressed = False
        self._hands = hands
        self._start = client.clock()
        self._asked = self._braked = -np.inf

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Drive until something is true."""
        client = self.client
        due = client.clock()
        while not until():
            while (left := due - client.clock()) > 0.0:
                if client.connected:
                    client.receive(timeout=left)
                else:
                    time.sleep(left)
            now = client.clock()
            due = max(due + EVERY, now)
            latest = client.latest
            if latest.cycle < 0 or not client.commands:
                self._claim(now, latest.cause)
            else:
                self._drive(now, latest)

    def _drive(self, now: float, answer: Answer) -> None:
        """Send the present desired motion."""
        client = self.client
        desired, engages = self._hands.drive(
            now - self._start, answer.position, answer.blocked
        )
        client.send_velocities(desired)
        for robot in engages:
            self._engage(robot)
        braked = answer.action >= Action.BRAKE
        if not (braked and self._hands.engages):
            self._braked = now
        looked_after = now - self._braked > LOOKS_AFTER
        if self.pressed or looked_after:
            if braked:
                # Arms that did not stop as declared are reset first.
                self._call("reset")
            self._engage(None, pressed=self.pressed)
            self.pressed, self._braked = False, now

    def _engage(self, robot: str | None, *, pressed: bool = False) -> None:
        """Engage a robot, or all; robots of an ordered stop only with the button."""
        self._call("engage", name=robot, ordered=pressed)

    def _call(self, what: str, **arguments: str | bool | None) -> None:
        """Call the guard; a refused call is repeated later."""
        try:
            self.client.call(what, timeout=1.0, **arguments)
        except StationError:
            return

    def _claim(self, now: float, cause: Cause) -> None:
        """Claim the command; before, connect to a service that was lost."""
        if now - self._asked < ASKS:
            return
        self._asked = now
        try:
            if cause in LOST:
                self.client.connect(timeout=AN_ANSWER)
            self.client.claim(timeout=AN_ANSWER)
        except StationError:
            return
