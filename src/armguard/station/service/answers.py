"""The COMMAND that stops every robot where nothing could be judged."""

from struct import Struct

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Level
from armguard.respond import Action
from armguard.station.desk.desk import FLAGS, LEVEL, REASON, Desk
from armguard.station.service.states import States
from armguard.station.wire.layout import (
    COMMAND,
    HEADER,
    HELD,
    NOBODY,
    OBJECTS_CHANGED,
    ROBOT,
    ROBOTS_AT,
    SUMMARY,
    Kind,
)
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.words import Cause

Floats = NDArray[np.float64]

STOP, STOP_LEVEL, CAUTION = int(Action.STOP), int(Level.STOP), int(Level.CAUTION)

# Where the highest level is in a COMMAND [bytes].
LEVEL_AT = HEADER.size + COMMAND.size + 4
LEVEL_FIELD = Struct("<H")
INFINITE, NAN = float("inf"), float("nan")
NOWHERE = (0.0,) * 6


class Answers:
    """Seals what robots are told, and knows how to stop them without a guard.

    Attributes:
        level: The highest level of the last answer.
        reason: Its reason.

    Args:
        desk: Where answers are written.
        outbox: The message they are in.
    """

    def __init__(self, desk: Desk, outbox: Outbox) -> None:
        self.level = STOP_LEVEL
        self.reason = 0
        self._desk, self._given = desk, desk.given.data
        self._outbox = outbox
        n, r = len(desk.q), len(desk.stamps)
        self._robots, self._joints = r, n
        # All but the joints, in one piece.
        whole_format = COMMAND.format + SUMMARY.format[1:] + r * ROBOT.format[1:]
        self._whole = Struct(whole_format)
        joints_at = ROBOTS_AT + r * ROBOT.size
        self._size = joints_at + 16 * n - HEADER.size
        self._numbers = desk.answer[joints_at // 8 : joints_at // 8 + 2 * n]

    def seal(self) -> memoryview:
        """The message that tells the last cycle."""
        given = self._given
        if given[FLAGS] & OBJECTS_CHANGED and given[LEVEL] < CAUTION:
            given[LEVEL] = CAUTION
            LEVEL_FIELD.pack_into(self._outbox.buffer, LEVEL_AT, CAUTION)
        self.level, self.reason = given[LEVEL], given[REASON]
        return self._outbox.seal(Kind.COMMAND, self._size)

    def write_stop(
        self, states: States, cycle: int, cause: Cause, now: int, commander: int
    ) -> memoryview:
        """The message that stops every robot where no cycle could be judged."""
        r, n = self._robots, self._joints
        rows: list[float] = []
        for k in range(r):
            rows += (STOP_LEVEL, STOP, 0, 0, 0.0, 1.0, INFINITE)
            rows += (states.sender[k], states.sequence[k], NAN)
        self._whole.pack_into(
            self._outbox.payload,
            0,
            cycle,
            0,
            0,
            0,
            now,
            now * 1e-9,
            NAN,
            NAN,
            NOBODY,
            NOBODY,
            INFINITE,
            NAN,
            *NOWHERE,
            0,
            cause,
            STOP_LEVEL,
            STOP,
            HELD,
            n,
            r,
            0,
            commander,
            *rows,
        )
        self._numbers[:n] = 0.0
        self._numbers[n:] = self._desk.q
        self.level, self.reason = STOP_LEVEL, 0
        return self._outbox.seal(Kind.COMMAND, self._size)
