"""The tele-driver as a commander of a running service."""

from collections.abc import Callable

from armguard.station.client import Client
from armguard.station.errors import StationError
from armguard.station.simulated.operator import WAIT, Operator
from armguard.station.simulated.tele import TeleDriver

# Time between two wishes [s].
EVERY = 0.02

# How often he asks for the command while somebody else has it [s].
ASKS = 1.0


class DrivingOperator:
    """Claims the command when nobody has it, and drives until somebody takes it.

    Args:
        client: A client that is connected.
        driver: Where he wants to go.
    """

    def __init__(self, client: Client, driver: TeleDriver) -> None:
        self.client = client
        self._operator = Operator(driver)
        self._asked = self._stopped = -1.0

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Drive until something is true."""
        client = self.client
        due = client.clock()
        while not until():
            while (left := due - client.clock()) > 0.0:
                client.receive(timeout=left)
            now = client.clock()
            due = max(due + EVERY, now)
            if client.silent or not client.commands:
                self._claim(now)
            else:
                self._drive(now)

    def _drive(self, now: float) -> None:
        """Say what is wanted now."""
        client, answer = self.client, self.client.latest
        wish, engages = self._operator.drive(now, answer.position, answer.blocked)
        client.send_velocities(wish)
        for robot in engages:
            self._call("engage", name=robot)
        # What the service itself stopped for waits for somebody as well.
        if not answer.cause.stops:
            self._stopped = now
        elif now - self._stopped > WAIT:
            self._stopped = now
            self._call("engage")

    def _call(self, name: str, **arguments: str) -> None:
        """Call the guard; what it refuses now is tried again later."""
        try:
            self.client.call(name, **arguments)
        except StationError:
            return

    def _claim(self, now: float) -> None:
        """Ask for the command, and for the service where it is silent."""
        if now - self._asked < ASKS:
            return
        self._asked = now
        try:
            if self.client.silent:
                self.client.connect(timeout=0.1)
            self.client.claim()
        except StationError:
            return
