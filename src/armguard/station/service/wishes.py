"""What the commander wants, and who he is."""

import secrets
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.station.wire.layout import SEAL, TWIST, WISH, Form
from armguard.station.wire.words import Cause

Floats = NDArray[np.float64]


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
    """The newest wish.

    Attributes:
        form: What is wished for.
        values: Velocities or positions, shape (n,).
        twists: Twists by tool, shape (6,).
        heard: When it came in, monotonic; 0 if there is none [ns].
        held: Positions told last, which are held when a commander in positions falls
            silent, shape (n,).

    Args:
        joints: Number of joints.
        tools: Names of tools in the order of their indices.
        watchdog: A wish older than that counts as none [ns].
    """

    def __init__(self, joints: int, tools: tuple[str, ...], watchdog: int) -> None:
        self.form = Form.VELOCITIES
        self.values: Floats = np.zeros(joints)
        self.twists: dict[str, Floats] = {}
        self.heard = 0
        self.held: Floats = np.full(joints, np.nan)
        self._tools = tools
        self._watchdog = watchdog
        self._zeros: Floats = np.zeros(max(joints, TWIST * len(tools)))

    def take(
        self, message: memoryview, words: Floats, start: int, token: int, now: int
    ) -> str:
        """Take a wish over.

        Args:
            message: The message it is in.
            words: The same as float64.
            start: Where it begins [bytes].
            token: What its sender must show; 0 if he does not command.
            now: Monotonic clock [ns].

        Returns:
            Why it was dropped, "" if it was not.
        """
        room = len(message) - SEAL - start - WISH.size
        if room < 0:
            return "payload"
        shown, form, count = WISH.unpack_from(message, start)
        if room != 8 * count:
            return "payload"
        if not token or shown != token:
            return "not_commander"
        at = (start + WISH.size) // 8
        values = words[at : at + count]
        if form == Form.TWISTS:
            if count % TWIST or count > len(self._zeros):
                return "joints"
        elif form not in (Form.VELOCITIES, Form.POSITIONS):
            return "payload"
        elif count != len(self.values):
            return "joints"
        # What is not finite stays so when it is multiplied with 0.
        if not values @ self._zeros[:count] == 0.0:
            # Who wishes for what is no number wishes for nothing.
            self.drop()
            return "wish_not_finite"
        if form == Form.TWISTS:
            rows = values.reshape(-1, TWIST)
            twists = {}
            for row in rows:
                k = row[0]
                if not 0 <= k < len(self._tools) or k != int(k):
                    return "joints"
                twists[self._tools[int(k)]] = row[1:].copy()
            self.twists = twists
        else:
            self.values[:] = values
        self.form = Form(form)
        self.heard = now
        return ""

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
