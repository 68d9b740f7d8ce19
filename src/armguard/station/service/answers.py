"""The COMMAND that answers a cycle, written into a buffer that is there already."""

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
STOP = int(Action.STOP)
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
        level, action = LEVEL_OF.get(reason, int(Level.STOP)), 0
        lost = cause.stops and cause != Cause.STOP_ORDERED
        if lost:
            level = max(level, int(Level.STOP))
        payload = self._outbox.payload
        start, ended = times
        at = ROBOTS_AT - HEADER.size
        for k in range(r):
            row = layout.HEADER + k * layout.ROBOT_WIDTH
            own = int(head[row + layout.ROBOT_LEVEL])
            obeys = 0 if tail[r + k] in MOVING else ACTION_OF.get(own, STOP)
            if lost:
                own, obeys = max(own, int(Level.STOP)), max(obeys, STOP)
            level, action = max(level, own), max(action, obeys)
            ROBOT.pack_into(
                payload,
                at,
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
            at += ROBOT.size
        near = int(head[layout.NEAREST])
        a = b = NOBODY
        slack = distance = clearance = float("inf")
        points: tuple[float, ...] = NOWHERE
        if near >= 0:
            first = self._first_row + near * layout.NEAR_WIDTH
            pair: list[float] = numbers[first : first + layout.NEAR_WIDTH].tolist()
            a = self._body_of[int(pair[layout.FIRST])]
            b = self._body_of[int(pair[layout.SECOND])]
            slack = clearance = pair[layout.CLEARANCE]
            distance = pair[layout.WITNESS]
            points = tuple(pair[layout.WITNESS + 1 : layout.WITNESS + 7])
        COMMAND.pack_into(
            payload,
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
        )
        SUMMARY.pack_into(
            payload,
            COMMAND.size,
            reason,
            cause,
            level,
            action,
            flags,
            n,
            r,
            form,
            commander,
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
        payload = self._outbox.payload
        r, n = self._robots, self._joints
        inf, nan = float("inf"), float("nan")
        COMMAND.pack_into(
            payload,
            0,
            cycle,
            0,
            0,
            0,
            now,
            now * 1e-9,
            nan,
            nan,
            NOBODY,
            NOBODY,
            inf,
            nan,
            *NOWHERE,
        )
        level = int(Level.STOP)
        SUMMARY.pack_into(
            payload, COMMAND.size, 0, cause, level, STOP, HELD, n, r, 0, commander
        )
        at = ROBOTS_AT - HEADER.size
        for k in range(r):
            ROBOT.pack_into(
                payload,
                at,
                level,
                STOP,
                0,
                0,
                0.0,
                1.0,
                inf,
                states.sender[k],
                states.sequence[k],
            )
            at += ROBOT.size
        self._numbers[:n] = 0.0
        self._numbers[n:] = states.q
        self.level, self.reason = level, 0
        return self._outbox.seal(Kind.COMMAND, self._size)


__all__ = ["HELD", "MISSED", "Answers"]
