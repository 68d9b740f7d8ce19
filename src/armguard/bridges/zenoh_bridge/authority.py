"""Sessions over Zenoh: which commands, which measures a robot, and their numbers.

Each `check` notes a message, or raises `DroppedError` if it does not count.
"""

from collections.abc import Iterable

from armguard.bridges.zenoh_bridge.schema import DroppedError
from armguard.bridges.zenoh_bridge.seal import Sender

# Sessions whose sequences are remembered.
MOST_SESSIONS = 1024


class Authority:
    """The session that commands.

    The service knows only the bridge, which is never silent. So the bridge keeps which
    session has the command, and the time of its last message.

    Args:
        watchdog: After that much silence the command is lost [s].
    """

    def __init__(self, watchdog: float) -> None:
        # The commander, and its name.
        self.holder: Sender | None = None
        self.name = ""
        self._watchdog, self._heard = watchdog, 0.0

    def grant(self, sender: Sender, name: str, now: float) -> None:
        """Give a session the command."""
        self.holder, self.name, self._heard = sender, name, now

    def lose(self) -> None:
        """Take the command from its holder."""
        self.holder, self.name = None, ""

    def silent(self, now: float) -> bool:
        """Whether the commander has been silent for too long."""
        return self.holder is not None and now - self._heard > self._watchdog

    def check(self, sender: Sender, now: float) -> None:
        """Check a message that only the commander may send."""
        if sender != self.holder:
            why = f"'{self.name}' has the command"
            if self.holder is None:
                why = "no session commands; call 'claim' first"
            raise DroppedError("not_commander", why)
        self._heard = now


class Controllers:
    """Which session measures which robot.

    Args:
        robots: All robots.
        watchdog: After that much silence another session may [s].
    """

    def __init__(self, robots: Iterable[str], watchdog: float) -> None:
        self._watchdog = watchdog
        self._sender: dict[str, Sender | None] = dict.fromkeys(robots)
        self._heard = dict.fromkeys(robots, 0.0)

    def check(self, sender: Sender, robots: Iterable[str], now: float) -> None:
        """Check a state of robots, which no other session may measure."""
        for robot in robots:
            alive = now - self._heard[robot] <= self._watchdog
            if alive and self._sender[robot] not in (None, sender):
                sentence = f"another session measures '{robot}'"
                raise DroppedError("second_controller", sentence)
        for robot in robots:
            self._sender[robot], self._heard[robot] = sender, now


class Sequences:
    """The last number of each sender and kind of message: none is taken twice.

    Args:
        keep: Age from which on messages are refused anyway [s].
    """

    def __init__(self, keep: float) -> None:
        self._keep = keep
        # In the order in which they were heard.
        self._last: dict[tuple[Sender, str], tuple[int, float]] = {}

    def check(self, sender: Sender, kind: str, sequence: int, now: float) -> None:
        """Check the number of a message: higher than the last one, of few senders."""
        last, _ = self._last.pop((sender, kind), (-1, 0.0))
        if sequence > last and len(self._last) >= MOST_SESSIONS:
            oldest = next(iter(self._last))
            if now - self._last[oldest][1] <= self._keep:
                raise DroppedError("overrun", f"{MOST_SESSIONS} sessions send already")
            del self._last[oldest]
        self._last[sender, kind] = max(last, sequence), now
        if sequence <= last:
            raise DroppedError("out_of_order", f"{sequence} after {last}")
