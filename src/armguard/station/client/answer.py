"""Answers of the service, and the stop that a client uses where it has none."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from math import inf, nan
from struct import Struct
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import frombuffer
from numpy.typing import NDArray

from armguard.station.client.welcome import Welcome
from armguard.station.wire.layout import (
    COMMAND,
    HEADER,
    MISSED,
    NOBODY,
    OBJECTS_CHANGED,
    ROBOT,
    ROBOTS_AT,
    SEAL,
    SUMMARY,
)
from armguard.station.wire.words import Cause

if TYPE_CHECKING:
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked, Held

Floats = NDArray[np.float64]

# As `Level` and `Action` number a stop, and the latter a robot that waits.
STOP_LEVEL, STOP_ACTION, HOLD_ACTION = 30, 10, 5

CAUSES = {int(cause): cause for cause in Cause}

# Looked up here and not in numpy, which takes longer than what is done with them.
FLOAT = np.dtype(np.float64)
ROW = ROBOT.size

NANO = 1e-9

# A `COMMAND`, but that a client's own answers are of cycle -1.
BODY = Struct(COMMAND.format.replace("Q", "q", 1))

# What is read of every message, at once. Of its header: what is the same in all of a
# session and scene, as four numbers, then sequence and clock; of its body: sender and
# sequence of the state that began the cycle, and the nearest pair; then its summary.
SAME = Struct("<4Q")
FIELDS = Struct(SAME.format + "Qq" + "8xQQ" + "40xII64x" + SUMMARY.format[1:])
SEQUENCE, SENT, BODY_A, BODY_B = 4, 5, 8, 9
BEGAN = slice(6, 8)
REASON, CAUSE, LEVEL, ACTION, FLAGS, JOINTS, ROBOTS, _, COMMANDER = range(10, 19)


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


class RobotNumbers(NamedTuple):
    """A robot's row of a COMMAND, see docs/service.md."""

    level: int
    action: int
    blocked: int
    stopped_by: int
    speed_scale: float
    urgency: float
    age: float
    sender: int
    sequence: int
    held_since: float


# A robot's row in the answer of a client that hears nothing.
STOPPED = RobotNumbers(STOP_LEVEL, STOP_ACTION, 0, 0, 0.0, 1.0, inf, 0, 0, nan)


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The pair with the least clearance.

    Attributes:
        a: Body of A: 'robot/link', or an object's name.
        b: Body of B.
        distance: Signed distance of their surfaces [m].
        clearance: What is left of it beyond what the pair needs [m].
        point_a: Witness point on A, world, shape (3,) [m].
        point_b: Witness point on B, world, shape (3,) [m].
    """

    a: str
    b: str
    distance: float
    clearance: float
    point_a: Floats
    point_b: Floats


class Answer:
    """What robots are to do: from the service, or from a client that hears nothing.

    It holds the message; numbers are read from it when they are asked for.

    Attributes:
        began: Sender and number of the state that began the cycle; zeros for none.
        sent: When it was sent, on the service's clock [s].
        welcome: Description of the service.
        clock: The service's clock, as far as it is known here.
    """

    __slots__ = ("_body", "_fields", "_message", "began", "clock", "sent", "welcome")

    def __init__(
        self,
        message: bytes,
        fields: tuple[int, ...],
        welcome: Welcome,
        clock: Callable[[], float],
    ) -> None:
        # The message, whose seal fits, and its `FIELDS`.
        self._message, self._fields = message, fields
        self._body: tuple[float, ...] | None = None
        self.began = fields[BEGAN]
        self.sent = fields[SENT] * NANO
        self.welcome = welcome
        self.clock = clock

    def __repr__(self) -> str:
        return (
            f"Answer(cycle={self.cycle}, level={self.level.name}, "
            f"action={self.action.name}, cause={self.cause.name}, "
            f"held={list(self.held)}, velocity={self.velocity})"
        )

    @property
    def velocity(self) -> Floats:
        """Joint velocities to send, shape (n,) [rad/s or m/s]; not to be written."""
        n = self._fields[JOINTS]
        first = ROBOTS_AT + ROW * self._fields[ROBOTS]
        return frombuffer(self._message, FLOAT, n, first)

    @property
    def position(self) -> Floats:
        """The same as positions, shape (n,) [rad or m]; not to be written."""
        n = self._fields[JOINTS]
        first = ROBOTS_AT + ROW * self._fields[ROBOTS] + 8 * n
        return frombuffer(self._message, FLOAT, n, first)

    @property
    def cycle(self) -> int:
        """Number of the cycle; -1 if it is not the service's."""
        return int(self._cut[0])

    @property
    def inside(self) -> float:
        """From a state's arrival to when it had been judged; NaN if none came [s]."""
        _, sender, _, received, ended = self._cut[:5]
        return (ended - received) * NANO if sender else nan

    @property
    def time(self) -> float:
        """Time of the cycle, on the service's clock [s]."""
        return self._cut[5]

    @property
    def slack(self) -> float:
        """What the nearest pair has left beyond what it needs [m]."""
        return self._cut[6]

    @property
    def slack_time(self) -> float:
        """Least time until a stop must be ordered [s]."""
        return self._cut[7]

    @property
    def nearest(self) -> Nearest | None:
        """The pair with the least clearance; None if none is near."""
        a, b, distance, clearance, *points = self._cut[8:]
        if a == NOBODY:
            return None
        bodies, ends = self.welcome.bodies, np.array(points).reshape(2, 3)
        return Nearest(bodies[int(a)], bodies[int(b)], distance, clearance, *ends)

    @property
    def reason_number(self) -> int:
        """The guard's reason."""
        return self._fields[REASON]

    @property
    def cause(self) -> Cause:
        """Cause of the service or of the client, beside the guard's reason."""
        return CAUSES[self._fields[CAUSE]]

    @property
    def level_number(self) -> int:
        """The highest level."""
        return self._fields[LEVEL]

    @property
    def action_number(self) -> int:
        """The highest action."""
        return self._fields[ACTION]

    @property
    def missed(self) -> bool:
        """Whether the cycle ended later than its period allows."""
        return bool(self._fields[FLAGS] & MISSED)

    @property
    def objects_changed(self) -> bool:
        """Whether an object was placed or removed within the last second."""
        return bool(self._fields[FLAGS] & OBJECTS_CHANGED)

    @property
    def commander(self) -> int:
        """Number of the commander; 0 if there is none."""
        return self._fields[COMMANDER]

    @property
    def numbers(self) -> tuple[RobotNumbers, ...]:
        """The row of each robot, in the order of a COMMAND."""
        rows = self._message[ROBOTS_AT : ROBOTS_AT + ROW * self._fields[ROBOTS]]
        return tuple(map(RobotNumbers._make, ROBOT.iter_unpack(rows)))

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
            away = f"{near.a} to {near.b}: {near.distance * 1e3:.0f} mm"
            sentence = f"{sentence} ({away}, {near.clearance * 1e3:.0f} mm left)"
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
    def _cut(self) -> tuple[float, ...]:
        """The fields of the `COMMAND`."""
        if self._body is None:
            self._body = BODY.unpack_from(self._message, HEADER.size)
        return self._body

    def _rows(self) -> Iterator[tuple[str, RobotNumbers]]:
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
    body = -1, 0, 0, 0, 0, now, nan, nan, NOBODY, NOBODY, *(nan,) * 8
    summary = 0, cause, STOP_LEVEL, STOP_ACTION, 0, joints, robots, 0, 0
    message = (
        HEADER.pack(*(0,) * 8, round(now / NANO))
        + BODY.pack(*body)
        + SUMMARY.pack(*summary)
        + ROBOT.pack(*STOPPED) * robots
        + bytes(8 * joints)
        + np.asarray(position, np.float64).tobytes()
        + bytes(SEAL)
    )
    return Answer(message, FIELDS.unpack_from(message), welcome, clock)
