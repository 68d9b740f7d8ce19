"""The one client that driving goes through; several threads may ask it."""

import threading
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError

Floats = NDArray[np.float64]


class Wire(Protocol):
    """What is used of `armguard.Client`."""

    def claim(self, force: bool = False) -> Any:
        """Take the command."""

    def give_back(self) -> Any:
        """Give it back."""

    def send_velocities(self, v: Floats) -> Any:
        """Ask for velocities."""

    def send_twists(self, twists: Mapping[str, Floats]) -> Any:
        """Ask for twists of tools."""

    def call(self, name: str, **arguments: Any) -> Any:
        """Call something of the service."""


class Commander:
    """Has the command or not, and says why not.

    Attributes:
        commands: Whether it has the command, as far as it was told.

    Args:
        client: The client.
        complain: Called with the sentence of whatever was refused.
    """

    def __init__(self, client: Wire, complain: Callable[[str], None]) -> None:
        self._client, self._complain = client, complain
        self._lock = threading.Lock()
        self.commands = False

    def claim(self, force: bool = False) -> bool:
        """Take the command; whether that was granted."""
        self.commands = self._try(lambda: self._client.claim(force=force))
        return self.commands

    def give_back(self) -> None:
        """Give the command back."""
        self.commands = False
        self._try(self._client.give_back)

    def call(self, name: str, **arguments: Any) -> bool:
        """Call something of the service; whether it was done."""
        return self._try(lambda: self._client.call(name, **arguments))

    def send(self, velocities: Floats, twists: Mapping[str, Floats]) -> None:
        """Ask for twists where there are any, else for velocities."""
        with self._lock:
            if twists:
                self._client.send_twists(twists)
            else:
                self._client.send_velocities(velocities)

    def _try(self, what: Callable[[], Any]) -> bool:
        try:
            with self._lock:
                what()
        except (ArmguardError, OSError, TimeoutError) as error:
            self._complain(str(error))
            return False
        return True
