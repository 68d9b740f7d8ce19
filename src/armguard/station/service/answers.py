"""The COMMAND that answers a cycle, written into a buffer that is there already."""

from collections.abc import Sequence
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.levels import Level, Reason, level_of
from armguard.guard.verdict import first_row_of
from armguard.respond import Action, Command
from armguard.respond.command import ACTIONS, DRIVEN
from armguard.scene.tables import SceneTables
from armguard.station.service.states import States
from armguard.station.wire.layout import (
    COMMAND,
    HEADER,
    HELD,
    MISSED,
    NOBODY,
    ROBOT,
    ROBOTS_AT,
    SUMMARY,
    Kind,
)
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.words import Cause

Floats = NDArray[np.float64]

LEVEL_OF = {int(reason): int(level_of(reason)) for reason in Reason}
ACTION_OF = {int(level): int(action) for level, action in ACTIONS.items()}
MOVING = tuple(int(phase) for phase in DRIVEN)
STOP, STOP_LEVEL = int(Action.STOP), int(Level.STOP)

# From this cause on, but for a stop somebody ordered, nothing that was judged counts.
LOST = int(Cause.DEADLINE_MISSED)
INFINITE, NAN = float("inf"), float("nan")
NOWHERE = (0.0,) * 6


class Answers:
    """Writes what robots are told.

    Attributes:
        bodies: Names of bodies in the order of their indices in a COMMAND.
        level: The highest level of the last answer.
        reason: Its reason.

    Args:
        tables: The scene.
        outbox: Where messages of the service are written.
    """

    def __init__(self, tables: SceneTables, outbox: Outbox) -> None:
        self.bodies = tuple(dict.fromkeys(tables.body_names))
        self.level = int(Level.STOP)
        self.reason = 0
        place = {name: k for k, name in enumerate(self.bodies)}
        self._body_of = [place[name] for name in tables.body_names]
        self._outbox = outbox
        self._robots, self._joints = len(tables.robots), len(tables.q_names)
        self._first_row = first_row_of(tables)
        # All but the joints, in one piece.
        whole_format = COMMAND.format + SUMMARY.format[1:]
        whole_format += self._robots * ROBOT.format[1:]
        self._whole = Struct(whole_format)
        self._head = layout.HEADER + self._robots * layout.ROBOT_WIDTH
        joints_at = ROBOTS_AT + self._robots * ROBOT.size
        self._size = joints_at + 16 * self._joints - HEADER.size
        whole = np.frombuffer(outbox.payload, np.uint8)
        at = joints_at - HEADER.size
        self._numbers = whole[at : at + 16 * self._joints].view(np.float64)

    def write(
        self,
        command: Command,
        states: States,
        cycle: int,
        began: tuple[int, int, int],
        times: tuple[int, int],
        cause: Cause,
        flags: int,
        form: int,
        commander: int,
    ) -> memoryview:
        """The message that tells a command.

        Args:
            command: The command.
            states: What it was judged from.
            cycle: Number of the cycle.
            began: Sender and number of the state that began it, and when that came in
                [ns]; zeros for none.
            times: When the cycle began and when it had been judged, monotonic [ns].
            cause: Why it is not simply what the commander wants.
            flags: See `MISSED` and `HELD`.
            form: What was asked for.
            commander: Who commands.
        """
        numbers, told = command.verdict.numbers, command.numbers
        head: list[float] = numbers[: self._head].tolist()
        r, n = self._robots, self._joints
        tail: list[float] = told[-2 * r :].tolist()
        reason = int(head[layout.REASON])
        level, action = LEVEL_OF.get(reason, STOP_LEVEL), 0
        lost = cause >= LOST
        if lost:
            level = max(level, STOP_LEVEL)
        rows: list[float] = []
        row = layout.HEADER
        for k in range(r):
            own = int(head[row + layout.ROBOT_LEVEL])
            obeys = 0 if tail[r + k] in MOVING else ACTION_OF.get(own, STOP)
            if lost:
                own, obeys = max(own, STOP_LEVEL), max(obeys, STOP)
            level, action = max(level, own), max(action, obeys)
            rows += (
                own,
                obeys,
                int(tail[k]),
                int(head[row + layout.ROBOT_CAUSE]),
                head[row + layout.ROBOT_SCALE],
                head[row + layout.ROBOT_URGENCY],
                head[row + layout.ROBOT_AGE],
                states.sender[k],
                states.sequence[k],
            )
            row += layout.ROBOT_WIDTH
        near = int(head[layout.NEAREST])
        a = b = NOBODY
        slack = distance = clearance = INFINITE
        points: Sequence[float] = NOWHERE
        if near >= 0:
            first = self._first_row + near * layout.NEAR_WIDTH
            pair: list[float] = numbers[first : first + layout.NEAR_WIDTH].tolist()
            a = self._body_of[int(pair[layout.FIRST])]
            b = self._body_of[int(pair[layout.SECOND])]
            slack = clearance = pair[layout.CLEARANCE]
            distance = pair[layout.WITNESS]
            points = pair[layout.WITNESS + 1 : layout.WITNESS + 7]
        start, ended = times
        self._whole.pack_into(
            self._outbox.payload,
            0,
            cycle,
            *began,
            ended,
            start * 1e-9,
            slack,
            head[layout.SLACK_TIME],
            a,
            b,
            distance,
            clearance,
            *points,
            reason,
            cause,
            level,
            action,
            flags,
            n,
            r,
            form,
            commander,
            *rows,
        )
        self._numbers[:] = told[: 2 * n]
        if lost:
            self._numbers[:n] = 0.0
        self.level, self.reason = level, reason
        return self._outbox.seal(Kind.COMMAND, self._size)

    def write_stop(
        self, states: States, cycle: int, cause: Cause, now: int, commander: int
    ) -> memoryview:
        """The message that stops every robot where no cycle could be judged."""
        r, n = self._robots, self._joints
        rows: list[float] = []
        for k in range(r):
            rows += (STOP_LEVEL, STOP, 0, 0, 0.0, 1.0, INFINITE)
            rows += (states.sender[k], states.sequence[k])
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
        self._numbers[n:] = states.q
        self.level, self.reason = STOP_LEVEL, 0
        return self._outbox.seal(Kind.COMMAND, self._size)


__all__ = ["HELD", "MISSED", "Answers"]
