"""What the commander wants, and who he is."""

import secrets
from dataclasses import dataclass

from armguard.station.wire.words import Cause


@dataclass(slots=True)
class Command:
    """Who has the command.

    Attributes:
        sender: Who; 0 for nobody.
        token: What he shows with every wish.
    """

    sender: int = 0
    token: int = 0

    def claim(self, sender: int, force: bool) -> bool:
        """Whether a sender has the command from now on."""
        if self.sender not in (0, sender) and not force:
            return False
        if self.sender != sender:
            self.sender, self.token = sender, secrets.randbits(63) | 1
        return True

    def give_back(self) -> None:
        """Nobody has it any more."""
        self.sender = self.token = 0


class Wishes:
    """Whether the newest wish counts; what is wished for lies on the desk.

    Attributes:
        heard: When it came in, monotonic; 0 if there is none [ns].

    Args:
        watchdog: A wish older than that counts as none [ns].
    """

    def __init__(self, watchdog: int) -> None:
        self.heard = 0
        self._watchdog = watchdog

    def drop(self) -> None:
        """Nothing is wished for any more."""
        self.heard = 0

    def cause(self, commander: int, now: int) -> Cause:
        """Whether the newest wish counts; else why not."""
        if not commander:
            return Cause.NO_COMMANDER
        if not self.heard:
            return Cause.NO_WISH
        if now - self.heard > self._watchdog:
            return Cause.WISH_OLD
        return Cause.NONE
