"""Answers of the service, and the stop of a client that has none."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from math import nan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import frombuffer
from numpy.typing import NDArray

from armguard.service.client.welcome import Welcome
from armguard.service.wire import Cause
from armguard.service.wire.layout import (
    HOLD_ACTION,
    MISSED,
    NO_BODY,
    OBJECTS_CHANGED,
    ROBOT,
    ROBOTS_AT,
    SEAL,
    STOP_LEVEL,
    STOPPED,
    STOPPED_ROW,
    Command,
    RobotRow,
)

if TYPE_CHECKING:
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked, Held

Floats = NDArray[np.float64]

CAUSES = {int(cause): cause for cause in Cause}

# Looked up here and not in numpy, which takes longer than the rest of a property.
FLOAT = np.dtype(np.float64)

NANO = 1e-9


class Words(NamedTuple):
    """The guard's enumerations, and its robot that waits."""

    level: "type[Level]"
    reason: "type[Reason]"
    action: "type[Action]"
    blocked: "type[Blocked]"
    held: "type[Held]"


@cache
def words() -> Words:
    """The guard's words for numbers of a message.

    The import takes a second: a client does it when it connects, never in its loop.
    """
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked, Held

    return Words(Level, Reason, Action, Blocked, Held)


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The pair with the least headroom."""

    a: str  # body of A: 'robot/link', or an object's name
    b: str
    distance: float  # signed distance of their surfaces [m]
    headroom: float  # distance beyond what the pair needs [m]
    point_a: Floats  # witness point on A, world, shape (3,) [m]
    point_b: Floats


class Answer:
    """Command to the robots: from the service, or a stop of a client without an answer.

    It holds the message; rows and arrays are read from it on access.

    Attributes:
        sent: When it was sent, on the service's clock [s].
        welcome: Description of the service.
        clock: The service's clock, as far as it is known here.
    """

    __slots__ = ("_command", "_message", "clock", "sent", "welcome")

    def __init__(
        self,
        message: bytes,
        command: Command,
        sent: float,
        welcome: Welcome,
        clock: Callable[[], float],
    ) -> None:
        # The message, whose seal fits, and its `Command`.
        self._message, self._command = message, command
        self.sent = sent
        self.welcome, self.clock = welcome, clock

    def __repr__(self) -> str:
        return (
            f"Answer(cycle={self.cycle}, level={self.level.name}, "
            f"action={self.action.name}, cause={self.cause.name}, "
            f"held={list(self.held)}, velocity={self.velocity})"
        )

    @property
    def velocity(self) -> Floats:
        """Joint velocities to send, shape (n,) [rad/s or m/s]; not to be written."""
        n, first = self._command.joints, self._joints_at
        return frombuffer(self._message, FLOAT, n, first)

    @property
    def position(self) -> Floats:
        """The same as positions, shape (n,) [rad or m]; not to be written."""
        n, first = self._command.joints, self._joints_at
        return frombuffer(self._message, FLOAT, n, first + 8 * n)

    @property
    def began(self) -> tuple[int, int]:
        """Sender and number of the state that began the cycle; zeros for none."""
        return self._command.began_by, self._command.began_with

    @property
    def cycle(self) -> int:
        """Number of the cycle; -1 if it is not the service's."""
        return self._command.cycle

    @property
    def inside(self) -> float:
        """From receiving a state to its judgement; NaN if no state began it [s]."""
        command = self._command
        if not command.began_by:
            return nan
        return (command.ended - command.received) * NANO

    @property
    def time(self) -> float:
        """Time of the cycle, on the service's clock [s]."""
        return self._command.time

    @property
    def headroom(self) -> float:
        """Distance of the nearest pair beyond what it needs [m]."""
        return self._command.headroom

    @property
    def time_left(self) -> float:
        """Least time until a stop must be ordered [s]."""
        return self._command.time_left

    @property
    def nearest(self) -> Nearest | None:
        """The pair with the least headroom; None if none is near."""
        found, bodies = self._command, self.welcome.bodies
        if found.body_a == NO_BODY:
            return None
        return Nearest(
            a=bodies[found.body_a],
            b=bodies[found.body_b],
            distance=found.distance,
            headroom=found.pair_headroom,
            point_a=frombuffer(found.point_a).copy(),
            point_b=frombuffer(found.point_b).copy(),
        )

    @property
    def reason_number(self) -> int:
        """The guard's reason."""
        return self._command.reason

    @property
    def cause(self) -> Cause:
        """Cause of the service or of the client, beside the guard's reason."""
        return CAUSES[self._command.cause]

    @property
    def level_number(self) -> int:
        """The highest level."""
        return self._command.level

    @property
    def action_number(self) -> int:
        """The highest action."""
        return self._command.action

    @property
    def missed(self) -> bool:
        """Whether the cycle ended later than its period allows."""
        return bool(self._command.flags & MISSED)

    @property
    def objects_changed(self) -> bool:
        """Whether an object was placed or removed within the last second."""
        return bool(self._command.flags & OBJECTS_CHANGED)

    @property
    def commander(self) -> int:
        """Number of the commander; 0 if there is none."""
        return self._command.commander

    @property
    def numbers(self) -> tuple[RobotRow, ...]:
        """The row of each robot, in the order of a COMMAND."""
        return ROBOT.rows(self._message[ROBOTS_AT : self._joints_at])

    @property
    def stops(self) -> bool:
        """Whether any robot does not follow its operator."""
        return self.action_number >= HOLD_ACTION

    @property
    def age(self) -> float:
        """How long ago it was sent [s]."""
        return self.clock() - self.sent

    @property
    def sequence(self) -> int:
        """Number of the newest state it was judged from; 0 for none."""
        return max((row.sequence for row in self.numbers), default=0)

    @property
    def action(self) -> "Action":
        """The highest of `actions`."""
        return words().action(self.action_number)

    @property
    def actions(self) -> "dict[str, Action]":
        """What to have each robot do."""
        action = words().action
        return {name: action(row.action) for name, row in self._rows()}

    @property
    def level(self) -> "Level":
        """The highest of `levels`, and of the guard's reason."""
        return words().level(self.level_number)

    @property
    def levels(self) -> "dict[str, Level]":
        """What each robot should do."""
        level = words().level
        return {name: level(row.level) for name, row in self._rows()}

    @property
    def reason(self) -> "Reason | Cause":
        """Why the level is what it is."""
        cause = self.cause
        return cause if cause.stops else words().reason(self.reason_number)

    @property
    def sentence(self) -> str:
        """The reason in words; `Client.call("why")` knows names and numbers as well."""
        held = self.held
        found = [one.sentence for one in held.values()]
        if self.cause.stops or not held or self.reason_number:
            found.append(self._reason_sentence())
        return "; ".join(found)

    def _reason_sentence(self) -> str:
        cause, welcome = self.cause, self.welcome
        if cause is Cause.DEADLINE_MISSED:
            return (
                f"{cause.sentence} ({welcome.period * 1e3:.1f} ms by --rate, and "
                f"{welcome.text['late'] * 1e3:.1f} ms by --late)"
            )
        if cause.stops:
            return cause.sentence
        sentence, near = welcome.reasons[self.reason_number][1], self.nearest
        if near is not None and self.level_number:
            away = f"{near.a} {near.distance * 1e3:.0f} mm from {near.b}"
            room = near.headroom * 1e3
            sentence = f"{sentence} ({away}, headroom {room:.0f} mm)"
        return f"{sentence}; {cause.sentence}" if cause else sentence

    @property
    def held(self) -> "dict[str, Held]":
        """Robots that do not move before a person does something, and why not."""
        waiting = {
            n: row for n, row in self._rows() if row.held_since == row.held_since
        }
        if not waiting:
            return {}
        _, reason, _, blocked, held = words()
        return {
            name: held(
                name, blocked(row.blocked), reason(row.stopped_by), row.held_since
            )
            for name, row in waiting.items()
        }

    @property
    def blocked(self) -> "dict[str, Blocked]":
        """Why each robot does not simply follow its operator."""
        blocked = words().blocked
        return {name: blocked(row.blocked) for name, row in self._rows()}

    @property
    def stopped_by(self) -> "dict[str, Reason]":
        """Why each robot that is stopped, at rest or held was ordered to stop."""
        reason = words().reason
        return {
            name: reason(row.stopped_by)
            for name, row in self._rows()
            if row.level >= STOP_LEVEL or row.held_since == row.held_since
        }

    @property
    def speed_scale(self) -> dict[str, float]:
        """Share of the operator's speed each robot may have, in [0, 1]."""
        return {name: row.speed_scale for name, row in self._rows()}

    @property
    def urgency(self) -> dict[str, float]:
        """How much each robot's operator is to be warned, in [0, 1]."""
        return {name: row.urgency for name, row in self._rows()}

    @property
    def ages(self) -> dict[str, float]:
        """How old each robot's state may have been [s]."""
        return {name: row.age for name, row in self._rows()}

    def answers(self, sender: int, sequence: int) -> bool:
        """Whether that state of a sender, or a later one of it, was judged."""
        states = [self.began, *((row.sender, row.sequence) for row in self.numbers)]
        return any(by == sender and number >= sequence for by, number in states)

    @property
    def _joints_at(self) -> int:
        """Where velocities begin in the message [bytes]."""
        return ROBOTS_AT + self._command.robots * ROBOT.size

    def _rows(self) -> Iterator[tuple[str, RobotRow]]:
        return zip(self.welcome.robots, self.numbers, strict=True)


def stop_answer(
    cause: Cause, position: Floats, welcome: Welcome, clock: Callable[[], float]
) -> Answer:
    """The answer of a client that has none: every robot stops.

    Args:
        cause: Why.
        position: Positions of the joints, NaN where unknown, shape (n,) [rad or m].
        welcome: Description of the service.
        clock: Its clock [s].
    """
    now, joints, robots = clock(), len(welcome.names), len(welcome.robots)
    command = STOPPED._replace(
        cycle=-1, time=now, cause=cause, joints=joints, robots=robots
    )
    message = (
        bytes(ROBOTS_AT)
        + ROBOT.pack(*STOPPED_ROW) * robots
        + bytes(8 * joints)
        + np.asarray(position, np.float64).tobytes()
        + bytes(SEAL)
    )
    return Answer(message, command, now, welcome, clock)
