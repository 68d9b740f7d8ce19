"""Who commands among those that come by Zenoh, and whose state counts."""

import secrets
from collections.abc import Iterable
from hmac import compare_digest
from typing import Any

from armguard.station.zenoh_bridge.schema import DroppedError, State

# Senders of states that are remembered.
MOST_SENDERS = 256


class Authority:
    """The token of the one who commands.

    The service knows only the bridge. So the bridge keeps its own token, and takes
    its holder's silence for what it is: the bridge itself is never silent.

    Attributes:
        name: What the holder calls himself; "" for nobody.

    Args:
        watchdog: After that much silence the command is lost [s].
    """

    def __init__(self, watchdog: float) -> None:
        self.name = ""
        self._token = ""
        self._watchdog = watchdog
        self._heard = 0.0
        self._sequence: int | None = None

    def grant(self, name: str, now: float) -> str:
        """Somebody has the command from now on; his token."""
        self.name, self._token = name, secrets.token_hex(16)
        self._heard, self._sequence = now, None
        return self._token

    def lose(self) -> None:
        """Nobody has it any more."""
        self.name = self._token = ""

    def silent(self, now: float) -> bool:
        """Whether its holder has been silent for too long."""
        return bool(self._token) and now - self._heard > self._watchdog

    def check(self, message: dict[str, Any], now: float) -> None:
        """Take note of a message of the holder.

        Raises:
            DroppedError: It is not his.
        """
        shown = message.get("token")
        if not self._token:
            raise DroppedError("not_commander", "nobody commands; claim the command")
        if not isinstance(shown, str) or not compare_digest(
            shown.encode(), self._token.encode()
        ):
            raise DroppedError("not_commander", "another token than the commander's")
        self._heard = now

    def in_order(self, sequence: int) -> None:
        """Take note of the number of a wish.

        Raises:
            DroppedError: It is not higher than the last one.
        """
        if self._sequence is not None and sequence <= self._sequence:
            raise DroppedError("out_of_order", f"{sequence} after {self._sequence}")
        self._sequence = sequence


class Controllers:
    """Who measures which robot.

    Args:
        robots: All robots.
        watchdog: After that much silence another one may [s].
    """

    def __init__(self, robots: Iterable[str], watchdog: float) -> None:
        self._watchdog = watchdog
        self._sender = dict.fromkeys(robots, "")
        self._heard = dict.fromkeys(robots, 0.0)
        self._sequence: dict[str, int] = {}

    def check(self, state: State, now: float) -> None:
        """Take note of a state.

        Raises:
            DroppedError: Another controller has one of its robots, or it is old.
        """
        sender = state.sender
        for robot in state.robots:
            other = self._sender[robot]
            alive = now - self._heard[robot] <= self._watchdog
            if other not in ("", sender) and alive:
                raise DroppedError("second_controller", f"'{robot}' has '{other}'")
        last = self._sequence.get(sender)
        if last is not None and state.sequence <= last:
            raise DroppedError("out_of_order", f"{state.sequence} after {last}")
        if last is None and len(self._sequence) >= MOST_SENDERS:
            kept = set(self._sender.values())
            self._sequence = {k: v for k, v in self._sequence.items() if k in kept}
        self._sequence[sender] = state.sequence
        for robot in state.robots:
            self._sender[robot], self._heard[robot] = sender, now
