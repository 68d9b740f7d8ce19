"""Seals COMMANDs, and writes the one that stops every robot without a judged cycle."""

import numpy as np

from armguard.guard.levels import Level
from armguard.service.server.judge import Judge
from armguard.service.wire import Cause, Kind, Outbox
from armguard.service.wire.layout import (
    COMMAND,
    HEADER,
    HELD,
    OBJECTS_CHANGED,
    ROBOT,
    ROBOTS_AT,
    SEAL,
    STOP_LEVEL,
    STOPPED,
    STOPPED_ROW,
    command_size,
)

CAUTION = int(Level.CAUTION)


class Answers:
    """The COMMANDs of the service.

    Attributes:
        level: The highest level of the last one.
        reason: Its reason.

    Args:
        judge: Writes them.
        outbox: Where it writes them.
    """

    def __init__(self, judge: Judge, outbox: Outbox) -> None:
        self.level, self.reason = STOP_LEVEL, 0
        self._judge = judge
        self._outbox = outbox
        command = np.frombuffer(outbox.buffer, COMMAND.dtype, 1, HEADER.size)
        self._ended, self._level = command["ended"], command["level"]
        n, r = len(judge.desk.q), len(judge.desk.stamps)
        self._joints, self._robots = n, r
        self._size = command_size(r, n) - HEADER.size - SEAL
        at = ROBOTS_AT + r * ROBOT.size
        self._numbers = np.frombuffer(outbox.buffer, np.float64, 2 * n, at)

    def seal(self, ended: int) -> memoryview:
        """The message that answers the last cycle, which had been judged then [ns]."""
        cycle = self._judge.cycle
        self._ended[0] = ended
        if cycle.marks & OBJECTS_CHANGED and cycle.level < CAUTION:
            self._level[0] = cycle.level = CAUTION
        self.level, self.reason = cycle.level, cycle.reason
        return self._outbox.seal(Kind.COMMAND, self._size)

    def write_stop(
        self, cycle: int, cause: Cause, now: int, commander: int
    ) -> memoryview:
        """The message that stops every robot where no cycle could be judged."""
        payload, judge = self._outbox.payload, self._judge
        command = STOPPED._replace(
            cycle=cycle,
            ended=now,
            time=now * 1e-9,
            cause=cause,
            flags=HELD,
            joints=self._joints,
            robots=self._robots,
            commander=commander,
        )
        COMMAND.pack_into(payload, 0, *command)
        states = zip(judge.senders, judge.sequences, strict=True)
        for k, (sender, sequence) in enumerate(states):
            row = STOPPED_ROW._replace(sender=sender, sequence=sequence)
            ROBOT.pack_into(payload, COMMAND.size + k * ROBOT.size, *row)
        self._numbers[: self._joints] = 0.0
        self._numbers[self._joints :] = judge.desk.q
        self.level, self.reason = STOP_LEVEL, 0
        return self._outbox.seal(Kind.COMMAND, self._size)
